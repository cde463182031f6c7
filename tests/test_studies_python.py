"""Studies and the catalogue as Python code calls them."""

from __future__ import annotations

import doctest
import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from tests.calls import call
from tests.decks import LONG, small
from tests.test_estimate import HELD, deck

MODULES = (
    "fecm.deck.catalogue",
    "fecm.deck.units",
    "fecm.studies.indentation_test.study",
    "fecm.studies.rod_test.study",
    "fecm.studies.waves.study",
    "fecm.sweeps.estimate",
)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_print_what_they_say(name: str) -> None:
    actual = doctest.testmod(import_module(name))
    assert actual.attempted > 0
    assert actual.failed == 0


# Estimates ----------------------------------------------------------------------------------------


def test_an_estimate_is_what_the_command_prints(tmp_path: Path) -> None:
    path = tmp_path / "d.inp"
    path.write_text(deck("DELA\n.5,\n", mesh=HELD))
    with pytest.warns(fecm.FecmWarning) as caught:
        actual = fecm.estimate(path)
    texts = [str(one.message) for one in caught]
    assert actual.notes
    assert set(actual.notes) <= set(texts)
    assert {one.filename for one in caught} == {__file__}
    shown = call("estimate", path)
    assert shown.stdout == f"{actual}\n"
    assert all(f"note: {text}" in shown.stderr for text in actual.notes)
    listed = json.loads(call("estimate", path, "--format", "json").stdout)
    for row in listed["models"]:
        assert row["energy"] == actual.models[row["model"]].energy


def test_an_estimate_of_a_deck_with_errors_or_several_problems_is_refused() -> None:
    with pytest.raises(fecm.DeckError):
        fecm.estimate("nonsense\n")
    with pytest.raises(ValueError, match="2 problems, not one"):
        fecm.estimate(deck().replace("STOP\n", "") + deck())


# Waves --------------------------------------------------------------------------------------------


def test_waves_of_a_layup_are_those_of_its_deck_and_of_the_command() -> None:
    layup = fecm.waves(fecm.Laminate("[0/45/0/-45/0]2s", "report", 0.0053))
    of_deck = fecm.waves(LONG)
    assert layup.units == {"length": "in", "force": "lbf", "time": "s"}
    curve = of_deck.dispersion(45.0, [1.0, 10.0])
    np.testing.assert_allclose(
        layup.dispersion(45.0, [1.0, 10.0]).phase_velocity, curve.phase_velocity, rtol=1e-12
    )
    done = call("waves", "dispersion", LONG, "--angle", "45", "--wavelengths", "1:10:2")
    table = [line.split(",") for line in done.stdout.splitlines()[1:]]
    assert [row[2] for row in table[:5]] == list(curve.modes)
    assert [float(row[3]) for row in table] == curve.phase_velocity.ravel().tolist()
    cusps = of_deck.cusps(5e-6)
    assert cusps == of_deck.cusps(5e-6, of_deck.thickness)
    assert len(cusps) == 8


def test_waves_of_a_named_ply_are_in_the_units_that_are_asked_for() -> None:
    slow, fast = (
        fecm.waves(fecm.Laminate("[0/90]s", "IM7/8552"), units=units)
        for units in ("mm-N-s", "m-N-s")
    )
    assert (slow.units["length"], fast.units["length"]) == ("mm", "m")
    assert slow.thickness == pytest.approx(4 * 0.131)
    assert "0.131 mm thick" in slow.notes[0]
    np.testing.assert_allclose(
        slow.fronts([30.0]).velocity, 1e3 * fast.fronts([30.0]).velocity, rtol=1e-5
    )


def test_waves_of_plies_of_two_densities_do_not_depend_on_the_side_of_the_heavy_one() -> None:
    """An isotropic plate whose upper half is heavier: R couples u and phi, equation 2-24."""
    light, heavy = (fecm.Ply(rho, 0.3, 70e3, 70e3, 70e3 / 2.6, 27e3, 27e3) for rho in (1e-9, 9e-9))
    plies = {"L": light, "H": heavy}
    waves = fecm.waves(fecm.Laminate("[0L/0H]", plies, {"L": 1.0, "H": 1.0}), units="mm-N-s")
    mass, first, second = 10e-9, 4e-9, 10e-9 / 3.0
    # Extension and bending along x: |K - c^2 M| = 0 with K = E/(1 - nu^2) diag(h, h^3/12)
    plane = 70e3 / 0.91
    fast = np.linalg.eigvals(
        np.linalg.solve(
            [[mass, first], [first, second]], np.diag([2.0 * plane, 8.0 / 12.0 * plane])
        )
    )
    actual = waves.fronts([0.0]).velocity[0]
    for speed in np.sqrt(fast.real):
        assert np.abs(actual / speed - 1.0).min() < 1e-9


def test_a_laminate_that_makes_no_waves_is_refused_in_the_words_of_the_call() -> None:
    bad = fecm.Ply(1.0, 0.3, 1.0, 1.0, -1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="shear modulus G12 is -1"):
        fecm.waves(fecm.Laminate("0", bad, 1.0))
    with pytest.raises(ValueError, match="`ply_thickness` is missing: report has no known"):
        fecm.waves(fecm.Laminate("0", "report"))
    with pytest.raises(ValueError, match="`shear_factor` is 0"):
        fecm.waves(LONG, shear_factor=0.0)
    with pytest.raises(ValueError, match="the deck has its own `units`"):
        fecm.waves(LONG, units="mm-N-s")
    with pytest.raises(ValueError, match="must not be negative"):
        fecm.waves(LONG).cusps(-1.0)


# Indentation tests --------------------------------------------------------------------------------


@pytest.mark.long
def test_a_fit_is_what_the_command_prints_of_a_file_or_of_arrays(tmp_path: Path) -> None:
    path = fecm.examples.path("indentation-test")
    units = ("in", "lbf")
    with pytest.warns(fecm.FecmWarning, match="alpha_m of cycle 1 is the recorded value"):
        actual = fecm.fit_indentation(path, units=units)
    assert call("indent", "fit", path, "--unit", "in,lbf").stdout == f"{actual}\n"
    listed = json.loads(call("indent", "fit", path, "--format", "json").stdout)
    assert listed["k"] == {"value": actual.k.value, "error": actual.k.error}
    columns = np.loadtxt(path, delimiter=",", skiprows=3, unpack=True)
    same = fecm.fit_indentation((columns[0], columns[1]), units=units)
    record = next(line for line in str(actual).splitlines() if line.lstrip().startswith("record "))
    assert str(same) == str(actual).replace(f"{record}\n", "")
    # The report's constants of the 0.5 in indenter, of which the example is made.
    assert actual.k.value == pytest.approx(1.330e6, abs=3.0 * actual.k.error)
    assert actual.law is not None
    deck = fecm.impact(
        fecm.Plate.rectangle((4, 3), (4, 4), support="simple"),
        fecm.Laminate("[0/90]s", "report", 0.02),
        contact=actual.law,
        velocity=100.0,
        duration=1e-5,
    )
    assert f"EXPE\n{str(same).splitlines()[-1]}" in deck.to_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"q": 20.0}, "`q` is 20, not between 0.3 and 12"),
        ({"q": 2.0, "acr": True}, "equation 3-7 holds for no other power"),
        ({"turn": -1.0}, "`turn` is -1.0"),
        ({"units": "mm,N"}, "`units` is 'mm,N', not two names"),
        ({"columns": ["x"]}, "`columns` is .*, not two names"),
        ({"columns": ["x", "y"]}, "`columns` of indentation and force selects others"),
        ({"test": ([1.0, 2.0],)}, "arrays of indentation and force"),
        ({"test": ([1.0] * 20, [float("nan")] * 20)}, "not finite"),
        ({"test": ([1.0] * 20, [1.0] * 19)}, "differ in length"),
    ],
)
def test_what_is_no_indentation_test_is_refused(options: dict[str, Any], words: str) -> None:
    test = options.pop("test", fecm.examples.path("indentation-test"))
    with pytest.raises(ValueError, match=words) as caught:
        fecm.fit_indentation(test, **options)
    assert isinstance(caught.value, fecm.FecmError)


# Pulses -------------------------------------------------------------------------------------------


def test_a_pulse_test_of_a_deck_is_that_of_the_command(tmp_path: Path) -> None:
    pulse, table = "gauss:1000,200e-6,40e-6", tmp_path / "p.csv"
    actual = fecm.pulse_test(LONG, pulse, duration=3e-4, filter="first-order:10e-6")
    options = ("--duration", "3e-4", "--filter", "first-order:10e-6", "-o", table)
    assert call("rod", LONG, "--pulse", pulse, *options).stdout == f"{actual}\n"
    columns = np.loadtxt(table, delimiter=",", skiprows=1, unpack=True)
    np.testing.assert_array_equal(columns[2], actual.forces[:, 0])
    assert actual.filtered is not None
    np.testing.assert_array_equal(columns[3], actual.filtered[:, 0])
    assert actual.units == {}  # the deck names none


def test_a_pulse_of_arrays_is_linear_between_its_points() -> None:
    rod = fecm.Rod.cylinder(1.0, 0.625, 30e6, 7.33e-4)
    actual = fecm.pulse_test(rod, ([0.0, 1e-4], [0.0, 500.0]), dt=1e-6)
    np.testing.assert_allclose(actual.applied, 5e6 * actual.time, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pulse": "square:1"}, "neither a file nor a pulse"),
        ({"pulse": ([0.0, 0.0], [1.0, 1.0])}, "must increase"),
        ({"pulse": ([-2.0, -1.0], [1.0, 1.0])}, "ends before time 0"),
        ({"pulse": ([0.0], [1.0])}, "2 or more"),
        ({"stations": [2.0]}, "station 2 is not on the rod"),
        ({"dt": 0.0}, "`dt` is 0.0"),
        ({"integrator": "euler"}, "`integrator` is 'euler', none of wilson"),
        ({"rod": small().replace("EXPE", "PROJ\n0, 0, 1e-3\n\nEXPE")}, "is a rigid mass"),
        ({"rod": small(), "units": "mm-N-s"}, "the deck has its own `units`"),
        ({"units": "mm-N"}, "not a whole system"),
    ],
)
def test_what_is_no_pulse_test_is_refused(options: dict[str, Any], words: str) -> None:
    rod = options.pop("rod", fecm.Rod.cylinder(1.0, 0.625, 30e6, 7.33e-4))
    pulse = options.pop("pulse", "sine:1,1e-4")
    with pytest.raises(ValueError, match=words) as caught:
        fecm.pulse_test(rod, pulse, **options)
    assert isinstance(caught.value, fecm.FecmError)
