"""Sweeps in which the plate varies: its supports and time step follow the laminate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.authoring.values import apply_case
from fecm.deck.model import Boundary, Deck
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.problem.parts import is_coupled
from tests.calls import call
from tests.decks import DATA_CARDS, LONG, MESH, PROGRAM, model, small

LAYUPS = ("[0/90]2s", "[0_4/90_4]", "[45/-45]4")


def new(layup: str, *options: str) -> str:
    """Deck that ``fecm new`` writes for a layup."""
    answer = call(
        "new",
        "-",
        "--size",
        "100x100",
        "--mesh",
        "4x4",
        "--layup",
        layup,
        "--ply-thickness",
        ".25",
        "--material",
        "T300/5208",
        "--units",
        "mm-N-s",
        "--velocity",
        "3000",
        "--law",
        "45000,.016,.094,2.5",
        "--projectile",
        "mass:2e-5",
        "--duration",
        "2e-4",
        "--kinematics",
        "linear",
        *options,
    )
    assert answer.exit_code == 0
    return answer.stdout


@pytest.mark.parametrize(
    ("base", "support"),
    [(LAYUPS[0], "simple"), (LAYUPS[1], "free"), (LAYUPS[1], "clamped")],
)
@pytest.mark.few(1)  # of 3, 0.5 s each
def test_a_sweep_of_layups_is_new_and_run_of_each(base: str, support: str) -> None:
    options = "--support", support, "--duration", "5e-5"
    swept = fecm.sweep(new(base, *options), {"layup": LAYUPS}, history=True)
    assert swept.force is not None
    for case, layup in enumerate(LAYUPS):
        result = fecm.run_one(new(layup, *options))
        assert swept.dt[case] == pytest.approx(result.time[0], rel=1e-12)
        steps = min(len(result.force), int(swept.steps[case]))
        assert steps >= len(result.force) - 1
        difference = np.abs(swept.force[case, :steps] - result.force[:steps]).max()
        assert difference < 1e-9 * result.force.max()


def test_an_unsymmetric_laminate_is_the_softer_one() -> None:
    deck = new(LAYUPS[0], "--support", "clamped", "--duration", "1e-3")
    swept = fecm.sweep(deck, {"layup": LAYUPS[:2]})
    symmetric, unsymmetric = swept["peak_force"]
    assert unsymmetric < 0.97 * symmetric


def test_u_and_v_are_free_where_b_is_not_zero_and_w_is_free() -> None:
    deck = model(new("[0/90]s", "--edge", "left=simple", "--edge", "top=clamped"))
    assert (generate(deck).codes[:, :2] != 0).all()
    codes = generate(apply_case(deck, {"layup": "[0/90]"})).codes != 0
    assert codes[:, 2].sum() == 9 + 9 - 1
    assert (codes[:, 0] == codes[:, 2]).all()
    assert (codes[:, 1] == codes[:, 2]).all()
    kept = apply_case(deck, {"layup": "[90/0]s"})
    assert kept.all(Boundary) == deck.all(Boundary)


def test_a_note_counts_the_cases_whose_u_and_v_are_set_free(tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(new("[0/90]s"))
    vary = ("--vary", "velocity=100,200", "--vary", "layup=[0/90]s,[0/90],[45/-45],[90/0]s")
    done = call("sweep", deck, *vary, "-o", tmp_path / "s.h5")
    assert done.exit_code == 0
    # The short runs end in contact, which another note says.
    assert done.stderr.startswith(
        "fecm: note: B is not zero in 4 cases: u and v, which the deck restrains at every node, "
        "are free there except where w is held\n"
    )
    deck.write_text(new("[0/90]"))
    assert "B is not zero" not in call("sweep", deck, *vary, "-o", tmp_path / "t.h5").stderr


def test_supports_in_the_plane_that_hold_some_nodes_only_are_kept() -> None:
    mesh = MESH.replace(
        "    1    1   -1   -1    0    0    0\n", "    3    1   -1   -1    0    0    0\n"
    )
    deck = apply_case(model(small(mesh=mesh)), {"layup": "[0/90/0]"})
    changed = apply_case(deck, {"layup": "[0/90]"})
    assert changed.all(Boundary) == deck.all(Boundary)


def test_in_plane_unknowns_that_rest_do_not_limit_the_time_step() -> None:
    # Stiff plies at the faces: the plate is faster in its plane than in bending.
    held = model(LONG.read_text().replace("LOOP       4000", "LOOP       1000"))
    assert not is_coupled(held)
    free = Deck(
        held.title,
        held.control,
        tuple(s for s in held.segments if not isinstance(s, Boundary)),
        held.macros,
    )
    steps = [f"{line}" for deck in (held, free) for line in _critical(deck)]
    assert steps[0] == steps[1]
    force = [_run(deck).force for deck in (held, free)]
    np.testing.assert_array_equal(force[0], force[1])
    sparse = fecm.run_one(free, solver="csr")
    assert np.abs(sparse.force - force[0]).max() < 1e-9 * force[0].max()


def _critical(deck: Deck) -> list[str]:
    from fecm.problem.summary import deck_summary

    built = deck_summary(load_deck(deck).problems[0])
    return [line for line in built.lines() if "critical" in line]


def _run(deck: Deck) -> fecm.Result:
    return fecm.run_one(deck)


def in_plane_first(dt: str, program: str = PROGRAM) -> str:
    """A plate without in-plane supports whose stiff core makes it faster in its plane."""
    layers = "    1  90.      0.13\n    2   0.      0.80\n    3  90.      0.13\n"
    data = DATA_CARDS[: DATA_CARDS.index("    1   0. ")].replace(".106", "1.06") + layers
    mesh = MESH[: MESH.index("BOUN")]
    text = small(program.replace("DT        .5E-6", f"DT,,{dt}"), mesh=mesh, data=data)
    return text.replace("   25    4    2    2", "   25    4    3    2")


def test_a_sweep_under_dt_0_takes_the_time_step_of_the_run() -> None:
    # Velocities alone leave the deck's DT 0 to each of the two.
    text = in_plane_first("0", PROGRAM.replace("         10", "        400"))
    run, swept = fecm.run(text), fecm.sweep(text, {"velocity": [115.0]}, history=True)
    assert isinstance(run, fecm.Result)
    assert swept.force is not None
    assert swept.dt[0] == run.time[0]
    np.testing.assert_allclose(swept.force[0], run.force, rtol=0.0, atol=1e-9 * run.force.max())


def test_in_plane_unknowns_that_rest_do_not_make_the_contact_look_unstable() -> None:
    # All unknowns together limit the step to 1.34e-6, those that move to 1.51e-6.
    (problem,) = load_deck(in_plane_first("1.45E-6")).problems
    assert critical_time_step(problem.plate) < 1.45e-6 < problem.critical_time_step
    assert "W517" not in [f.code for f in load_deck(in_plane_first("1.45E-6")).findings]
