"""`fecm indent`: tests in, cards and curves out, and what is no test."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from fecm.studies.indentation_test.constants import fit_contact_law
from fecm.studies.indentation_test.turns import read_test
from tests.calls import assert_unusable, call, record_of
from tests.decks import LONG
from tests.indentation_tests import ALPHA_P, S_P, K, Q, make_test, noisy, written


def test_a_curve_of_the_deck_fits_back_to_the_decks_card(tmp_path: Path) -> None:
    answer = call("indent", "curve", LONG, "--path", "1e-3,0,2e-3,8e-4,3e-3,0", "--points", 60)
    rows = list(csv.DictReader(io.StringIO(answer.stdout)))
    assert len(rows) == 1 + 6 * 60
    at_peak = rows[60]
    assert float(at_peak["indentation"]) == 1e-3
    assert float(at_peak["force"]) == pytest.approx(1.912e6 * 1e-3**1.5, rel=1e-12)
    assert [rows[n]["branch"] for n in (60, 61, 149, 151, 200, 241)] == [
        "loading",
        "unloading",
        "reloading",
        "loading",
        "unloading",
        "reloading",
    ]
    (tmp_path / "test.csv").write_text(answer.stdout)
    done = call("indent", "fit", tmp_path / "test.csv")
    assert done.exit_code == 0
    assert done.stdout.splitlines()[-2:] == ["EXPE", " 1912000.0 0.0006564     0.094       2.0"]


def test_a_curve_has_the_units_of_the_deck_in_which_it_is_read(tmp_path: Path) -> None:
    named = LONG.read_text().replace("COOR", "UNIT\nin lbf s\nCOOR", 1)
    (tmp_path / "named.inp").write_text(named)
    path = ("--path", "1e-3,0,2e-3,8e-4,3e-3,0", "--points", 60)
    answer = call("indent", "curve", "named.inp", *path, "-o", "test.csv", cwd=tmp_path)
    assert answer.exit_code == 0
    assert (tmp_path / "test.csv").read_text().startswith("indentation (in),force (lbf),branch\n")
    done = call("indent", "fit", "test.csv", cwd=tmp_path)
    assert "units           in, lbf" in done.stdout
    assert done.stdout.splitlines()[-1] == " 1912000.0 0.0006564     0.094       2.0"


def test_a_fit_for_programs_has_every_value_with_its_error(tmp_path: Path) -> None:
    a, f = make_test()
    file = written(tmp_path / "test.csv", a, noisy(f, 0))
    document = json.loads(call("indent", "fit", file, "--format", "json").stdout)
    for name, truth in (("k", K), ("n", 1.5), ("q", Q), ("s_p", S_P), ("alpha_p", ALPHA_P)):
        assert abs(document[name]["value"] - truth) < 4.0 * document[name]["error"]
    assert len(document["cycles"]) == 4
    assert set(document["cycles"][0]) >= {"alpha_m", "alpha_0", "k_1"}
    assert document["card"].startswith("EXPE\n")


def test_a_test_that_never_unloads_tells_k_and_n_alone(tmp_path: Path) -> None:
    a, f = make_test()
    file = written(tmp_path / "test.csv", a[:101], noisy(f[:101], 0))
    done = call("indent", "fit", file)
    assert done.exit_code == 0
    assert "EXPE" not in done.stdout
    assert "has no unloading" in done.stderr
    assert float(done.stdout.split(" k ")[1].split()[0]) == pytest.approx(K, rel=0.02)


def test_one_cycle_gives_no_card_but_one_of_alpha_cr(tmp_path: Path) -> None:
    file = written(tmp_path / "test.csv", *make_test((3e-3,)))
    done = call("indent", "fit", file)
    assert done.exit_code == 0
    assert "EXPE" not in done.stdout
    assert "--acr" in done.stderr
    assert call("indent", "fit", file, "--acr").stdout.splitlines()[-2] == "EXPE ACR"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "fewer than two rows"),
        ("indentation,force\n", "fewer than two rows"),
        ("a,b\n1,2\n", "one must be named indentation"),
        ("indentation;force\n1;2\n", "fewer than two rows"),
        ("force,force,indentation\n1,2,3\n", "one must be named force"),
        ("indentation,force\n0,0\n1e-3,x1\n", ":3: force is 'x1'"),
        ("indentation,force\n0,0\n1e-3\n", ":3: force is empty"),
        ("indentation,force\n0,nan\n0,0\n", ":2: force is 'nan'"),
        ("indentation,force\n" + "0.001,5\n" * 20, "never changes"),
        ("indentation,force\n1,1\n2,2\n", "too few"),
        ("indentation,force\n" + "".join(f"{n},{n}\n" for n in range(30, 0, -1)), "unloading"),
        ("indentation,force\n" + "".join(f"{n},{-n}\n" for n in range(30)), "force is -29 at the"),
        ("indentation,force\n" + "".join(f"{n}e90,{n}\n" for n in range(30)), "not between"),
    ],
)
def test_what_is_no_test_is_refused_in_one_line(tmp_path: Path, text: str, what: str) -> None:
    file = tmp_path / "test.csv"
    file.write_text(text)
    done = call("indent", "fit", file)
    assert_unusable(done)
    assert what in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("curve", LONG),
        ("curve", LONG, "--path", "a,b"),
        ("curve", LONG, "--path", "nan"),
        ("curve", LONG, "--path", "1e300"),
        ("curve", LONG, "--path", "1e-3", "--q", "2"),
        ("curve", LONG, "--rigidity", "--path", "1e-3"),
        ("curve", LONG, "--rigidity", "--plot", "rigidity.png"),
        ("curve", LONG.parent / "static-bending.inp", "--path", "1e-3"),
        ("curve", "nowhere.inp", "--path", "1e-3"),
        ("hertz", "--radius", "0", "--es", "1", "--nus", "0", "--et", "1"),
        ("hertz", "--radius", "1", "--es", "1", "--nus", "1", "--et", "1"),
        ("hertz", "--radius", "1", "--es", "nan", "--nus", "0", "--et", "1"),
        ("hertz", "--radius", "1", "--es", "1", "--nus", "0", "--et", "1", "--q", "inf"),
        ("contacts", "none"),
        ("fit", LONG),
    ],
)
def test_wrong_calls_are_refused(arguments: tuple[object, ...]) -> None:
    done = call("indent", *arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert "rror: " in done.stderr
    assert "Traceback" not in done.stderr


def test_a_deck_is_not_replaced_by_its_own_curve(tmp_path: Path) -> None:
    deck = tmp_path / "deck.inp"
    deck.write_text(LONG.read_text())
    done = call("indent", "curve", deck, "--path", "1e-3", "-o", deck, "--overwrite")
    assert_unusable(done)
    assert deck.read_text() == LONG.read_text()


def test_the_picture_of_a_fit_holds_every_point_and_the_line() -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.studies import indentation_fit_picture as draw

    a, f = make_test()
    fit = fit_contact_law(a, noisy(f, 0))
    figure = draw(a, noisy(f, 0), fit, {"length": "in", "force": "lbf"}).figure
    curves, line = figure.axes
    assert curves.get_xlabel() == "Indentation (10⁻³ in)"
    assert line.get_ylabel() == "Permanent indentation (10⁻³ in)"
    drawn = [np.asarray(one.get_xdata()) for one in curves.get_lines() if one.get_marker() == "."]
    assert sum(map(len, drawn)) == len(a) - 7  # all but the points at the turns
    x, y = map(np.asarray, line.get_lines()[-1].get_data())
    assert fit.line is not None
    slope = (y[-1] - y[-2]) / (x[-1] - x[-2])
    assert slope == pytest.approx(fit.line.s_p.value, rel=1e-9)


@pytest.mark.parametrize("options", [("--path", "2e-3,0"), ("--rigidity", "--q", "2.5")])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_curves_and_rigidities_are_drawn(tmp_path: Path, options: tuple[str, ...]) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "curve.svg"
    done = call("indent", "curve", LONG, *options, "--plot", picture)
    assert done.exit_code == 0
    assert "Indentation" in picture.read_text() or "indentation" in picture.read_text()
    again = call("indent", "curve", LONG, *options, "--plot", picture)
    assert_unusable(again)


# Files of testing machines -----------------------------------------------------------------------


def machine(path: Path, head: str, sizes: tuple[float, float], separator: str, mark: str) -> Path:
    """A test as a machine writes it: in units of these sizes (in, lbf), with this decimal mark."""
    rows = np.transpose(make_test())
    lines = [
        separator.join(
            f"{value / size:.9e}".replace(".", mark) for value, size in zip(row, sizes, strict=True)
        )
        for row in rows
    ]
    path.write_bytes("\n".join([head, *lines]).encode("latin-1" if "µ" in head else "utf-8"))
    return path


MM, UM, NEWTON, KN = 1 / 25.4, 1e-3 / 25.4, 1 / 4.4482216152605, 1e3 / 4.4482216152605


@pytest.mark.parametrize(
    ("head", "sizes", "separator", "mark", "units"),
    [
        ("indentation,force", (1.0, 1.0), ",", ".", None),
        ("Displacement,Load", (1.0, 1.0), ",", ".", None),
        ("Displacement (mm);Load (kN)", (MM, KN), ";", ",", ("mm", "N")),
        ("Stroke\tForce\n(µm)\t(N)", (UM, NEWTON), "\t", ".", ("mm", "N")),
        ("Extension;Load\nin;lbf", (1.0, 1.0), ";", ",", ("in", "lbf")),
        ("depth [mil],load [kip]", (1e-3, 1e3), ",", ".", ("in", "lbf")),
        ("displacement (m),force (N)", (1000 * MM, NEWTON), ",", ".", ("m", "N")),
    ],
)
def test_files_of_testing_machines_give_the_same_law(
    tmp_path: Path,
    head: str,
    sizes: tuple[float, float],
    separator: str,
    mark: str,
    units: tuple[str, str] | None,
) -> None:
    file = machine(tmp_path / "test.csv", head, sizes, separator, mark)
    done = call("indent", "fit", file, "--format", "json")
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    length, force = {
        None: (1.0, 1.0),
        ("in", "lbf"): (1.0, 1.0),
        ("mm", "N"): (MM, NEWTON),
        ("m", "N"): (1000 * MM, NEWTON),
    }[units]
    assert document["units"] == (
        dict(zip(("length", "force"), units, strict=True)) if units else None
    )
    assert document["k"]["value"] == pytest.approx(K / force * length**1.5, rel=1e-6)
    assert document["alpha_p"]["value"] == pytest.approx(ALPHA_P / length, rel=1e-3)


def test_a_fit_states_the_units_of_its_card(tmp_path: Path) -> None:
    file = machine(tmp_path / "test.csv", "Stroke (mm),Load (kN)", (MM, KN), ",", ".")
    stdout = call("indent", "fit", file).stdout
    assert f"record          test.csv, SHA-256 {record_of(file)['sha256']}\n" in stdout
    assert "units           mm, N (the test: mm, kN)\nEXPE\n" in stdout
    stdout = call("indent", "fit", file, "--unit", "in,lbf").stdout
    assert "units           in, lbf (the test: mm, kN)\nEXPE\n 1330000.0" in stdout
    plain = written(tmp_path / "plain.csv", *make_test())
    stdout = call("indent", "fit", plain).stdout
    assert "units           not named in the test\nEXPE\n" in stdout


@pytest.mark.parametrize("columns", ["3,2", "way,push", "WAY,2"])
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_columns_are_chosen_by_name_or_number(tmp_path: Path, columns: str) -> None:
    a, f = make_test()
    file = tmp_path / "test.csv"
    rows = "".join(f"{n},{y},{x}\n" for n, (x, y) in enumerate(zip(a, f, strict=True)))
    file.write_text(f"time,push,way\n{rows}")
    assert call("indent", "fit", file).exit_code == 2
    read = read_test(file, columns.split(","))
    np.testing.assert_array_equal(read.indentation, a)
    np.testing.assert_array_equal(read.force, f)
    assert call("indent", "fit", file, "--columns", columns).exit_code == 0


@pytest.mark.parametrize(
    ("head", "options", "what"),
    [
        ("displacement (furlong),load (N)", (), "unknown unit of length `furlong`"),
        ("displacement (mm),load (channel 2)", (), "unknown unit of force `channel 2`"),
        ("displacement (mm),load (mn)", (), "unknown unit of force `mn`"),
        ("displacement (N),load (mm)", (), "unknown unit of length `N`"),
        ("displacement (mm),load", (), "one column is in mm, the other has no unit"),
        ("displacement (mm),load (N)", ("--unit", "mm,furlong"), "unknown unit of force `furlong`"),
        ("displacement\n(mm)", (), "one must be named force"),
        ("displacement,load", ("--columns", "2,x"), "one must be named x"),
        ("displacement,load", ("--columns", "0,1"), "one must be named 0"),
        ("displacement,load", ("--columns", "1,7"), "force is empty"),
    ],
)
def test_units_and_columns_that_mean_nothing_are_refused(
    tmp_path: Path, head: str, options: tuple[str, ...], what: str
) -> None:
    file = machine(tmp_path / "test.csv", head, (1.0, 1.0), ",", ".")
    done = call("indent", "fit", file, *options)
    assert_unusable(done)
    assert what in done.stderr


def test_numbers_with_points_and_commas_are_refused_between_semicolons(tmp_path: Path) -> None:
    file = tmp_path / "test.csv"
    file.write_text("displacement;load\n0.001;1,234\n0.002;2,345\n")
    done = call("indent", "fit", file)
    assert_unusable(done)
    assert ":2: force is '1,234', not a finite number" in done.stderr
