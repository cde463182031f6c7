"""`fecm indent`: tests in, cards and curves out, and what is no test."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from fecm.fitting.constants import fit
from tests.calls import assert_unusable, call
from tests.decks import LONG
from tests.indentation_tests import ALPHA_P, S_P, K, Q, make_test, noisy, written


def test_a_curve_of_the_deck_fits_back_to_the_decks_card(tmp_path: Path) -> None:
    made = call("indent", "curve", LONG, "--path", "1e-3,0,2e-3,8e-4,3e-3,0", "--points", 60)
    rows = list(csv.DictReader(io.StringIO(made.stdout)))
    assert len(rows) == 1 + 6 * 60
    at_peak = rows[60]
    assert float(at_peak["indentation"]) == 1e-3
    assert float(at_peak["force"]) == pytest.approx(1.912e6 * 1e-3**1.5, rel=1e-12)
    assert [rows[n]["branch"] for n in (60, 61, 149, 151, 200, 241)] == [
        "loading", "unloading", "reloading", "loading", "unloading", "reloading",
    ]  # fmt: skip
    (tmp_path / "test.csv").write_text(made.stdout)
    done = call("indent", "fit", tmp_path / "test.csv")
    assert done.exit_code == 0
    assert done.stdout.splitlines()[-2:] == ["EXPE", " 1912000.0 0.0006564     0.094       2.0"]


def test_a_fit_for_programs_has_every_value_with_its_error(tmp_path: Path) -> None:
    a, f = make_test()
    file = written(tmp_path / "test.csv", a, noisy(f, 0))
    found = json.loads(call("indent", "fit", file, "--format", "json").stdout)
    for name, truth in (("k", K), ("n", 1.5), ("q", Q), ("s_p", S_P), ("alpha_p", ALPHA_P)):
        assert abs(found[name]["value"] - truth) < 4.0 * found[name]["error"]
    assert len(found["cycles"]) == 4
    assert set(found["cycles"][0]) >= {"alpha_m", "alpha_0", "k_1"}
    assert found["card"].startswith("EXPE\n")


def test_a_test_that_never_unloads_tells_k_and_n_alone(tmp_path: Path) -> None:
    a, f = make_test()
    file = written(tmp_path / "test.csv", a[:101], noisy(f[:101], 0))
    done = call("indent", "fit", file)
    assert done.exit_code == 0
    assert "EXPE" not in done.stdout
    assert "never unloads" in done.stderr
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
        ("a,b\n1,2\n", "there must be one called indentation"),
        ("indentation;force\n1;2\n", "there must be one called indentation"),
        ("force,force,indentation\n1,2,3\n", "there must be one called force"),
        ("indentation,force\n0,0\n1e-3,x1\n", ":3: force is 'x1'"),
        ("indentation,force\n0,0\n1e-3\n", ":3: force is nothing"),
        ("indentation,force\n0,nan\n0,0\n", ":2: force is 'nan'"),
        ("indentation,force\n" + "0.001,5\n" * 20, "never changes"),
        ("indentation,force\n1,1\n2,2\n", "too few"),
        ("indentation,force\n" + "".join(f"{n},{n}\n" for n in range(30, 0, -1)), "unloading"),
        ("indentation,force\n" + "".join(f"{n},{-n}\n" for n in range(30)), "never positive"),
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
    from fecm.plot.indentation import fit_picture as draw

    a, f = make_test()
    found = fit(a, noisy(f, 0))
    figure = draw(a, noisy(f, 0), found, {"length": "in", "force": "lbf"}).figure
    curves, line = figure.axes
    assert curves.get_xlabel() == "Indentation (10⁻³ in)"
    assert line.get_ylabel() == "Permanent indentation (10⁻³ in)"
    drawn = [np.asarray(one.get_xdata()) for one in curves.get_lines() if one.get_marker() == "."]
    assert sum(map(len, drawn)) == len(a) - 7  # all but the points at the turns
    x, y = map(np.asarray, line.get_lines()[-1].get_data())
    assert found.line is not None
    slope = (y[-1] - y[-2]) / (x[-1] - x[-2])
    assert slope == pytest.approx(found.line.s_p.value, rel=1e-9)


@pytest.mark.parametrize("options", [("--path", "2e-3,0"), ("--rigidity", "--q", "2.5")])
def test_curves_and_rigidities_are_drawn(tmp_path: Path, options: tuple[str, ...]) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "curve.svg"
    done = call("indent", "curve", LONG, *options, "--plot", picture)
    assert done.exit_code == 0
    assert "Indentation" in picture.read_text() or "indentation" in picture.read_text()
    again = call("indent", "curve", LONG, *options, "--plot", picture)
    assert_unusable(again)
