"""Mass-proportional damping of the plate: DAMP."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

import fecm
from fecm import Result
from fecm.deck.model import Damping
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import PlateMotion
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_plate
from tests.builders import Floats, table
from tests.calls import call
from tests.decks import DATA_CARDS, MESH, PROGRAM, ROOT, small
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_stopped

MODES = (ROOT / "decks" / "natural-frequencies.inp").read_text()
NODE = 41  # in the middle
STEPS = small(PROGRAM.replace("         10", "        100"))

# The first frequency of the deck's plate, h/a = 0.1, by Mindlin's theory.
OMEGA = float(
    next(r for r in table("freq_ssss_mindlin.csv") if "h/a=0.1 ks=1.0" in r["case"])[
        "omega_flex_rad/s_or_nondim"
    ]
) * float(np.sqrt(0.1**2 / (12.0 * (1.0 - 0.3**2))))


def run(deck: str) -> Result:
    return fecm.run_one(deck)


def damped(deck: str, card: str) -> str:
    return deck.replace("EXPE", f"DAMP\n{card}\nEXPE")


def released(a: float, dt: float, steps: int) -> str:
    """A simply supported square plate, bent to its first mode by loads that then vanish."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9))
    shape = 1e-3 * np.sin(np.pi * x) * np.sin(np.pi * y)
    # Simpson's shares of a pressure on 9-node elements.
    share = np.array([1.0, 4.0, 2.0, 4.0, 2.0, 4.0, 2.0, 4.0, 1.0])
    loads = (shape * np.outer(share, share)).ravel()
    cards = "".join(f"{n}, 0, 0, 0, {f:.12e}\n" for n, f in enumerate(loads, start=1))
    program = (
        f"MACR\nTANG\nFORM\nSOLV\nDISP\nPROP,,1\nLMAS\nDT,,{dt!r}\nLOOP,,{steps}\nTIME\nEXCD\n"
        "DISP\nNEXT\nEND\n1, 1, 0., 1e9, 0., 0., 0., 0., 0.\nSTOP\n"
    )
    head = MODES[: MODES.index("END\nMACR")]
    return f"{head}FORC\n{cards}\nDAMP\n{a!r},\nEND\n{program}"


def free_decay(t: float | Floats, omega: float | Floats, a: float) -> Floats:
    """u/u_0 of u'' + a u' + omega^2 u = 0 from rest."""
    w_d = np.sqrt(np.asarray(omega, dtype=complex) ** 2 - a**2 / 4.0)
    wave = np.cos(w_d * t) + a / (2.0 * w_d) * np.sin(w_d * t)
    return np.asarray(np.exp(-a * np.asarray(t) / 2.0) * wave.real)


@pytest.mark.parametrize("ratio", [0.02, 0.3, 1.2])
def test_a_released_plate_decays_as_its_first_mode(ratio: float) -> None:
    a = 2.0 * ratio * OMEGA
    result = run(released(a, 0.05, 500))
    t, w = result.tape3.time, result.tape3.w[:, NODE - 1]
    np.testing.assert_allclose(w / w[0], free_decay(t, OMEGA, a), atol=2e-3)


def model() -> tuple[PlateModel, Floats, Floats]:
    """The plate of the deck, its frequencies and modes."""
    problem = load_deck(MODES).problems[0]
    plate = build_plate(problem.deck, problem.mesh)
    squares, shapes = eigh(plate.stiffness.toarray(), np.diag(plate.mass))
    return plate, np.sqrt(squares), shapes


def test_the_decay_of_six_modes_is_met_with_the_square_of_the_step() -> None:
    plate, omega, shapes = model()
    a, end = 0.4, 8.0
    start, exact = shapes[:, :6].sum(axis=1), shapes[:, :6] @ free_decay(end, omega[:6], a)
    errors = []
    for steps in (160, 320, 640):
        motion = PlateMotion(plate, damping=a)
        state = motion.start()
        motion.displace(state, start)
        for _ in range(steps):
            motion.central_difference(state, end / steps, 1.0)
        errors.append(np.abs(state.displacement - exact).max() / np.abs(start).max())
    assert errors[2] < 2e-3
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.05)
    assert errors[2] == pytest.approx(errors[1] / 4.0, rel=0.05)


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_the_critical_time_step_is_that_without_damping(factor: float) -> None:
    plate, omega, shapes = model()
    dt = factor * 2.0 / omega[-1]
    motion = PlateMotion(plate, damping=0.1 / dt)
    state = motion.start()
    motion.displace(state, shapes.sum(axis=1))
    first = np.abs(state.displacement).max()
    for _ in range(400):
        motion.advance(state, dt, 1.0)
    growth = np.abs(state.displacement).max() / first
    assert growth < 1.0 if factor < 1.0 else growth > 1e3


def test_what_damping_dissipates_is_what_the_plate_loses() -> None:
    a = 0.1
    plain, actual = run(released(0.0, 0.02, 600)), run(released(a, 0.02, 600))
    initial = actual.energy.attributes["initial"]
    for result in (plain, actual):
        assert np.abs(result.energy.balance_error).max() < 2e-4 * initial
    # Of a mode: E(t)/E(0) from u and u' of the closed form.
    t, w_d = actual.energy.time, np.sqrt(OMEGA**2 - a**2 / 4.0)
    speed = np.exp(-a * t / 2.0) * OMEGA**2 / w_d * np.sin(w_d * t)
    left = free_decay(t, OMEGA, a) ** 2 + (speed / OMEGA) ** 2
    np.testing.assert_allclose(actual.energy.damping_work / initial, 1.0 - left, atol=0.01)
    assert (np.diff(actual.energy.damping_work) >= 0.0).all()


def test_a_damped_impact_keeps_its_energy_balance() -> None:
    plain, actual = run(STEPS), run(damped(STEPS, "2e4,"))
    initial = plain.energy.attributes["initial"]
    assert actual.energy.damping_work[-1] > 1e-2 * initial
    errors = [np.abs(result.energy.balance_error).max() for result in (plain, actual)]
    assert errors[1] < 1.5 * errors[0]


def test_no_damping_gives_the_datasets_of_a_deck_without_the_card() -> None:
    plain, zero = run(STEPS), run(damped(STEPS, "0.,"))
    assert list(plain) == list(zero)
    for path in plain:
        assert plain[path].tobytes() == zero[path].tobytes(), path


def test_the_impulse_response_of_a_sweep_is_damped() -> None:
    deck = damped(STEPS, "2e4,")
    swept = fecm.sweep(deck, {"velocity": [115.0]}, history=True)
    assert swept.force is not None
    full = run(deck).force
    np.testing.assert_allclose(swept.force[0], full, atol=1e-9 * full.max())
    assert np.abs(full - run(STEPS).force).max() > 1e-3 * full.max()


def test_a_stopped_damped_run_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    text = damped(STEPS.replace("LOOP        100", "LOOP       1100"), "2e4,")
    run_stopped(text, tmp_path / "whole.h5")
    with pytest.raises(StoppedError):
        run_stopped(text, tmp_path / "stopped.h5", 1060)  # after the first block of rows
    run_stopped(text, tmp_path / "stopped.h5", resume=True)
    assert (tmp_path / "stopped.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()


@pytest.mark.parametrize(
    ("card", "code"), [("-1.,", "E459"), ("1.,nan", "E"), ("1e400,", "E107"), ("1e7,", "W460")]
)
def test_damping_is_checked(card: str, code: str) -> None:
    codes = [finding.code for finding in load_deck(damped(STEPS, card)).findings]
    assert any(actual.startswith(code) for actual in codes)


def test_the_printed_program_has_no_damping() -> None:
    codes = [finding.code for finding in load_deck(damped(STEPS, "1.,"), "listing").findings]
    assert "E603" in codes


def test_the_card_survives_being_written_and_formatted(tmp_path: Path) -> None:
    deck = load_deck(damped(STEPS, "0.125,")).problems[0].deck
    again = load_deck(deck.to_text()).problems[0].deck
    assert again == deck
    assert again.require(Damping).coefficient == 0.125
    (tmp_path / "d.inp").write_text(damped(STEPS, "0.125,"))
    assert call("fmt", "d.inp", cwd=tmp_path).exit_code == 0
    assert load_deck(tmp_path / "d.inp").problems[0].deck == deck


def test_the_quick_models_are_said_to_neglect_damping(tmp_path: Path) -> None:
    text = small(mesh=MESH, data=DATA_CARDS)
    for name, deck in (("plain", text), ("damped", damped(text, "1.,"))):
        (tmp_path / f"{name}.inp").write_text(deck)
        said = call("estimate", f"{name}.inp", cwd=tmp_path).stdout
        assert ("neglect DAMP" in said) == (name == "damped")
