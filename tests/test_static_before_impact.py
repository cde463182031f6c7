"""Impacts on a plate that a static load has deflected before: the unloaded plate's contact.

A linear plate in equilibrium under a constant load answers an impact as an unloaded one
(superposition). So the expected contact of a loaded plate is that of the deck without the load.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from tests.calls import call
from tests.decks import MESH, small
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_to

EDGE = (1, 2, 3, 4, 5, 6, 10, 11, 15, 16, 20, 21, 22, 23, 24, 25)
# The small plate of 2 x 2 in on simple supports. Its corners hold u and v too.
HELD = "".join(f"{n:5d}    0    1    1    1    0    0\n" for n in EDGE)
FREE = "".join(
    f"{n:5d}    0    {int(n in (1, 5, 21, 25))}    {int(n in (1, 5))}    1    0    0\n"
    for n in EDGE
)
STRUCK = "ROD\n   13    3     115.0\nEXPE\n  1912000. 0.0006564     0.094       2.0\n"
PLIES = """\
MATE
    3    3   -3      .106
  0.000148       0.3 17500000.  1150000.   800000.   800000.   800000.
    1   0.     0.053
    2  90.     0.053
SHEA MITC
"""
SYMMETRIC = PLIES.replace("    2  90.", "    2   0.")
PUSH = "FORC\n   13    0       0.0       0.0     200.0\n\n"
PULL = PUSH.replace(" 200.0", "-200.0")
ASIDE = (
    "FORC\n    7    0       0.0       0.0     100.0\n   18    0       0.0       0.0     -40.0\n\n"
)
SETTLED = (
    "FORC\n    1    0       0.0       0.0      .002\n   15    0       0.0       0.0     -.001\n\n"
)
MASS = "PROJ\n    0    0  0.000002\n"
DISC = "PATC\nDISC           0.1\n"
CURVED = "CURV\n      20.0\n"

STATIC = "TANG\nFORM\nSOLV\n"
STEPS = "LMAS\nDT        .5E-6\nLOOP        120\nTIME\nRODP         20\nDISP         20\nNEXT\n"
TAPE9 = ("force", "indentation", "transducer", "displacement", "velocity", "acceleration")


def mesh(supports: str) -> str:
    """The mesh of the small plate with other supports."""
    return MESH.split("BOUN")[0] + "BOUN\n" + supports + "\n"


def deck(data: str, program: str = STEPS, *, supports: str = HELD) -> str:
    """The deck of a struck plate."""
    return small(program, mesh=mesh(supports), data=STRUCK + data)


def run(text: str) -> fecm.Result:
    """Result by NumPy, without kernels."""
    return fecm.run_one(text, solver="numpy")


CASES = {
    "force": (PLIES, PUSH, HELD),
    "force from the other side": (PLIES, PULL, HELD),
    "forces beside the impact": (PLIES, ASIDE, HELD),
    "a support that settles": (PLIES, SETTLED, HELD),
    "an unsymmetric laminate, free in its plane": (PLIES, PUSH, FREE),
    "a rigid mass": (PLIES + MASS, PUSH, HELD),
    "a patch": (PLIES + DISC, PUSH, HELD),
    "the load of the patch": (PLIES + DISC, "patch", HELD),
    "a curved panel": (PLIES + CURVED, PUSH, FREE),
    "a preload by PREL": (SYMMETRIC + "PREL\n     300.0     -50.0\n", PUSH, HELD),
    "residual stresses": (PLIES + "CURE\n-100.\n,.3E-6,30.E-6\n\n", PUSH, HELD),
    "damping": (PLIES + "DAMP\n     500.0\n", PUSH, HELD),
}


@pytest.mark.parametrize("name", CASES)
def test_the_contact_of_a_plate_in_equilibrium_is_that_of_the_unloaded_plate(name: str) -> None:
    data, load, supports = CASES[name]
    text = data.replace("0.1\n", f"0.1{'':20s}{150.0:10.1f}\n") if load == "patch" else data + load
    loaded = run(deck(text, STATIC + STEPS, supports=supports))
    unloaded = run(deck(data, supports=supports))
    for column in TAPE9:
        actual, expected = loaded[f"history/{column}"], unloaded[f"history/{column}"]
        assert np.abs(actual - expected).max() < 1e-9 * np.abs(expected).max(), column
    start = loaded.history.attributes["start_w"]
    assert abs(start) > 1e-3 * unloaded.plate_w.max()
    np.testing.assert_allclose(loaded.plate_w - start, unloaded.plate_w, atol=1e-12)
    moved = loaded.indentation + loaded.displacement + loaded.plate_w
    np.testing.assert_allclose(moved, start, atol=1e-14)
    assert {**loaded.metrics, "max_deflection": 0.0} == pytest.approx(
        {**unloaded.metrics, "max_deflection": 0.0}, rel=1e-8, nan_ok=True
    )
    assert (loaded.end, loaded.validity) == (unloaded.end, unloaded.validity)


def test_the_energy_of_the_static_load_is_no_impact_energy(tmp_path: Path) -> None:
    path = tmp_path / "loaded.inp"
    path.write_text(deck(PLIES + PUSH.replace(" 200.0", "2000.0"), STATIC + STEPS))
    done = call("run", str(path), "-o", str(tmp_path / "loaded.h5"))
    assert done.exit_code == 0
    loaded, unloaded = fecm.load(tmp_path / "loaded.h5"), run(deck(PLIES))
    energy, w = loaded.energy.attributes, loaded.history.attributes["start_w"]
    # Half the force times the deflection under it, which is far more than the impact's energy.
    assert energy["initial_plate"] == pytest.approx(0.5 * 2000.0 * w, rel=1e-9)
    of_impact = unloaded.energy.attributes["initial"]
    assert energy["initial"] - energy["initial_plate"] == pytest.approx(of_impact, rel=1e-9)
    assert energy["initial_plate"] > 10.0 * of_impact
    before, of_projectile = (
        next(line for line in done.stdout.splitlines() if line.startswith(f"  {name}"))
        for name in ("before impact", "energy ")
    )
    assert "which is not impact energy" in before
    assert of_projectile in str(unloaded)
    assert "energy balance is off" not in done.stderr


PASSES = "LOOP          3\nTANG\nFORM\nSOLV\nCONV\nNEXT\n"


def test_static_solutions_in_loops_end_in_the_same_start() -> None:
    one, several = (run(deck(PLIES + PUSH, p + STEPS)) for p in (STATIC, PASSES + PASSES))
    peak = one.force.max()
    np.testing.assert_allclose(several.force, one.force, atol=1e-9 * peak)


NEWTON = "LOOP         20\nTANG\nFORM\nSOLV\nCONV\nNEXT\n"
LOOSE = "".join(f"{n:5d}    0    0    0    1    0    0\n" for n in EDGE)
PULLED = "".join(f"{n},0,{300.0 if n % 5 == 0 else -300.0}\n" for n in EDGE if n % 5 in (0, 1))


@pytest.mark.parametrize("layers", [(0, 90), (90, 0)])
def test_a_projectile_starts_on_an_unsymmetric_laminate_that_a_pull_has_bent(
    layers: tuple[int, int],
) -> None:
    top, bottom = layers
    plies = PLIES.replace("1   0.", f"1 {top:3d}.").replace("2  90.", f"2 {bottom:3d}.")
    data = f"{plies}NONL\nFORC\n{PULLED}\n"
    bent = run(deck(data, NEWTON + STEPS, supports=LOOSE))
    start, energy = bent.history.attributes["start_w"], bent.energy.attributes
    # The stiffer layer is farther from the line of the pull's middle: the plate bends to its side.
    assert start * (bottom - top) > 90.0 * 0.05 * 0.106
    assert bent.history.attributes["rest_w"] == start
    assert bent.indentation[0] == pytest.approx(115.0 * 0.5e-6, rel=1e-3)
    # A gap of the deflection would be 100 steps long.
    assert bent.force[0] > 0.0
    flat = run(deck(plies + "NONL\n", supports=LOOSE))
    assert bent.force.max() == pytest.approx(flat.force.max(), rel=0.02)
    assert np.abs(bent.energy.balance_error).max() < 1.05 * np.abs(flat.energy.balance_error).max()
    impact = energy["initial"] - energy["initial_plate"]
    assert impact == pytest.approx(flat.energy.attributes["initial"], rel=1e-12)


def test_a_load_that_does_not_hold_the_plate_during_the_impact_is_noted() -> None:
    # FORC's factor is 1 up to the time 1e-7 and 0 later, when the loop has begun.
    program = f"PROP          1\n{STATIC}{STEPS}"
    table = "    0    0       0.0    1.0E-7       1.0\n"
    text = deck(PLIES + PUSH, program).replace("END\nSTOP", f"END\n{table}STOP")
    with pytest.warns(fecm.FecmWarning, match="do not hold the plate there during the impact"):
        released = fecm.run_one(text)
    attributes = released.history.attributes
    assert attributes["start_w"] > 0.0
    assert "rest_w" not in attributes
    # The projectile starts on the plate, which springs back towards it.
    springs = attributes["start_w"] - released.plate_w[0]
    assert springs > 0.0
    assert released.indentation[0] == pytest.approx(115.0 * 0.5e-6 + springs, rel=1e-3)
    assert released.force.max() > 1.1 * run(deck(PLIES)).force.max()


@pytest.mark.parametrize("stop", [1, 2, 50])
def test_a_resumed_impact_keeps_its_start(stop: int, tmp_path: Path) -> None:
    text = deck(PLIES + PUSH, STATIC + STEPS)
    whole, path = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    run_to(text, whole)
    with pytest.raises(StoppedError):
        run_to(text, path, stop)
    run_to(text, path, resume=True)
    assert path.read_bytes() == whole.read_bytes()


def test_cases_of_a_loaded_plate_are_runs_of_it() -> None:
    speeds = {"velocity": [60.0, 115.0]}
    loaded = fecm.read_one(deck(PLIES + MASS + PUSH, STATIC + STEPS))
    swept, one = fecm.sweep(loaded, speeds), fecm.run_one(loaded)
    unloaded = fecm.sweep(deck(PLIES + MASS), speeds)  # by the response of the plate
    assert swept["peak_force"][1] == one.metrics["peak_force"]
    for name in ("peak_force", "contact_time", "rebound_velocity", "contact_loop"):
        np.testing.assert_allclose(swept[name], unloaded[name], rtol=1e-8)
    assert swept["validity"].tolist() == unloaded["validity"].tolist()


def test_the_contact_law_of_the_slip_target_sees_no_static_deflection() -> None:
    text = deck(PLIES + PUSH, STATIC + STEPS)
    listing = fecm.run_one(text, slips=["target"])
    assert "start_w" not in listing.history.attributes
    assert not listing.plate_w.any()
    np.testing.assert_array_equal(listing.indentation, -listing.displacement)


def test_a_projectile_starts_on_a_plate_that_steps_without_it_have_moved() -> None:
    before = "LMAS\nDT        .5E-6\nLOOP        100\nTIME\nEXCD\nNEXT\n"
    with pytest.warns(fecm.FecmWarning):
        moved = fecm.run_one(deck(PLIES + PUSH, before + STEPS))
    start = moved.history.attributes["start_w"]
    assert start == moved.plate_w[99] == moved.plate_w[:100].max()
    assert not moved.force[:100].any()
    approach = 115.0 * 0.5e-6 - (moved.plate_w[100] - start)
    assert moved.indentation[100] == pytest.approx(approach, rel=1e-2)


@pytest.mark.parametrize(
    ("program", "doubted"),
    [
        (STATIC + STEPS, False),
        (STEPS + STATIC, False),
        (PASSES + STEPS + PASSES, False),
        (STEPS + STATIC + "RODP         20\n", True),
        ("TANG\n" + STEPS.replace("TIME", "FORM\nSOLV\nTIME"), True),
        ("TANG\n" + STEPS.replace("NEXT", "FORM\nSOLV\nNEXT").replace("120", "  1"), False),
    ],
)
def test_a_static_solution_between_impact_steps_is_doubted(program: str, doubted: bool) -> None:
    codes = [finding.code for finding in fecm.check(deck(PLIES + PUSH, program)).findings]
    assert ("W563" in codes) == doubted
