"""Sweeps by the compiled kernels give what NumPy gives, and no case depends on the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import RigidMass, SweepResult
from fecm._typing import Floats
from fecm.authoring.case import Case
from fecm.judge.end import Deflection
from fecm.mechanics import kernels
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent
from fecm.problem.build import RunOptions, build_model
from fecm.problem.loading import load_deck
from fecm.sweeps import backends, methods, responses
from fecm.sweeps.responses import plate_response
from tests.decks import PROGRAM, small
from tests.test_kernels import compiled

DECK = Path("decks/impact-115.inp").read_text().replace("LOOP       4000", "LOOP        600")
RIGID = DECK.replace("EXPE", "PROJ\n    0    0  0.000181\n\nEXPE")
GAGE = "PATC\nDISC             0.2\n\nGAGE\n    1       2.5       2.0     0.053        0.\n\nEXPE"
LAW = "EXPE\n  1912000. 0.0006564     0.094       2.0"
COUNT = 16
FREE = PROGRAM.replace("LOOP         10", "LOOP        400")


def drawn(**ranges: tuple[float, float]) -> list[Case]:
    """Cases with random values; some powers of the law have no root."""
    rng = np.random.default_rng(7)
    values = {name: rng.uniform(*limits, COUNT).tolist() for name, limits in ranges.items()}
    if "q" in values:
        values["q"][:12] = [1.5, 2.0, 2.5, 2.0] * 3
    return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]


ANY = drawn(
    velocity=(20.0, 300.0),
    k=(1e6, 3e6),
    alpha_p=(0.0, 1e-3),
    s_p=(0.0, 0.2),
    q=(1.5, 2.5),
    mass=(1e-4, 4e-4),
)
FIRM = drawn(velocity=(20.0, 300.0), k=(1e6, 3e6), alpha_p=(1e-4, 1e-3))
RODS = drawn(velocity=(20.0, 300.0), rod_length=(0.5, 2.0), k=(1e6, 3e6))


def without_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "LIBRARY", None)
    monkeypatch.setattr(methods, "_plate", methods._plate.__wrapped__)  # keeps no plate for others


@compiled
@pytest.mark.parametrize(
    ("deck", "cases", "measured"),
    [(DECK, ANY, ()), (RIGID, ANY, ()), (DECK, RODS, ()),
     (DECK.replace("EXPE", GAGE), ANY, ("gages", "max_deflection")),
     (DECK.replace(LAW, "EXPE ACR\n  1912000. 0.0006564"), FIRM, ("max_deflection",))],
)  # fmt: skip
@pytest.mark.few(2)  # of 5, 0.8 s each
def test_cases_are_those_of_numpy(
    deck: str, cases: list[Case], measured: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def swept() -> SweepResult:
        return fecm.sweep(deck, cases=cases, history=True, measure=measured)

    actual = swept()
    without_kernels(monkeypatch)
    wanted = swept()
    assert actual.force is not None
    assert wanted.force is not None
    assert actual["status"].tolist() == wanted["status"].tolist()
    peaks = wanted.force.max(axis=1, keepdims=True)
    assert (peaks > 1.0).all()
    assert (np.abs(actual.force - wanted.force) <= 1e-10 * peaks).all()
    for name, values in wanted.summary.items():
        if values.dtype.kind == "f":
            atol = 1e-10 * np.nanmax(np.abs(values), initial=0.0)
            np.testing.assert_allclose(actual[name], values, rtol=0.0, atol=atol, err_msg=name)


@compiled
def test_a_case_has_the_same_bytes_with_any_others() -> None:
    whole = fecm.sweep(DECK, cases=ANY, history=True)
    assert whole.force is not None
    for some in ([3], [0, 7, 15], list(range(4, 14))):
        part = fecm.sweep(DECK, cases=[ANY[n] for n in some], history=True)
        np.testing.assert_array_equal(part.force, whole.force[some])
        for name, values in part.summary.items():
            np.testing.assert_array_equal(values, whole[name][some])


@compiled
def test_errors_of_the_energy_balance_are_those_of_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of cases that lose energy, some whose motion is not finite."""
    seen: list[responses.ComputedImpacts] = []

    def watched(*given: Any) -> responses.ComputedImpacts:
        seen.append(responses.impacts(*given))
        return seen[-1]

    monkeypatch.setattr(backends, "impacts", watched)
    cases: list[Case] = [{"k": k} for k in (2e6, 1e9, 1e10, 1e300)]
    deck = DECK.replace("        600", "        200")
    fecm.sweep(deck, cases=cases)
    without_kernels(monkeypatch)
    fecm.sweep(deck, cases=cases)
    actual, wanted = seen
    assert wanted.error[2] > 0.01
    np.testing.assert_array_equal(actual.unconverged_steps, wanted.unconverged_steps)
    finite = np.isfinite(wanted.error)
    assert finite.tolist() == [True, True, True, False]
    np.testing.assert_allclose(actual.error[finite], wanted.error[finite], rtol=1e-6, atol=1e-9)
    assert not actual.error[3] < 1.0
    for name, values in wanted.plate._asdict().items():
        computed, expected = (
            np.broadcast_to(column, finite.shape)[finite]
            for column in (getattr(actual.plate, name), values)
        )
        np.testing.assert_allclose(computed, expected, rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("solver", ["numpy", pytest.param("kernels", marks=compiled)])
def test_a_plate_that_nothing_holds_bends_as_its_motion_less_the_rigid_motion_does(
    solver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside sums over all earlier forces of the response without its rigid part."""
    seen: list[tuple[responses.ComputedImpacts, Floats, float, float, responses.Hits]] = []

    def watched(
        response: Floats, dt: float, mass: float, hits: responses.Hits, mobility: float
    ) -> responses.ComputedImpacts:
        built = responses.impacts(response, dt, mass, hits, mobility)
        seen.append((built, response, dt, mobility, hits))
        return built

    monkeypatch.setattr(backends, "impacts", watched)
    if solver == "numpy":
        without_kernels(monkeypatch)
    speeds = np.linspace(10.0, 300.0, 11)
    fecm.sweep(small(FREE), {"velocity": speeds.tolist()})
    ((actual, response, dt, mobility, hits),) = seen
    assert mobility == pytest.approx(1.0 / (0.000148 * 2.0 * 2.0 * 0.106), rel=1e-9)
    steps = len(response)
    bending = response - mobility * dt**2 * np.arange(1, steps + 1)
    before = np.vstack([np.zeros(len(speeds)), actual.force[:-1]])
    bent = np.stack([np.convolve(bending, force)[:steps] for force in before.T], axis=1)
    work = np.cumsum(0.5 * (before + actual.force) * np.diff(bent, axis=0, prepend=0.0), axis=0)
    times: Floats = np.linspace(dt, steps * dt, steps)
    energy = 0.5 * hits.rods[0].total_mass * speeds**2
    wanted = Deflection.of(bent, times, work, energy)
    np.testing.assert_allclose(actual.plate.speed, wanted.speed, rtol=1e-10)
    np.testing.assert_allclose(actual.plate.compliance, wanted.compliance, rtol=1e-10)
    np.testing.assert_allclose(actual.plate.energy, wanted.energy, rtol=1e-9)


@compiled
@pytest.mark.parametrize("steps", [1, 2, 150])
def test_the_response_of_a_plate_is_that_of_numpy(steps: int) -> None:
    (problem,) = load_deck(DECK.replace("EXPE", GAGE)).problems
    values = []
    for solver in ("kernels", "numpy"):
        model = build_model(problem, RunOptions(solver=solver))
        assert model.impact is not None
        assert model.gages is not None
        gages = model.motion.dof_sums(model.gages.dof_indices, model.gages.weights)
        load = model.impact.contact.load
        values.append(plate_response(model.motion, load, 2e-7, steps, gages))
    for one, other in zip(values[0], values[1], strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12 * np.abs(other).max())


@compiled
def test_a_law_that_the_kernels_do_not_know_is_numpys() -> None:
    class Other(LinearPermanent[Floats]):
        """The same law by another name."""

    one, kind = np.ones(3), np.zeros(3, dtype=np.intp)
    response = 1e-7 * np.arange(1.0, 301.0)
    forces = []
    for law in (LinearPermanent, Other):
        constants = law(2e6 * one, 1e-4 * one, 0.1 * one, 2.0 * one)
        speed = np.array([50.0, 100.0, 150.0])
        hits = responses.Hits([RigidMass(1.8e-4)], kind, one, HystereticLaw(constants), speed)
        forces.append(responses.impacts(response, 2e-7, 1e-6, hits).force)
    actual, wanted = forces
    assert not np.array_equal(actual, wanted)
    np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=1e-10 * wanted.max())
