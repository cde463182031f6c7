"""`fecm diff` with tapes as text, the original program's and spoiled ones."""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from fecm import load
from fecm.listing.tapes import fortran_number, read_tapes, write_tapes
from tests.calls import assert_unusable, diff, line_about
from tests.decks import DATA


def originals(mode: str, folder: Path) -> Path:
    """The original program's tapes in a folder of their own."""
    folder.mkdir()
    for name in ("tape3", "tape8", "tape9"):
        shutil.copy(DATA / f"appendix-{mode}-{name}.txt", folder / name)
    return folder


@pytest.mark.parametrize("mode", ["report", "listing"])
@pytest.mark.few(1)  # of 2, 0.2 s each
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


@pytest.mark.parametrize("name", ["report", "listing", "small"])
@pytest.mark.few(1)  # of 3, 0.2 s each
def test_a_result_is_its_own_tapes_to_their_last_digit(
    runs: Path, tmp_path: Path, name: str
) -> None:
    result = runs / f"{name}.h5"
    write_tapes(load(result), tmp_path)
    done = diff(result, tmp_path)
    assert done.exit_code == 0, done.stdout
    assert done.stdout.endswith("within the last digit of the tapes\n")
    assert diff(result, tmp_path, "--rtol", "0").exit_code == 1


def test_tapes_differ_where_a_number_is_two_units_of_its_last_digit_away(
    runs: Path, tmp_path: Path
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    write_tapes(load(runs / "small.h5"), a)
    lines = (a / "tape9").read_text().splitlines()
    least = min((line[:12] for line in lines), key=lambda field: abs(float(field)))
    for units, status in ((1, 0), (2, 1)):
        shutil.copytree(a, b, dirs_exist_ok=True)
        digits = int(least.strip()[2:6])
        near = digits - units if digits > 5000 else digits + units
        moved = least.replace(f".{digits:04d}", f".{near:04d}")
        (b / "tape9").write_text("\n".join(lines).replace(least, moved) + "\n")
        assert diff(a, b).exit_code == status
    assert "1 number differs" in line_about(diff(a, b), "tape9/force")


def test_the_tapes_of_both_modes_differ_most_at_the_impact_node(tmp_path: Path) -> None:
    done = diff(originals("report", tmp_path / "a"), originals("listing", tmp_path / "b"))
    assert done.exit_code == 1
    assert "at row 2, node 305" in line_about(done, "tape3/w")


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
        assert line_about(done, "tape9/force").startswith("only in A")
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
    assert "shape 2x609 against 1x609" in line_about(done, "tape3/w")


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
    assert "1 against 2 at line 4, column 1" in line_about(done, "tape3/w")


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
    [*TAPES, "truncated", "binary", "empty", "foreign", "later", "folder", "both", "twice",
     pytest.param("pipe", marks=pytest.mark.links), "missing"],
)  # fmt: skip
def test_what_cant_be_compared_exits_2_with_one_line(runs: Path, tmp_path: Path, name: str) -> None:
    wrong = spoiled(name, tmp_path, runs / "report.h5")
    for sides in ((runs / "report.h5", wrong), (wrong, runs / "report.h5")):
        assert_unusable(diff(*sides))


def test_an_unreadable_number_of_a_tape_is_shown_with_its_line(runs: Path, tmp_path: Path) -> None:
    wrong = spoiled("overflowed", tmp_path, runs / "report.h5")
    done = diff(runs / "report.h5", wrong)
    assert f"{wrong}/tape9:2: `************` is not a number" in done.stderr
