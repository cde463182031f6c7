"""The methods that compute the cases of sweeps: which one, and that it alone answers for itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.case import Case
from fecm.deck.model import Indentation
from fecm.deck.reader import ParsedProblem
from fecm.problem import loading
from fecm.problem.check import check_problem
from fecm.problem.problem import Problem
from fecm.sweeps import methods
from fecm.sweeps.methods import METHODS
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.task import Method, Plan, Settings, Task, tasks
from tests.decks import DATA_CARDS, small
from tests.test_failure_values import weak
from tests.test_nonlinear_sweeps import DECK
from tests.test_sweep import STEPS

LOADED = small(STEPS, data="FORC\n    8    0       0.0       0.0       1.0\n\n" + DATA_CARDS)
TWO_STEPS = small(
    STEPS.replace("NEXT\n", "NEXT\nDT,,2.5E-7\nLOOP         20\nRODP          1\nNEXT\n")
)


def first_force(result: fecm.Result) -> dict[str, float]:
    return {"first_force": float(result.force[0])}


@pytest.mark.parametrize(
    ("deck", "given", "name"),
    [
        (small(STEPS), {}, "SharedResponse"),
        (small(STEPS), {"until": 20.0}, "SharedResponse"),
        (small(STEPS), {"measure": first_force}, "SeparateRuns"),
        (LOADED, {}, "SeparateRuns"),
        (TWO_STEPS, {}, "SeparateRuns"),
        (weak(), {"measure": "failure"}, "SharedMotion"),
        (weak(), {"until": {"exposure": 1.0}}, "SeparateRuns"),
        (DECK, {}, "SharedMotion"),
        (DECK, {"until": 50.0}, "ReducedOrFullRuns"),
        (DECK, {"model": "reduced"}, "ReducedRuns"),
        (DECK, {"model": "full", "until": 50.0}, "SeparateRuns"),
    ],
)
def test_deck_and_options_decide_the_method_of_a_sweep(
    deck: Any, given: dict[str, Any], name: str
) -> None:
    job = fecm.Sweep(deck, {"k": [1e6, 2e6]}, **given)
    assert type(job.plan.method).__name__ == name


class _Constant(Method):
    """A method whose cases all have a step of the plate, and fail with a word of its own."""

    def applies(self, checked: Problem, settings: Settings, cases: Sequence[Case]) -> bool:
        return True

    def refusal(self, checked: Problem, definition: Plan) -> str:
        return "seven is too many" if len(definition.cases) == 7 else ""

    def most_cases(self, definition: Plan) -> int:
        return 2

    def separates(self, name: str) -> bool:
        return False

    def outcomes(self, task: Task) -> list[Outcome]:
        return [Outcome.failed(dict.fromkeys(task.numbers, f"task {task.number}"))]

    def work(self, checked: Problem, definition: Plan) -> tuple[int, float]:
        return 17, 3.0

    def expectation(self, checked: Problem, definition: Plan, workers: int | None) -> list[str]:
        return ["a constant"]

    def process_bytes(self, checked: Problem, settings: Settings, *, exact: bool) -> int:
        return 1000

    def most_forces(self, definition: Plan, steps: int) -> int:
        return 0


@pytest.mark.parametrize("deck", [small(STEPS), LOADED, DECK])
def test_a_new_method_is_one_object_and_one_row(deck: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "METHODS", (_Constant(), *METHODS))
    job = fecm.Sweep(deck, {"thickness": [0.1, 0.2, 0.3], "velocity": [50.0]}, workers=1)
    assert (job.price.steps, job.price.memory_bytes, job.price.seconds) == (17, 1000, 3.0)
    assert job.expectation() == ["a constant"]
    with pytest.warns(fecm.FecmWarning, match="3 cases failed"):
        result = job.execute()
    assert result["status"].tolist() == ["task 0", "task 0", "task 1"]
    with pytest.raises(fecm.errors.CasesError, match="seven is too many"):
        fecm.Sweep(deck, {"velocity": [float(n) for n in range(1, 8)]})


def test_cases_whose_time_step_replaces_several_share_the_response_of_their_plate() -> None:
    values = {"dt": [2.5e-7], "velocity": [50.0, 100.0]}
    job = fecm.Sweep(TWO_STEPS, values, history=True)
    full = [
        fecm.run_one(fecm.read_one(TWO_STEPS).with_(dt=2.5e-7, velocity=v)) for v in (50.0, 100.0)
    ]
    assert [task.numbers for task in tasks(job.plan)] == [(0, 1)]
    swept = job.execute()
    assert swept.force is not None
    for row, result in enumerate(full):
        np.testing.assert_allclose(
            swept.force[row], result.force, rtol=0, atol=1e-9 * result.force.max()
        )


def test_a_deck_that_is_swept_again_is_not_checked_again_unless_it_changed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    checked: list[float] = []

    def counted(problem: ParsedProblem, *others: Any, **named: Any) -> Problem | None:
        assert problem.deck is not None
        checked.append(problem.deck.require(Indentation).k)
        return check_problem(problem, *others, **named)

    monkeypatch.setattr(loading, "check_problem", counted)
    path = tmp_path / "deck.inp"
    path.write_text(small(STEPS).replace("1912000", "1700000"), encoding="utf-8")
    first, second = (fecm.sweep(path, {"velocity": [velocity]}) for velocity in (50.0, 60.0))
    assert checked == [1.7e6]
    path.write_text(small(STEPS).replace("1912000", "1600000"), encoding="utf-8")
    softer = fecm.sweep(path, {"velocity": [60.0]})
    assert checked == [1.7e6, 1.6e6]
    assert first["peak_force"] < second["peak_force"] != softer["peak_force"]
