"""`fecm diff`: what is the same, what differs and where, and what can't be compared."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm import load
from tests.calls import Done, assert_unusable, call, diff, line_about
from tests.decks import LONG, PROGRAM, ROOT, small

Edit = Callable[[h5py.File], object]


def verdict(done: Done) -> str:
    """The first word of the last line."""
    return done.stdout.splitlines()[-1].partition(":")[0]


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
    assert "6.18964 against 6.64198 at step 10" in line_about(done, "history/force")
    assert "first at step 1 " in line_about(done, "history/force")
    assert "shape 2 against 10" in line_about(done, "tape9/force")
    assert line_about(done, "mode:") == "listed     mode: `report` against `listing`"
    assert line_about(done, "mesh/coordinates").startswith("same")


def test_a_zero_crossing_is_judged_by_the_size_of_the_whole_history(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair
    maximum = float(np.abs(load(a)["history/transducer"]).max())
    b = changed(
        put("history/transducer", 0, float(load(a)["history/transducer"][0]) + 0.99e-3 * maximum)
    )
    assert diff(a, b, "--rtol", "1e-3", "--only", "history").exit_code == 0
    done = diff(a, b, "--rtol", "0.98e-3", "--only", "history")
    assert done.exit_code == 1
    assert "first at step 1 " in line_about(done, "history/transducer")


def test_the_absolute_tolerance_is_in_the_datasets_own_unit(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair
    b = changed(lambda f: f["history/force"].write_direct(f["history/force"][()] + 0.5))
    assert diff(a, b, "--atol", "0.501", "--only", "history").exit_code == 0
    assert diff(a, b, "--atol", "0.499", "--only", "history").exit_code == 1


def test_force_that_first_differs_at_step_3_is_said_to(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair

    def edit(file: h5py.File) -> None:
        file["history/force"][2:] = file["history/force"][2:] * 1.01

    line = line_about(diff(a, changed(edit), "--only", "history/force"), "history/force")
    assert "first at step 3 (time 1.5e-06)" in line
    assert "8 numbers differ" in line


NAN, INF = math.nan, math.inf


# Values of one step in both files, and whether they are the same.
SPECIAL = {
    "force": (NAN, NAN, True), "indentation": (NAN, 1.0, False), "transducer": (1.0, NAN, False),
    "displacement": (INF, INF, True), "velocity": (INF, -INF, False),
    "acceleration": (INF, 1e300, False), "plate_w": (INF, NAN, False), "time": (0.0, -0.0, True),
}  # fmt: skip


def test_nan_is_nan_and_an_infinity_only_itself_at_any_tolerance(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path
) -> None:
    def special(side: int) -> Path:
        def edit(file: h5py.File) -> None:
            for name, values in SPECIAL.items():
                file["history"][name][4] = values[side]

        return pair[1](edit)

    a, b = shutil.copy(special(0), tmp_path / "a.h5"), special(1)
    for tolerance in ((), ("--rtol", "10", "--atol", "1e308")):
        done = diff(a, b, *tolerance, "--only", "history", "--format", "json")
        assert done.exit_code == 1
        by_name = {entry["name"]: entry for entry in strict(done)["datasets"]}
        for name, (_, _, same) in SPECIAL.items():
            entry = by_name[f"history/{name}"]
            assert entry["same"] is same, name
            if not same:
                assert entry["at"]["step"] == entry["first"]["step"] == 5
                assert entry["largest_difference"] is None
                assert entry["differing"] == 1
    alike = "--only", "history/force", "--only", "history/displacement", "--only", "history/time"
    assert diff(a, b, *alike).exit_code == 0


def strict(done: Done) -> Any:
    """Read JSON that knows no NaN."""

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    return json.loads(done.stdout, parse_constant=refuse)


def test_another_shape_or_type_is_a_difference_at_any_tolerance(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    changes: dict[str, tuple[Any, str]] = {
        "history/force": (lambda f: f["history/force"][:9], "shape 10 against 9"),
        "history/time": (lambda f: f["history/time"][()].reshape(2, 5), "shape 10 against 2x5"),
        "history/velocity": (lambda f: f["history/velocity"][()].astype("f4"),
                             "type float64 against float32"),
        "tape3/step": (lambda f: f["tape3/step"][()].astype("i4"), "type int64 against int32"),
        "laminate/A": (3.0, "shape 3x3 against single"),
    }  # fmt: skip

    def edit(file: h5py.File) -> None:
        for name, (values, _) in changes.items():
            replaced(name, values)(file)

    a, changed = pair
    done = diff(a, changed(edit), "--rtol", "10", "--atol", "1e9")
    assert done.exit_code == 1
    for name, (_, words) in changes.items():
        assert words in line_about(done, name)
    assert verdict(done) == "different"
    assert "5 of " in done.stdout.splitlines()[-1]


def test_node_numbers_and_steps_must_be_equal_at_any_tolerance(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    a, changed = pair
    done = diff(a, changed(put("mesh/elements", (2, 8), 1)), "--rtol", "10", "--atol", "1e9")
    assert done.exit_code == 1
    assert "element 3, position 9" in line_about(done, "mesh/elements")


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
    assert line_about(done, "tape8/kappa_x") == "only in A  tape8/kappa_x"
    assert line_about(done, "extra/thing") == "only in B  extra/thing"
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
        "name": "tape8:colour",
        "a": None,
        "b": [1.0, "NaN"],
        "line": None,
    }


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


def test_excluded_datasets_are_counted_and_not_compared(runs: Path) -> None:
    sides = runs / "report.h5", runs / "listing.h5"
    done = diff(*sides, "--only", "tape3", "--exclude", "*/w", "--exclude", "modes", "--brief")
    assert done.stdout.splitlines()[:-1] == ["tape3/displacement"]
    assert done.stdout.endswith("different: 1 of 3 datasets at rtol 0, atol 0; 1 excluded\n")
    said = strict(diff(*sides, "--only", "tape3", "--exclude", "tape3/w", "--format", "json"))
    assert said["excluded"] == ["tape3/w"]


def test_the_last_tolerance_that_matches_a_dataset_holds(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path
) -> None:
    a, changed = pair
    b = changed(lambda f: f["history/force"].write_direct(f["history/force"][()] * 1.001))
    file = tmp_path / "tolerances.toml"
    file.write_text('rtol = 1e-9\nexclude = ["tape8"]\n[tol]\n"history/force" = 1e-2\n')
    for options, status in (
        (("--tol", "history/force=1.01e-3"), 0),
        (("--tol", "history=1e-2", "--tol", "history/force=1e-4"), 1),
        (("--tol", "history/force=1e-4", "--tol", "h*/force=1e-2"), 0),
        (("--tol", "history/force=0,1e9"), 0),
        (("--tol", "history/force=1e-4", "--atol", "1e9"), 0),
        (("--tol-file", file), 0),
        (("--tol-file", file, "--tol", "history=1e-4"), 1),
    ):
        assert diff(a, b, "--only", "history", *options).exit_code == status, options
    said = strict(diff(a, b, "--tol-file", file, "--rtol", "1e-3", "--format", "json"))
    by_name = {
        entry["name"]: entry["tolerance"] / (entry["scale"] or 1.0)
        for entry in said["datasets"]
        if "force" in entry["name"]
    }
    assert by_name == pytest.approx({"history/force": 1e-2, "tape9/force": 1e-3})
    assert "tape8/kappa_x" in said["excluded"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rtol = true", "rtol: `True` is not R"),
        ("atol = [1, 2]", "atol: `[1, 2]` is not R"),
        ('exclude = "tape8"', "exclude is not a list of texts"),
        ("tol = 3", "tol is not a table; begin it with [tol]"),
        ("tolerance = 3", "tolerance is unknown; the keys are rtol, atol, exclude and tol"),
        ("rtol 3", "at line 1"),
    ],
)
def test_a_wrong_tolerance_file_exits_2_and_names_the_key(
    runs: Path, tmp_path: Path, text: str, words: str
) -> None:
    (tmp_path / "t.toml").write_text(text)
    small = runs / "small.h5"
    done = diff(small, small, "--tol-file", tmp_path / "t.toml")
    assert_unusable(done)
    assert "t.toml: " in done.stderr
    assert words in done.stderr


def test_the_documented_recipe_passes_rounding_and_fails_a_tenth_of_a_degree(
    tmp_path: Path,
) -> None:
    page = (ROOT / "docs" / "diff.md").read_text()
    run, compare = (
        line.split("fecm ")[1].split() for line in page.splitlines() if "- run: fecm" in line
    )
    deck, expected = tmp_path / run[1], tmp_path / compare[1]
    deck.parent.mkdir()
    expected.parent.mkdir()
    deck.write_text(LONG.read_text().replace("LOOP       4000", "LOOP        200"))
    assert call("run", deck, "-o", expected, "--solver", "csr").exit_code == 0
    assert call(*run, cwd=tmp_path).exit_code == 0
    assert call(*compare, cwd=tmp_path).exit_code == 0
    assert diff(expected, tmp_path / "new.h5").exit_code == 1
    ply = "    2  45.    0.0053\n"
    assert deck.read_text().count(ply) == 1
    deck.write_text(deck.read_text().replace(ply, ply.replace(" 45.", "45.1")))
    assert call(*run, "--overwrite", cwd=tmp_path).exit_code == 0
    done = call(*compare, cwd=tmp_path)
    assert done.exit_code == 1
    assert line_about(done, "history/force").startswith("different")


def test_small_blocks_of_rows_find_the_same(
    pair: tuple[Path, Callable[[Edit], Path]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def edit(file: h5py.File) -> None:
        for path in ("history/force", "tape3/w", "tape8/kappa_x"):
            file[path][...] *= np.random.default_rng(9).uniform(0.9, 1.1, file[path].shape)

    first, other = pair[0], pair[1](edit)
    whole = diff(first, other).stdout
    assert whole.count("different ") >= 3
    monkeypatch.setattr("fecm.results.stored.BLOCK", 1)
    assert diff(first, other).stdout == whole


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--rtol", "-1"), "'--rtol': -1.0 is not in the range x>=0"),
        (("--atol", "nan"), "'--atol': 'nan' is not a finite number"),
        (("--rtol", "nan", "--atol", "-1"), "'nan'"),
        (("--rtol", "inf"), "'inf'"),
        (("--rtol", "1,5"), "'1,5'"),
        (("--only", "tape9/forse"), "did you mean tape9/force"),
        (("--only", "force"), "did you mean history/force or tape9/force?"),
        (("--only", "tapes"), "tape3"),
        (("--only", "nonsense"), "there are energy, history, laminate, mesh, tape3"),
        (("--exclude", "force"), "did you mean history/force or tape9/force?"),
        (("--exclude", "*"), "every dataset is excluded"),
        (("--tol", "history/forse=1"), "did you mean history/force"),
        (("--tol", "history/force"), "'history/force' is not of the form NAME=VALUE"),
        (("--tol", "history/force=-1"), "history/force: `-1` is not R or R,T"),
        (("--tol", "history=1e-6,1,2"), "`1e-6,1,2` is not R or R,T"),
    ],
)
def test_a_wrong_tolerance_or_name_exits_2_and_says_what_would_do(
    runs: Path, arguments: tuple[str, ...], words: str
) -> None:
    done = diff(runs / "small.h5", runs / "small.h5", *arguments)
    assert_unusable(done)
    assert words in done.stderr


def test_help_says_how_numbers_are_judged() -> None:
    text = " ".join(diff("--help").stdout.split())
    assert "|a - b| <= T + R * max" in text
    assert "to one unit of the last of their four digits" in text
    assert "largest absolute value" in text


# What is judged by another measure than its own largest value -------------------------------------


def test_a_residue_of_the_energies_is_judged_by_the_energies(
    pair: tuple[Path, Callable[[Edit], Path]],
) -> None:
    sound, changed = pair
    initial = 0.5 * 1.8096e-4 * 115.0**2

    def residue(share: float) -> Edit:
        return replaced("energy/balance_error", lambda file: np.full(10, share * initial))

    assert (
        diff(sound, changed(residue(0.9e-4)), "--rtol", "1e-4", "--only", "energy").exit_code == 0
    )
    done = diff(sound, changed(residue(1.2e-4)), "--rtol", "1e-4", "--only", "energy")
    assert done.exit_code == 1
    assert "of the energy put in 1.196" in done.stdout
    done = diff(sound, changed(residue(2e-4)), "--only", "energy", "--format", "json")
    said = json.loads(done.stdout)
    entry = next(d for d in said["datasets"] if d["name"] == "energy/balance_error")
    assert entry["scale"] == pytest.approx(initial, rel=1e-3)
    assert entry["relative"] == pytest.approx(2e-4, rel=2e-3)


def test_resultants_of_the_midplane_are_judged_by_those_of_bending(tmp_path: Path) -> None:
    a, b = tmp_path / "a.h5", tmp_path / "b.h5"
    plate = small(program=PROGRAM.replace("NEXT", "STRE          5\nNEXT"))
    fecm.run(plate.replace("    2  90. ", "    2   0. "), output=a)
    with h5py.File(a) as file:
        assert not file["stresses/N_x"][()].any()
        moment = max(abs(file[f"stresses/M_{name}"][()]).max() for name in ("x", "y", "xy"))
        curvature = max(abs(file[f"stresses/kappa_{name}"][()]).max() for name in ("x", "y", "xy"))
    # A = E h and D = E h^3 / 12 along the fibres; h is 0.106 in.
    scales = {"N_y": moment * 12.0**0.5 / 0.106, "eps_xx": curvature * 0.106 / 12.0**0.5}
    shutil.copy(a, b)
    with h5py.File(b, "r+") as file:
        for name, scale in scales.items():
            file[f"stresses/{name}"][0, 0, 0] = 1e-9 * scale
    assert diff(a, b, "--rtol", "1.01e-9", "--only", "stresses").exit_code == 0
    done = diff(a, b, "--rtol", "0.99e-9", "--only", "stresses")
    assert all(line_about(done, f"stresses/{name}").startswith("different") for name in scales)


def test_coupling_that_is_a_rounding_is_judged_by_stretching_and_bending(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path
) -> None:
    changed = pair[1]
    symmetric = tmp_path / "symmetric.h5"
    with h5py.File(pair[0]) as file:
        scale = float((file["laminate/A"][()].max() * file["laminate/D"][()].max()) ** 0.5)

    def coupled(share: float) -> Edit:
        return replaced("laminate/B", lambda file: np.full((3, 3), share * scale))

    shutil.copy(changed(coupled(1e-16)), symmetric)
    tolerance = ("--rtol", "1e-6", "--only", "laminate")
    assert diff(symmetric, changed(coupled(0.9e-6)), *tolerance).exit_code == 0
    assert diff(symmetric, changed(coupled(1.1e-6)), *tolerance).exit_code == 1


def test_free_flight_does_not_loosen_the_measure_of_the_indentation(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path
) -> None:
    changed = pair[1]
    far = tmp_path / "far.h5"

    def flight(file: h5py.File) -> None:
        file["history/indentation"][0] = -1.0

    def deeper(file: h5py.File) -> None:
        flight(file)
        file["history/indentation"][5] += 1e-5

    shutil.copy(changed(flight), far)
    with h5py.File(far) as file:
        deepest = file["history/indentation"][()].max()
    assert 0.0 < deepest < 1e-3
    for tolerance, status in (("1e-3", 1), ("3e-2", 0)):
        done = diff(far, changed(deeper), "--rtol", tolerance, "--only", "history")
        assert done.exit_code == status


def test_values_that_differ_are_shown_with_the_digits_that_differ(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path
) -> None:
    changed = pair[1]

    def edit(file: h5py.File) -> None:
        file["energy"].attrs["initial"] *= 1.0 + 1e-12
        file.attrs["title"] = "small plate" + 80 * "-" + "a"

    def other(file: h5py.File) -> None:
        file.attrs["title"] = "small plate" + 80 * "-" + "b"

    one = tmp_path / "one.h5"
    shutil.copy(changed(other), one)
    done = diff(one, changed(edit))
    (listed,) = (line for line in done.stdout.splitlines() if "energy:initial" in line)
    a, b = (float(text) for text in listed.split("`")[1::2])
    assert b / a - 1.0 == pytest.approx(1e-12, rel=1e-2)
    (listed,) = (line for line in done.stdout.splitlines() if " title" in line)
    titles = listed.split("`")[1::2]
    assert (titles[0][0], titles[1][0], titles[0][-1], titles[1][-1]) == ("…", "…", "b", "a")


def test_the_coupling_of_a_numbered_laminate_is_judged_and_named_by_its_scale(
    pair: tuple[Path, Callable[[Edit], Path]], tmp_path: Path
) -> None:
    _, changed = pair

    def several(file: h5py.File) -> None:
        for name in ("A", "B", "D"):
            file[f"laminate/2/{name}"] = file[f"laminate/{name}"][()]

    b = Path(shutil.copy(changed(several), tmp_path / "several.h5"))
    with h5py.File(b, "r+") as file:
        largest = [np.abs(file[f"laminate/2/{name}"][()]).max() for name in ("A", "D")]
        scale = math.sqrt(math.prod(largest))
        file["laminate/2/B"][0, 0] += 1e-3 * scale
    done = diff(b, changed(several), "--only", "laminate")
    assert f"of sqrt(max A * max D) {scale:.6g})" in line_about(done, "laminate/2/B")
    assert diff(b, changed(several), "--rtol", "1.1e-3", "--only", "laminate").exit_code == 0
