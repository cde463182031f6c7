"""Warnings about runs that leave the assumptions of their theory."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fecm
from fecm import Result
from fecm.listing.slips import Mode
from tests.calls import call
from tests.decks import APPENDIX, MESH, PROGRAM, ROOT, small

LONG = PROGRAM.replace("         10", "        100")
# w is held at all edges of the plate of 2 x 2 in; h is 0.106 in.
CORNERS = "   25    0    1    1    0    0    0\n"
EDGES = [*range(1, 6), *range(21, 26), 6, 10, 11, 15, 16, 20]
HELD = MESH.replace(CORNERS, CORNERS + "".join(f"{n}, 0, 1, 1, 1, 0, 0\n" for n in EDGES))
STATIC = (ROOT / "decks" / "static-bending.inp").read_text()
PULSE = (ROOT / "decks" / "pulse-load.inp").read_text()


def notes(folder: Path, text: str) -> tuple[list[str], Result]:
    """Warnings about a deck's assumptions, and its result."""
    (folder / "d.inp").write_text(text)
    done = call("run", "d.inp", "--overwrite", cwd=folder)
    assert done.exit_code == 0, done.stderr
    values = [line for line in done.stderr.splitlines() if re.search("beyond|exposure above", line)]
    return values, fecm.load(folder / "d.h5")


def numbers(line: str) -> list[float]:
    return [float(text) for text in re.findall(r"-?\d+\.?\d*(?:e[-+]\d+)?", line)]


def test_a_held_plate_is_warned_of_beyond_half_its_thickness(tmp_path: Path) -> None:
    impact = small(LONG, mesh=HELD)
    slow, result = notes(tmp_path, impact)
    largest = np.abs(result.plate_w).max()
    assert slow == []
    # The law of a fast impact is not that of a slow one, so that the factor is a little larger.
    fast, result = notes(tmp_path, impact.replace("115.0", f"{7.0 / largest:5.0f}"))
    step = int(np.abs(result.plate_w).argmax())
    assert abs(result.plate_w[step]) > 0.053
    (line,) = [line for line in fast if "deflection" in line]
    value, over_h, x, y, time = numbers(line)[:5]
    assert value == pytest.approx(abs(result.plate_w[step]), rel=1e-3)
    assert over_h == pytest.approx(value / 0.106, rel=1e-2)
    assert (x, y) == (1.0, 1.0)
    assert time == pytest.approx(result.time[step], rel=1e-5)


def test_the_flight_of_a_free_plate_is_no_deflection(tmp_path: Path) -> None:
    # Simpson's shares of a uniform pressure accelerate every node alike.
    share = np.array([1.0, 4.0, 2.0, 4.0, 1.0])
    loads = np.outer(share, share).ravel()
    cards = "".join(f"{n}, 0, 0., 0., {100.0 * load}\n" for n, load in enumerate(loads, start=1))
    text = small(LONG.replace("RODP          5", "EXCD"), data=f"FORC\n{cards}\n" + MATERIAL)
    actual, result = notes(tmp_path, text)
    assert np.abs(result.tape3.w).max() > 0.106
    assert actual == []


MATERIAL = """\
MATE
    3    3   -3      .106
  0.000148       0.3 17500000.  1150000.   800000.   800000.   800000.
    1   0.     0.053
    2  90.     0.053
"""


@pytest.mark.parametrize("load", [3.6e-4, 4.4e-4])
def test_the_strain_of_a_loaded_square_is_that_of_its_corners(tmp_path: Path, load: float) -> None:
    # Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, Table 8: a corner of a simply
    # supported square under q is held by 0.065 q a^2, twice the twisting moment.
    expected = 0.5 * 12.0 * 1.3 * (0.065 / 2.0) * load / 0.1**2
    before, _, after = STATIC.partition("FORC\n")
    cards, blank, rest = after.partition("\n\n")
    rows = [card.split(",") for card in cards.splitlines()]
    scaled = "\n".join(f"{','.join(row[:-1])}, {float(row[-1]) * load}" for row in rows)
    actual, _ = notes(tmp_path, f"{before}FORC\n{scaled}{blank}{rest}")
    lines = [line for line in actual if "strain" in line]
    assert len(lines) == (expected > 0.01)
    if lines:
        assert numbers(lines[0])[0] == pytest.approx(100.0 * expected, rel=0.02)
        assert numbers(lines[0])[1:3] == pytest.approx([0.5, 0.5], abs=0.05)


def test_strains_of_gages_are_judged(tmp_path: Path) -> None:
    text = PULSE.replace("MATE", "GAGE\n1, .3, .3, .05, 45.\n\nMATE")
    actual, result = notes(tmp_path, text.replace("DISP          4\n", ""))
    strain = np.abs(result.gages.strain[:, 0])
    (line,) = [line for line in actual if "strain" in line]
    value, x, y, time = numbers(line)[:4]
    assert value == pytest.approx(100.0 * strain.max(), rel=1e-3)
    assert (x, y) == (0.3, 0.3)
    assert time == pytest.approx(result.gages.time[strain.argmax()], rel=1e-5)


def test_an_indentation_beyond_a_quarter_of_the_thickness_is_told(tmp_path: Path) -> None:
    for k, expected in ((" 1912000.", False), ("     500.", True)):
        text = small(LONG.replace("100", "800")).replace(" 1912000.", k)
        actual, result = notes(tmp_path, text)
        step = int(result.indentation.argmax())
        assert (result.indentation[step] > 0.0265) == expected
        lines = [line for line in actual if "indentation" in line]
        assert len(lines) == expected
        for line in lines:
            assert numbers(line)[0] == pytest.approx(result.indentation[step], rel=1e-3)
            assert numbers(line)[4] == pytest.approx(result.time[step], rel=1e-5)


@pytest.mark.parametrize(("strength", "exceeded"), [("1e9", False), ("1e3", True)])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_an_exposure_above_1_is_told_once(tmp_path: Path, strength: str, exceeded: bool) -> None:
    allowables = ",".join([strength] * 5)
    program = LONG.replace("NEXT", "FAIL,,20\nNEXT")
    text = small(program).replace("EXPE", f"PATC\nDISC,.2\nALLO\n{allowables}\n\nEXPE")
    actual, _ = notes(tmp_path, text)
    lines = [line for line in actual if "exposure above 1" in line]
    assert len(lines) == exceeded
    assert all("elastically" in line for line in lines)


def test_a_run_in_python_warns_the_same_with_and_without_a_file(tmp_path: Path) -> None:
    text = small(LONG, mesh=HELD).replace("115.0", "50000")
    message, _ = notes(tmp_path, text)
    for output in (None, tmp_path / "p.h5"):
        with pytest.warns(fecm.FecmWarning) as caught:
            fecm.run_one(text, output=output)
        lines = [line for warning in caught for line in str(warning.message).splitlines()]
        texts = [f"fecm: note: {line}" for line in lines]
        assert [text for text in texts if "beyond" in text] == message


def test_an_estimate_warns_of_its_static_plate(tmp_path: Path) -> None:
    for velocity, warned in ((" 10.0", False), ("600.0", True)):
        text = small(mesh=HELD).replace("115.0", velocity).replace("EXPE", "PATC\nDISC,.2\nEXPE")
        (tmp_path / "d.inp").write_text(text)
        done = call("estimate", "d.inp", "--format", "json", cwd=tmp_path)
        document = json.loads(done.stdout)
        w = document["models"][1]["peak_force"] / document["stiffness"]
        assert (w > 0.3 * 0.106) == warned
        assert ("the static plate deflects by" in done.stderr) == warned


def test_the_reports_deck_is_within_the_assumptions(tmp_path: Path) -> None:
    assert notes(tmp_path, APPENDIX.read_text())[0] == []


@pytest.mark.parametrize(("energy", "is_heavy"), [(540.0, True), (4000.0, False)])
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_gravity_is_said_to_add_what_a_falling_mass_on_a_spring_shows(
    energy: float, *, is_heavy: bool
) -> None:
    mass = 5.5e-3
    deck = fecm.impact(
        fecm.Plate.rectangle((125, 75), (4, 4), support="simple"),
        fecm.Laminate("[0/90]4s", "E-glass/MY750", 0.125 if is_heavy else 0.25),
        fecm.RigidMass(mass),
        fecm.Contact(62000.0, 1.0, 0.0, 1.5),
        velocity=(2.0 * energy / mass) ** 0.5,
        duration=16e-3,
        units="mm-N-s",
        kinematics="linear",
    )
    result = fecm.run_one(deck)
    said = [note for note in result.notes if "gravity" in note]
    assert bool(said) == is_heavy
    unnamed = fecm.run_one(re.sub(r"(?m)^UNIT\n.*\n", "", deck.to_text()))
    assert not unnamed.units
    assert not [note for note in unnamed.notes if "gravity" in note]
    if not is_heavy:
        return
    # The spring that the run compresses, and the mass in free fall until it turns.
    way = (result.plate_w + result.indentation)[result.force > 0.0].max()
    spring = 2.0 * energy / way**2
    forces = []
    for gravity in (0.0, 9806.65):
        fall = solve_ivp(
            lambda _, y, g=gravity: [y[1], g - spring * y[0] / mass],
            (0.0, 16e-3),
            [0.0, (2.0 * energy / mass) ** 0.5],
            max_step=1e-4,
        )
        forces.append(spring * fall.y[0].max())
    share, rise = (float(text) for text in re.findall(r"([\d.]+)%", said[0]))
    assert share == pytest.approx(100.0 * mass * 9806.65 * way / energy, abs=0.06)
    assert rise == pytest.approx(100.0 * (forces[1] / forces[0] - 1.0), abs=0.6)


@pytest.mark.parametrize(
    ("k", "mode", "noted"), [(1e8, "report", False), (5e8, "report", True), (5e8, "listing", False)]
)
def test_contacts_that_do_not_converge_are_counted_in_a_note_unless_slips_excuse_them(
    k: float, mode: Mode, noted: bool
) -> None:
    result = fecm.run_one(fecm.read_one(small()).with_(k=k), mode=mode)
    count = result.attributes_of("history")["unsettled_steps"]
    assert (count > 0) is (k > 1e8)
    notes = [note for note in result.attributes["notes"] if "did not converge" in note]
    assert [f"in {count} steps" in note for note in notes] == [True] * noted
