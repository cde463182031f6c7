"""Parameters fitted to measured forces: recovery, standard errors, refusals, and the command."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm._errors import StudyError
from fecm.authoring.case import CasesError
from fecm.deck.model import Indentation
from fecm.identification.alignment import IdentifyError
from fecm.plot.histories import force_fit_picture
from fecm.studies.rod_test.filters import filter_of
from tests.calls import Done, assert_unusable, call, record_of
from tests.decks import PROGRAM, small

Floats = NDArray[np.float64]

FREE = ["k", "alpha_p", "mass", "velocity"]
TRUE = {"k": 1.2e5, "alpha_p": 0.01, "mass": 2e-5, "velocity": 3000.0}
DURATION, NOISE = 1.6e-4, 0.02
TIME = np.linspace(DURATION / 200, DURATION, 200)
STEPS = PROGRAM.replace("LOOP         10", "LOOP        160")
UNITS = "UNIT\nin lbf s\n"


def plate(
    elements: int, dt: float, k: float, alpha_p: float, mass: float, velocity: float, q: float = 2.0
) -> fecm.Deck:
    """A mass on a plate of n x n elements, mm-N-s; a pressure on 18 mm makes meshes comparable."""
    return fecm.impact(
        fecm.Plate.rectangle((100, 100), (elements, elements), support="simple"),
        fecm.Laminate("[45/0/-45/90]2s", "AS4/8552", 0.18),
        fecm.RigidMass(mass),
        fecm.Contact(k, alpha_p, 0.6 if q == 2.0 else 0.0, q),
        velocity=velocity,
        duration=DURATION,
        dt=dt,
        units="mm-N-s",
        patch="hertz:18",
    )


@cache
def measured() -> Floats:
    """Force of the true parameters on a finer mesh with finer steps."""
    result = fecm.run_one(plate(16, 2e-7, **TRUE))
    return np.interp(TIME, result.time, result.force)


@cache
def started() -> fecm.Deck:
    """Deck on the coarser mesh with values off by 10 to 50 %."""
    return plate(12, 4e-7, k=1e5, alpha_p=0.015, mass=2.3e-5, velocity=2700.0)


def deviations(seed: int) -> list[float]:
    """Fitted minus true values over their standard errors, from a noisy measurement."""
    force = measured()
    noise = NOISE * force.max() * np.random.default_rng(seed).normal(size=len(TIME))
    fit = fecm.identify(started(), TIME, force + noise, FREE)
    assert fit.converged
    assert not fit.notes
    assert fit.share == pytest.approx(NOISE, rel=0.25)
    return [(fit.values[name] - TRUE[name]) / fit.errors[name] for name in FREE]


def test_the_true_parameters_are_found_from_a_noisy_force_of_another_mesh() -> None:
    assert np.abs(deviations(0)).max() < 2.5


def test_the_fitted_deck_has_no_cards_of_the_deck_that_was_read() -> None:
    deck = fecm.read_one(started().to_text())
    fit = fecm.identify(deck, TIME, measured(), ["k"])
    assert deck.text
    assert fit.deck.text == ""
    assert f"{fit.values['k']:.5g}" == f"{fit.deck.require(Indentation).k:.5g}"


def test_fitted_values_have_the_units_of_the_deck() -> None:
    fit = fecm.identify(started(), TIME, measured(), ["k", "mass", "delay", "offset"])
    assert fit.units == {"length": "mm", "force": "N", "time": "s"}
    units = {name: fit.unit(name) for name in fit.values}
    assert units == {"k": "N/mm^1.5", "mass": "N*s^2/mm", "delay": "s", "offset": "N"}
    (line,) = (line for line in str(fit).split("\n") if line.startswith("  mass ") and " g" in line)
    _, value, unit, _, _, start, _ = line.split()
    assert float(value) == pytest.approx(1e6 * fit.values["mass"], rel=1e-4)  # g in a tonne
    assert (unit, start) == ("g", "23")
    with pytest.raises(KeyError, match="velocity was not fitted"):
        fit.unit("velocity")


def test_velocity_and_energy_are_not_fitted_together() -> None:
    with pytest.raises(CasesError, match="velocity and energy exclude each other"):
        fecm.identify(started(), TIME, measured(), ["velocity", "energy"])


@pytest.mark.long
def test_true_parameters_are_within_two_standard_errors_in_95_of_100_cases() -> None:
    bias = fecm.identify(started(), TIME, measured(), FREE)
    # The meshes differ by far less than the noise.
    assert bias.share < NOISE / 20
    values = np.array([deviations(seed) for seed in range(100)])
    inside = np.count_nonzero(np.abs(values) < 2.0, axis=0)
    assert (np.abs(inside - 95) <= 4).all(), inside
    assert np.std(values, axis=0) == pytest.approx(np.ones(4), abs=0.2)


# What a measurement does not determine -----------------------------------------------------------


@pytest.mark.long
def test_a_contact_below_alpha_p_neither_determines_it_nor_describes_a_plastic_one() -> None:
    hard = plate(12, 4e-7, **{**TRUE, "alpha_p": 1.0})
    result = fecm.run_one(hard)
    with pytest.raises(IdentifyError, match="does not depend on alpha_p here"):
        fecm.identify(hard, result.time, result.force, ["k", "alpha_p"])
    with pytest.warns(fecm.FecmWarning, match="neighbouring residuals"):
        fecm.identify(hard, TIME, measured(), ["velocity"])


def test_k_mass_and_velocity_are_one_too_many_for_hertzs_contact(tmp_path: Path) -> None:
    # A grain of 2 mg on 60 mm: Hertz's impact on a half-space has a peak and a duration only.
    deck = fecm.impact(
        fecm.Plate.rectangle((100, 100), (6, 6), support="simple"),
        fecm.Laminate("[0/90]s", "AS4/8552", 15.0),
        fecm.RigidMass(2e-9),
        fecm.Contact(1.2e5, 0.0, 0.0, 1.5),
        velocity=100.0,
        duration=3e-5,
        dt=2e-7,
        units="mm-N-s",
        patch="hertz:18",
    )
    result = fecm.run_one(deck)
    (tmp_path / "d.inp").write_text(deck.to_text())
    write(tmp_path / "f.csv", result.time, result.force)
    done = call("identify", "d.inp", "f.csv", "--free", "k,mass,velocity", cwd=tmp_path)
    assert done.exit_code == 1
    assert done.stdout == ""
    for name in ("k", "mass", "velocity"):
        assert name in done.stderr
    assert "fecm: error: the " in done.stderr
    fit = fecm.identify(deck, result.time, result.force, ["k", "velocity"])
    assert fit.values == pytest.approx({"k": 1.2e5, "velocity": 100.0})


def test_one_unloading_gives_one_permanent_indentation_and_not_its_line() -> None:
    deck = plate(12, 4e-7, **TRUE)
    result = fecm.run_one(deck)
    with pytest.raises(IdentifyError, match="only a combination of s_p and alpha_p"):
        fecm.identify(deck, result.time, result.force, ["s_p", "alpha_p"])


def test_a_standard_error_above_the_value_is_refused() -> None:
    noise = 4.0 * measured().max() * np.random.default_rng(3).normal(size=len(TIME))
    with pytest.raises(IdentifyError, match=r"does not determine alpha_p \(.*\d+ %\)"):
        fecm.identify(started(), TIME, measured() + noise, "alpha_p")


# The sensor --------------------------------------------------------------------------------------


def test_the_filter_and_the_delay_of_the_measurement_are_part_of_the_fit() -> None:
    clock = 1e-7 * np.arange(-800.0, 1601.0)
    force = np.interp(clock, np.append(0.0, TIME), np.append(0.0, measured()))
    seen = filter_of("first-order:2e-5")(clock, force)
    free = ["k", "velocity", "delay"]
    deck = plate(12, 4e-7, **{**TRUE, "k": 1e5, "velocity": 2700.0})
    fit = fecm.identify(deck, clock + 3e-5, seen, free, filter="first-order:2e-5")
    assert fit.values["velocity"] == pytest.approx(3000.0, rel=5e-3)
    assert fit.values["k"] == pytest.approx(1.2e5, rel=1e-2)
    assert fit.values["delay"] == pytest.approx(3e-5, abs=3e-7)
    assert fit.share < 2e-3
    above, below = force_fit_picture(fit, {}).figure.axes
    lines = (*above.lines, below.lines[0])
    for line, values in zip(lines, (fit.force, fit.model, fit.residual), strict=True):
        np.testing.assert_array_equal(np.asarray(line.get_ydata(), dtype=float), values)


# The command -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A deck, and the force of its run at 100 in/s instead of 115."""
    folder = tmp_path_factory.mktemp("identify")
    deck = small(STEPS).replace("COOR", UNITS + "COOR", 1)
    (folder / "d.inp").write_text(deck)
    result = fecm.run_one(fecm.read_one(deck).with_(velocity=100.0), force=True)
    write(folder / "f.csv", result.time, result.force)
    return folder


def write(path: Path, time: Floats, force: Floats, head: str = "time,force") -> None:
    np.savetxt(path, np.array([time, force]).T, delimiter=",", header=head, comments="")


def identify(folder: Path, *options: object, table: str = "f.csv") -> Done:
    return call("identify", "d.inp", table, "--free", "velocity", *options, cwd=folder)


def test_the_command_prints_values_errors_correlations_and_cards(folder: Path) -> None:
    done = call(
        "identify",
        "d.inp",
        "f.csv",
        "--free",
        "velocity,k",
        "-o",
        "fitted.inp",
        "--plot",
        "fit.png",
        cwd=folder,
    )
    assert done.exit_code == 0
    for text in (
        r"velocity +100 in/s +\S+ in/s +115 in/s",
        "correlation",
        r"converged +yes",
        "ROD",
    ):
        assert re.search(text, done.stdout)
    fitted = fecm.read_one(folder / "fitted.inp")
    assert fitted.require(fecm.deck.model.Impact).velocity == pytest.approx(100.0, rel=1e-4)
    assert (folder / "fit.png").read_bytes().startswith(b"\x89PNG")
    plain = json.loads(identify(folder, "--format", "json").stdout)
    assert plain["values"]["velocity"]["value"] == pytest.approx(100.0, rel=1e-4)
    assert plain["correlation"] == [[1.0]]
    assert plain["converged"] is True
    assert plain["dof"] == plain["points"] - 1
    assert plain["record"] == record_of(folder / "f.csv")
    assert plain["record"]["sha256"] in done.stdout


def test_what_is_wrong_with_a_table_is_said_with_its_likely_cause(folder: Path) -> None:
    time, force = np.loadtxt(folder / "f.csv", delimiter=",", skiprows=1, unpack=True)
    wrong = {
        "time and force swapped": ((force, time), "time,force", "are time and force swapped?"),
        "time in ms": ((1e3 * time, force), "time,force", "the column seems to be in ms"),
        "force in mN": ((time, 4448.2 * force), "time,force", "the column seems to be in mN"),
        "force in kip": ((time, 1e-3 * force), "time,force", "seems to be in kip"),
        "an unknown unit": ((time, force), "time,force (volts)", "unknown unit of force"),
        "pulling": ((time, -force), "time,force", "positive in compression"),
        "short": ((time[::100], force[::100]), "time,force", "fewer than 3 points"),
        "late": ((time + 1.0, force), "time,force", "fit delay too"),
        "no numbers": ((time, np.where(force > 1, np.nan, force)), "time,force", "not a finite"),
        "transducer": ((time, force), "time,transducer", "column transducer and no force"),
    }
    for columns, head, text in wrong.values():
        write(folder / "wrong.csv", *columns, head=head)
        done = identify(folder, table="wrong.csv")
        assert (done.exit_code, done.stdout) == (2, "")
        assert done.stderr.splitlines()[-1].startswith("fecm: error: ")
        assert text in done.stderr.splitlines()[-1], done.stderr


def test_files_of_the_command_are_never_replaced(folder: Path) -> None:
    for file in ("d.inp", "f.csv"):
        assert_unusable(identify(folder, "-o", file, "--overwrite"))
    assert_unusable(call("identify", "d.inp", "f.csv", "--free", "layup", cwd=folder))


@pytest.mark.parametrize(("free", "told"), [
    ([], "can't fit none; fit different ones of velocity"), ("e1", "can't fit e1;"),
    (["k", "k"], "can't fit k, k"),
])  # fmt: skip
def test_names_that_cant_be_fitted_are_refused(free: list[str], told: str) -> None:
    with pytest.raises(StudyError, match=told):
        fecm.identify(started(), TIME, measured(), free)


def test_a_rigid_mass_has_no_length() -> None:
    with pytest.raises(StudyError, match="rod_length: the projectile of the deck is a rigid mass"):
        fecm.identify(started(), TIME, measured(), ["rod_length"])
