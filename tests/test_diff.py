"""`fecm diff`: what is the same, what differs and where, and what can't be compared."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm.results import compare
from fecm.results.result import load
from fecm.results.tape_reader import fortran_number, read_tapes
from fecm.results.tapes import write_tapes
from tests.calls import Done, assert_unusable, call
from tests.decks import APPENDIX, DATA, small

Edit = Callable[[h5py.File], object]


def diff(*arguments: object) -> Done:
    """Call ``fecm diff``."""
    return call("diff", *arguments)


def verdict(done: Done) -> str:
    """The first word of the last line."""
    return done.stdout.splitlines()[-1].partition(":")[0]


def told(done: Done, name: str) -> str:
    """The line about a dataset."""
    return next(line for line in done.stdout.splitlines() if name in line.split())


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with results of the report's deck in both modes, and of a small deck."""
    folder = tmp_path_factory.mktemp("runs")
    for mode in ("report", "listing"):
        fecm.run(APPENDIX, mode=mode, output=folder / f"{mode}.h5")
    fecm.run(small(), output=folder / "small.h5")
    return folder


@pytest.fixture
def pair(runs: Path, tmp_path: Path) -> tuple[Path, Callable[[Edit], Path]]:
    """A small result, and what makes a changed copy of it."""
    copy = tmp_path / "b.h5"

    def changed(edit: Edit) -> Path:
        shutil.copy(runs / "small.h5", copy)
        with h5py.File(copy, "r+") as file:
            edit(file)
        return copy

    return runs / "small.h5", changed


def originals(mode: str, folder: Path) -> Path:
    """The original program's tapes in a folder of their own."""
    folder.mkdir()
    for name in ("tape3", "tape8", "tape9"):
        shutil.copy(DATA / f"appendix-{mode}-{name}.txt", folder / name)
    return folder


def replaced(path: str, values: Any) -> Edit:
    """An edit that puts another dataset in the place of one."""

    def edit(file: h5py.File) -> None:
        attributes = dict(file[path].attrs)
        new = values(file) if callable(values) else values
        del file[path]
        file[path] = new
        file[path].attrs.update(attributes)

    return edit


def put(path: str, index: Any, value: float) -> Edit:
    """An edit of single numbers."""

    def edit(file: h5py.File) -> None:
        file[path][index] = value

    return edit


def test_two_runs_of_one_deck_are_the_same_with_no_tolerance_at_all(
    runs: Path, tmp_path: Path
) -> None:
    fecm.run(small(), output=tmp_path / "again.h5")
    done = diff(runs / "small.h5", tmp_path / "again.h5")
    assert done.exit_code == 0
    assert verdict(done) == "same"
    assert all(line.startswith("same") for line in done.stdout.splitlines())


def test_the_modes_differ_and_the_first_step_of_the_force_is_named(runs: Path) -> None:
    done = diff(runs / "report.h5", runs / "listing.h5")
    assert done.exit_code == 1
    assert verdict(done) == "different"
    # Peaks of the original program: 6.190 lb and 6.642 lb, both in step 10.
    assert "6.18964 against 6.64198 at step 10" in told(done, "history/force")
    assert "first at step 1 " in told(done, "history/force")
    assert "shape 2 against 10" in told(done, "tape9/force")
    assert told(done, "mode:") == "listed     mode: `report` against `listing`"
    assert told(done, "mesh/coordinates").startswith("same")


@pytest.mark.parametrize("mode", ["report", "listing"])
def test_a_result_is_the_original_programs_tapes_to_four_digits(
    runs: Path, tmp_path: Path, mode: str
) -> None:
    tapes = originals(mode, tmp_path / "tapes")
    for sides in ((runs / f"{mode}.h5", tapes), (tapes, runs / f"{mode}.h5")):
        done = diff(*sides, "--rtol", "1e-3")
        assert done.exit_code == 0, done.stdout
        assert done.stdout.count("same ") == 12
        assert diff(*sides, "--rtol", "1e-6").exit_code == 1


def test_a_results_own_tapes_are_the_originals_text_in_report_order(
    runs: Path, tmp_path: Path
) -> None:
    write_tapes(load(runs / "report.h5"), tmp_path / "own")
    done = diff(tmp_path / "own", originals("report", tmp_path / "tapes"), "--rtol", "1e-6")
    assert done.exit_code == 0, done.stdout


def test_the_tapes_of_both_modes_differ_most_at_the_impact_node(tmp_path: Path) -> None:
    done = diff(originals("report", tmp_path / "a"), originals("listing", tmp_path / "b"))
    assert done.exit_code == 1
    assert "at row 2, node 305" in told(done, "tape3/w")


@pytest.mark.parametrize("mode", ["report", "listing"])
def test_the_original_shear_columns_are_told_by_where_the_strains_stand(
    tmp_path: Path, mode: str
) -> None:
    strains, columns = ("tape8", (5, 6)) if mode == "report" else ("tape9", (6, 5))
    folder = originals(mode, tmp_path / "tapes")
    table = np.array([line.split() for line in (folder / strains).read_text().splitlines()])
    arrays = read_tapes(folder).arrays
    for name, column in zip(("gamma_yz", "gamma_xz"), columns, strict=True):
        np.testing.assert_array_equal(
            arrays[f"tape8/{name}"].ravel(), table[:, column].astype(float)
        )


def test_tapes_with_the_suffix_txt_are_found(runs: Path, tmp_path: Path) -> None:
    folder = originals("report", tmp_path / "tapes")
    for path in list(folder.iterdir()):
        path.rename(path.with_suffix(".txt"))
    assert diff(runs / "report.h5", folder, "--rtol", "1e-3").exit_code == 0


def test_a_tape_that_is_missing_or_empty_is_a_difference(runs: Path, tmp_path: Path) -> None:
    folder = originals("report", tmp_path / "tapes")
    (folder / "tape9").write_text("")
    for _ in range(2):
        done = diff(runs / "report.h5", folder, "--rtol", "1e-3")
        assert done.exit_code == 1
        assert told(done, "tape9/force").startswith("only in A")
        (folder / "tape9").unlink(missing_ok=True)
    assert (
        diff(
            runs / "report.h5", folder, "--rtol", "1e-3", "--only", "tape3", "--only", "tape8"
        ).exit_code
        == 0
    )


def test_a_tape_short_of_a_whole_row_differs_in_shape(runs: Path, tmp_path: Path) -> None:
    folder = originals("report", tmp_path / "tapes")
    lines = (folder / "tape3").read_text().splitlines(keepends=True)
    (folder / "tape3").write_text("".join(lines[:102]))
    done = diff(runs / "report.h5", folder, "--rtol", "1e-3")
    assert done.exit_code == 1
    assert "shape 2x609 against 1x609" in told(done, "tape3/w")


@pytest.mark.parametrize("nodes", [3, 12, 25])
def test_rows_of_tape3_are_found_for_any_number_of_nodes(tmp_path: Path, nodes: int) -> None:
    w = np.arange(1.0, 4 * nodes + 1).reshape(4, nodes)
    lines = [
        "".join(f"{value:12.4E}" for value in row[start : start + 6])
        for row in w
        for start in range(0, nodes, 6)
    ]
    (tmp_path / "tape3").write_text("\n".join(lines))
    text = read_tapes(tmp_path)
    assert text.lines == (nodes == 12)
    np.testing.assert_array_equal(text.fitted(nodes).arrays["tape3/w"], w)


def test_lines_of_six_are_compared_by_lines_where_nothing_tells_the_nodes(tmp_path: Path) -> None:
    line = "  0.1000E+01" * 6 + "\n"
    for name, text in (("a", line * 4), ("b", line * 3 + "  0.2000E+01" + line[12:])):
        (tmp_path / name).mkdir()
        (tmp_path / name / "tape3").write_text(text)
    done = diff(tmp_path / "a", tmp_path / "b")
    assert "1 against 2 at line 4, column 1" in told(done, "tape3/w")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        (b"  0.2322E+01", 2.322), (b" -0.1149E-03", -1.149e-4), (b"  0.1234+100", 1.234e99),
        (b" -0.1234-100", -1.234e-101), (b"  0.5000D+01", 5.0), (b"    Infinity", math.inf),
        (b"   -Infinity", -math.inf), (b"   0.1234000", 0.1234),
    ],
)  # fmt: skip
def test_every_form_of_fortrans_numbers_is_read(field: bytes, value: float) -> None:
    assert fortran_number(field) == value


def test_what_is_no_number_of_fortran_is_none() -> None:
    assert math.isnan(fortran_number(b"         NaN") or 0.0)
    for field in (
        b"************",
        b"            ",
        b" 1_0",
        b"0x10",
        b"  0.1000+999",
        b" 0.1 0E+01",
    ):
        assert fortran_number(field) is None


def test_a_zero_crossing_is_judged_by_the_size_of_the_whole_history(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair
    maximum = float(np.abs(load(a)["history/transducer"]).max())
    b = changed(
        put("history/transducer", 0, float(load(a)["history/transducer"][0]) + 0.99e-3 * maximum)
    )
    assert diff(a, b, "--rtol", "1e-3").exit_code == 0
    done = diff(a, b, "--rtol", "0.98e-3")
    assert done.exit_code == 1
    assert "first at step 1 " in told(done, "history/transducer")


def test_the_absolute_tolerance_is_in_the_datasets_own_unit(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair
    b = changed(lambda f: f["history/force"].write_direct(f["history/force"][()] + 0.5))
    assert diff(a, b, "--atol", "0.501").exit_code == 0
    assert diff(a, b, "--atol", "0.499").exit_code == 1


def test_force_that_first_differs_at_step_3_is_said_to(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair

    def edit(file: h5py.File) -> None:
        file["history/force"][2:] = file["history/force"][2:] * 1.01

    line = told(diff(a, changed(edit), "--only", "history/force"), "history/force")
    assert "first at step 3 (time 1.5e-06)" in line
    assert "8 numbers differ" in line


NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("left", "right", "same"),
    [
        (NAN, NAN, True), (NAN, 1.0, False), (1.0, NAN, False), (INF, INF, True),
        (INF, -INF, False), (INF, 1e300, False), (INF, NAN, False), (0.0, -0.0, True),
    ],
)  # fmt: skip
def test_nan_is_nan_and_an_infinity_only_itself_at_any_tolerance(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path, left: float, right: float, same: bool
) -> None:
    _, changed = pair
    a = shutil.copy(changed(put("history/velocity", 4, left)), tmp_path / "a.h5")
    b = changed(put("history/velocity", 4, right))
    for tolerance in ((), ("--rtol", "10", "--atol", "1e308")):
        done = diff(a, b, *tolerance, "--format", "json")
        assert done.exit_code == (0 if same else 1)
        entry = next(d for d in strict(done)["datasets"] if d["name"] == "history/velocity")
        assert entry["same"] is same
        if not same:
            assert entry["at"]["step"] == entry["first"]["step"] == 5
            assert entry["largest_difference"] is None
            assert entry["differing"] == 1


def strict(done: Done) -> Any:
    """Read JSON that knows no NaN."""

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    return json.loads(done.stdout, parse_constant=refuse)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (replaced("history/force", lambda f: f["history/force"][:9]), "shape 10 against 9"),
        (replaced("history/force", lambda f: f["history/force"][()].reshape(2, 5)),
         "shape 10 against 2x5"),
        (replaced("history/force", lambda f: f["history/force"][()].astype("f4")),
         "type float64 against float32"),
        (replaced("tape3/step", lambda f: f["tape3/step"][()].astype("i4")),
         "type int64 against int32"),
        (replaced("laminate/A", 3.0), "shape 3x3 against single"),
    ],
)  # fmt: skip
def test_another_shape_or_type_is_a_difference_at_any_tolerance(
    pair: tuple[Path, Callable[[Edit], Path]], edit: Edit, words: str
) -> None:
    a, changed = pair
    done = diff(a, changed(edit), "--rtol", "10", "--atol", "1e9")
    assert done.exit_code == 1
    assert words in done.stdout
    assert verdict(done) == "different"
    assert "1 of " in done.stdout.splitlines()[-1]


def test_node_numbers_and_steps_must_be_equal_at_any_tolerance(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair
    done = diff(a, changed(put("mesh/elements", (2, 8), 1)), "--rtol", "10", "--atol", "1e9")
    assert done.exit_code == 1
    assert "element 3, position 9" in told(done, "mesh/elements")


def test_a_dataset_that_one_file_alone_has_is_a_difference(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair

    def edit(file: h5py.File) -> None:
        del file["tape8/kappa_x"]
        file["extra/thing"] = [1.0, 2.0]

    b = changed(edit)
    done = diff(a, b)
    assert done.exit_code == 1
    assert told(done, "tape8/kappa_x") == "only in A  tape8/kappa_x"
    assert told(done, "extra/thing") == "only in B  extra/thing"
    assert diff(a, b, "--only", "history").exit_code == 0
    assert diff(a, b, "--brief").stdout.splitlines()[:-1] == ["extra/thing", "tape8/kappa_x"]
    said = strict(diff(a, b, "--format", "json"))
    assert (said["only_in_a"], said["only_in_b"]) == (["tape8/kappa_x"], ["extra/thing"])


def test_title_attributes_and_deck_are_listed_and_not_judged(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair

    def edit(file: h5py.File) -> None:
        file.attrs["title"] = "another\nplate \x1b[31m"
        file["tape8"].attrs["colour"] = np.array([1.0, math.nan])
        deck = file["deck"].asstr()[()].replace("LMAS", "lmas")
        file["deck"][()] = deck

    b = changed(edit)
    done = diff(a, b)
    assert done.exit_code == 0
    assert r"title: `small plate` against `another\nplate \x1b[31m`" in done.stdout
    assert "deck line" in done.stdout
    assert "`LMAS` against `lmas`" in done.stdout
    listed = {item["name"]: item for item in strict(diff(a, b, "--format", "json"))["listed"]}
    assert listed["tape8:colour"] == {
        "name": "tape8:colour", "a": None, "b": [1.0, "NaN"], "line": None
    }  # fmt: skip


def test_only_takes_datasets_and_groups_and_brief_prints_names(runs: Path) -> None:
    sides = runs / "report.h5", runs / "listing.h5"
    done = diff(*sides, "--only", "tape3", "--only", "/history/force", "--brief")
    assert done.stdout.splitlines()[:-1] == ["history/force", "tape3/displacement", "tape3/w"]
    assert diff(*sides, "--only", "mesh", "--brief").stdout.startswith("same: 3 datasets")


def test_json_tells_all_that_the_text_does(runs: Path) -> None:
    done = diff(runs / "report.h5", runs / "listing.h5", "--format", "json", "--rtol", "1e-6")
    said = strict(done)
    assert done.exit_code == 1
    assert done.stdout.count("\n") == 1
    assert said["verdict"] == "different"
    assert said["rtol"] == 1e-6
    entry = next(item for item in said["datasets"] if item["name"] == "tape3/w")
    assert entry["at"] == {"index": [1, 304], "step": 10, "time": entry["at"]["time"], "node": 305}
    assert entry["largest_difference"] == abs(entry["a"] - entry["b"])
    assert entry["tolerance"] == 1e-6 * entry["maximum"]
    assert entry["shape_a"] == [2, 609]


def test_small_blocks_of_rows_find_the_same(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = diff(runs / "report.h5", runs / "listing.h5").stdout
    monkeypatch.setattr(compare, "BLOCK", 1)
    assert diff(runs / "report.h5", runs / "listing.h5").stdout == whole


def spoiled(name: str, folder: Path, source: Path) -> Path:
    """Something that can't be compared."""
    path = folder / name
    if name in TAPES:
        originals("report", path)
        tape, old, new = TAPES[name]
        text = (path / tape).read_bytes()
        assert old in text
        (path / tape).write_bytes(text.replace(old, new, 1))
    elif name == "truncated":
        path.write_bytes(source.read_bytes()[:-1000])
    elif name == "binary":
        path.write_bytes(bytes(range(256)) * 8)
    elif name == "empty":
        path.write_bytes(b"")
    elif name == "foreign":
        with h5py.File(path, "w") as file:
            file["x"] = 1.0
    elif name == "later":
        shutil.copy(source, path)
        with h5py.File(path, "r+") as file:
            file.attrs["format_version"] = 2
    elif name in ("folder", "both", "twice"):
        path.mkdir()
        if name != "folder":
            line = "  0.1000E+01" * 6
            for tape in ("tape8", "tape8.txt") if name == "both" else ("tape8", "tape9"):
                (path / tape).write_text(line)
    elif name == "pipe":
        os.mkfifo(path)
    return path


FIRST = b"     1     1  0.0000E+00"
TAPES = {
    "ragged line": ("tape9", b"  0.1478E+06", b"  0.1478E+"),
    "ragged row": ("tape9", b"  0.1478E+06", b""),
    "overflowed": ("tape9", b"  0.1478E+06", b"************"),
    "blank number": ("tape9", b"  0.6190E+01", b"            "),
    "word": ("tape9", b"  0.1478E+06", b"  0.nan8E+06"),
    "too large": ("tape9", b"  0.1478E+06", b"  0.1478+999"),
    "zero byte": ("tape9", b"  0.1478E+06", b"  0.1478E+\0\0"),
    "lost element": ("tape8", FIRST, b"     1     2  0.0000E+00"),
    "vast element": ("tape8", FIRST, b"999999999999  0.0000E+00"),
    "no element": ("tape8", FIRST, b"     0     0  0.0000E+00"),
    "row of w": ("tape3", b"  0.0000E+00\n", b"\n"),
}


@pytest.mark.parametrize(
    "name",
    [*TAPES, "truncated", "binary", "empty", "foreign", "later", "folder", "both", "twice", "pipe",
     "missing"],
)  # fmt: skip
def test_what_cant_be_compared_exits_2_with_one_line(runs: Path, tmp_path: Path, name: str) -> None:
    wrong = spoiled(name, tmp_path, runs / "report.h5")
    for sides in ((runs / "report.h5", wrong), (wrong, runs / "report.h5")):
        assert_unusable(diff(*sides))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--rtol", "-1"), "--rtol: `-1` is no number from 0 on"),
        (("--atol", "nan"), "--atol: `nan`"),
        (("--rtol", "nan", "--atol", "-1"), "`nan`"),
        (("--rtol", "inf"), "`inf`"),
        (("--rtol", "1,5"), "`1,5`"),
        (("--only", "tape9/forse"), "did you mean tape9/force"),
        (("--only", "force"), "did you mean history/force or tape9/force?"),
        (("--only", "tapes"), "tape3"),
        (("--only", "nonsense"), "there are energy, history, laminate, mesh, tape3"),
    ],
)
def test_a_wrong_tolerance_or_name_exits_2_and_says_what_would_do(
    runs: Path, arguments: tuple[str, ...], words: str
) -> None:
    done = diff(runs / "small.h5", runs / "small.h5", *arguments)
    assert_unusable(done)
    assert words in done.stderr


def test_an_unreadable_number_of_a_tape_is_shown_with_its_line(runs: Path, tmp_path: Path) -> None:
    wrong = spoiled("overflowed", tmp_path, runs / "report.h5")
    done = diff(runs / "report.h5", wrong)
    assert f"{wrong}/tape9:2: `************` is not a number" in done.stderr


def test_help_says_how_numbers_are_judged() -> None:
    text = " ".join(diff("--help").stdout.split())
    assert "|a - b| <= T + R * max" in text
    assert "--rtol 1e-3" in text
    assert "largest absolute value" in text
