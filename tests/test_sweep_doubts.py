"""Swept values in another unit, and the names of thicknesses."""

from __future__ import annotations

import re
import warnings
from functools import cache

import numpy as np
import pytest

import fecm
from fecm.authoring.case import Case
from fecm.authoring.values import apply_case
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.sweeps.checks import JUDGED, doubtful_values
from tests.sound_plate import base, replaced, with_card


def sweep_notes(**vary: list[float]) -> list[str]:
    """Warnings of a sweep of the sound plate over a short time."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fecm.sweep(short(), vary)
    return [str(warning.message) for warning in caught]


@cache
def short() -> fecm.Deck:
    """The sound plate for 20 steps."""
    return fecm.read_one(replaced(r"^FAIL .*\n", "")(replaced(r"^LOOP .*", "LOOP,,20")(base())))


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [("velocity", [1.0, 3.0, 5.0], "velocity = 1: .*looks like m/s"),
     ("mass", [5.5], "mass = 5.5: .*looks like kg"),
     ("e1", [1.7e11], "e1 = 1.7e.11: .*looks like Pa"),
     ("thickness", [3.0], "ply_thickness is the thickness of a ply"),
     ("laminate_thickness", [0.15, 0.2], "laminate_thickness = 0.15 is less than two plies")],
)  # fmt: skip
@pytest.mark.few(1)  # of 5, 0.2 s each
def test_a_swept_value_in_another_unit_is_told_once(
    name: str, values: list[float], text: str
) -> None:
    listed = [note for note in sweep_notes(**{name: values}) if re.search(text, note)]
    assert len(listed) == 1


@pytest.mark.parametrize(
    ("name", "values"),
    [("velocity", [1000.0, 5000.0]), ("mass", [1e-3, 6e-3]), ("laminate_thickness", [2.0, 4.0]),
     ("ply_thickness", [0.15, 0.2]), ("k", [2e4, 1e5]), ("radius", [5.0, 25.0])],
)  # fmt: skip
@pytest.mark.few(1)  # of 6, 0.2 s each
def test_sound_swept_values_are_not_remarked(name: str, values: list[float]) -> None:
    assert not [note for note in sweep_notes(**{name: values}) if f"{name} =" in note]


@pytest.mark.parametrize(
    ("name", "inside", "outside"),
    [("at", "(15,12)", "(20,2)"), ("impact_node", 0, 1), ("y0", 12.0, 2.0)],
)
def test_an_impact_beside_the_window_of_a_fixture_is_named_once(
    name: str, inside: float | str, outside: float | str
) -> None:
    plate = fecm.Plate.on_fixture("window:40x30,20x20", (4, 4))
    (problem,) = load_deck(window_deck(plate).to_text()).problems
    if name == "impact_node":
        inside, outside = (
            int(np.hypot(*(problem.mesh.coordinates - place).T).argmin()) + 1
            for place in ((15.0, 15.0), (0.0, 0.0))
        )
    assert doubtful_values(problem, [{name: inside}]) == []
    (note,) = doubtful_values(problem, [{name: inside}, {name: outside}, {name: outside}])
    place = "(0, 0)" if name == "impact_node" else "(20, 2)"
    assert note.startswith(f"2 cases hit the free rim outside the supports, the first at {place}")


def window_deck(plate: fecm.Plate) -> fecm.Deck:
    """Deck of a small impact on a window."""
    return fecm.impact(
        plate,
        fecm.Laminate("[0/90]s", "IM7/8552"),
        fecm.RigidMass(1e-5),
        fecm.Contact(1000.0),
        velocity=1000.0,
        duration=1e-7,
        dt=1e-8,
        units="mm-N-s",
    )


@cache
def damped() -> Problem:
    """The sound plate with damping."""
    (problem,) = load_deck(with_card("DAMP", "50.,")(base())).problems
    return problem


@pytest.mark.parametrize("name", sorted(JUDGED))
@pytest.mark.parametrize("value", [0.0, -1.0, 1.7e308, 5e-324])
@pytest.mark.few(30)  # of 148, 0.01 s each
def test_an_impossible_value_is_left_to_its_case(name: str, value: float) -> None:
    assert all(note.startswith(name) for note in doubtful_values(damped(), [{name: value}]))


def test_only_the_extremes_of_a_name_are_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    applied: list[Case] = []

    def apply(deck: fecm.Deck, case: Case) -> fecm.Deck:
        applied.append(case)
        return apply_case(deck, case)

    monkeypatch.setattr("fecm.sweeps.checks.apply_case", apply)
    (problem,) = load_deck(short()).problems
    cases: list[Case] = [{"velocity": 1000.0 + n, "k": 4e4 + n} for n in range(10_000)]
    assert doubtful_values(problem, cases) == []
    assert applied == [{"velocity": 1000.0}, {"velocity": 10999.0}, {"k": 4e4}, {"k": 49999.0}]


def test_a_ply_thickness_is_that_of_every_ply() -> None:
    text = base()
    thinner = replaced(r"     0\.184$", "      0.15")(replaced(r"2\.944", "  2.4")(text))
    deck = fecm.read_one(text)
    assert deck.with_(ply_thickness=0.15) == fecm.read_one(thinner)
    assert deck.with_(laminate_thickness=2.4) == deck.with_(thickness=2.4)
    with pytest.raises(ValueError, match="exclude each other"):
        deck.with_(ply_thickness=0.15, laminate_thickness=2.4)
