"""The macro program: loops, counters, the clock, and what is refused."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.deck.findings import Findings
from fecm.deck.macros import compile_program, estimate_work
from fecm.deck.model import Macro
from fecm.listing.slips import Mode
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import RunOptions
from fecm.problem.loading import load_deck
from fecm.results.sinks import MemorySink
from fecm.simulation.interpreter import Action, Interpreter
from fecm.simulation.run import simulate
from tests.decks import DATA_CARDS, PROGRAM, ready, small


def run(program: str, mode: Mode = "report", slips: tuple[str, ...] = ()) -> Result:
    """Result of the small plate under a program."""
    return fecm.run_one(small(program), mode=mode, slips=slips, solver="numpy")


def program(*cards: str) -> tuple[Macro, ...]:
    """Macros of words and values: ``LOOP 3``."""
    macros = []
    for card in cards:
        word, _, value = card.partition(" ")
        macros.append(Macro(word, "", float(value or 0)))
    return tuple(macros)


def compiled(*cards: str) -> tuple[list[str], list[str]]:
    """Codes of a program's findings, and the words it carries out."""
    findings = Findings()
    words: list[str] = []

    def bind(macro: Macro) -> Action:
        return lambda: words.append(macro.word)

    Interpreter(compile_program(program(*cards), findings)).run(bind)
    return [f.code for f in findings], words


def test_nested_loops_carry_out_their_bodies_in_order() -> None:
    codes, words = compiled("LMAS", "LOOP 2", "TIME", "LOOP 3", "DISP", "NEXT", "NEXT")
    assert codes == []
    assert words == ["LMAS", *["TIME", "DISP", "DISP", "DISP"] * 2]


def test_loops_nest_at_least_eight_deep() -> None:
    cards = ["LMAS", *["LOOP 2"] * 9, "DISP", *["NEXT"] * 9]
    codes, words = compiled(*cards)
    assert codes == []
    assert words.count("DISP") == 2**9


def test_loop_0_runs_once() -> None:
    assert compiled("LOOP 0", "TIME", "NEXT")[1] == ["TIME"]


@pytest.mark.parametrize(
    ("cards", "code"),
    [
        (("LOOP 2", "TIME"), "E502"),
        (("TIME", "NEXT"), "E503"),
        (("LMSA",), "E501"),
        (("DT 1", "RODP"), "E504"),
        (("LMAS", "RODP"), "E504"),
        (("LOOP -1", "TIME", "NEXT"), "E505"),
        (("LOOP 2.5", "TIME", "NEXT"), "E505"),
        (("DT -1",), "E505"),
        (("LMAS", "DT 1", "LOOP 5", "RODP", "NEXT"), "W507"),
        (("TANG", "SOLV"), "E504"),
        (("FORM", "SOLV"), "E504"),
        (("TANG", "FORM", "SOLV", "CONV"), "E513"),
        (("EIGE 3",), "E504"),
        (("TOL 0",), "E505"),
        (("REAC",), "E504"),
    ],
)
def test_a_program_that_cannot_be_meant_is_found(cards: tuple[str, ...], code: str) -> None:
    assert compiled(*cards)[0] == [code]


def test_an_unknown_macro_is_an_error_at_its_place() -> None:
    text = small("LMAS\nDT        .5E-6\nRODD\n")
    (finding,) = load_deck(text).findings
    assert finding.code == "E501"
    assert finding.place is not None
    assert text.splitlines()[finding.place.line - 1] == "RODD"
    assert "RODP" in finding.hint


def test_the_estimate_counts_what_the_run_stores() -> None:
    text = "LMAS\nDT        .5E-6\nLOOP          7\nTIME\nRODP          3\nDISP          2\nNEXT\n"
    result = run(text + text)
    counted = estimate_work(load_deck(small(text + text)).problems[0].program)
    assert counted.steps == len(result.force) == 14
    assert counted.contact_rows == len(result.tape9.force) == 4
    assert counted.passes["DISP"] == len(result.tape3.w) == 6
    assert counted.macros == 2 * (2 + 7 * 4)


def test_rodp_counts_steps_across_loops_and_disp_the_passes_of_its_own_loop() -> None:
    result = run(
        "LMAS\nDT        .5E-6\n"
        "LOOP          7\nTIME\nRODP          3\nDISP          3\nNEXT\n"
        "LOOP          7\nTIME\nRODP          3\nDISP          3\nNEXT\n"
    )
    assert result.tape9.step.tolist() == [3, 6, 9, 12]
    assert result.tape3.step.tolist() == [3, 6, 10, 13]


def test_outside_a_loop_the_pass_is_1_and_rodp_takes_one_step() -> None:
    result = run("LMAS\nDT        .5E-6\nRODP\nDISP\nDISP          2\nRODP\n")
    assert result.history.step.tolist() == [1, 2]
    assert result.tape3.step.tolist() == [1]
    assert result.tape9.step.tolist() == [1, 2]


def test_the_time_of_a_row_is_the_sum_of_the_steps_taken_even_without_time() -> None:
    result = run(
        "LMAS\nDT        .5E-6\nLOOP          4\nRODP\nNEXT\nDT        .2E-6\nLOOP          2\n"
        "RODP\nDISP\nNEXT\n"
    )
    expected = np.cumsum([5e-7] * 4 + [2e-7] * 2)
    np.testing.assert_allclose(result.time, expected, rtol=1e-14)
    np.testing.assert_allclose(result.tape3.time, expected[4:], rtol=1e-14)


def test_groups_whose_macro_never_ran_are_absent() -> None:
    result = run("LMAS\nDT        .5E-6\nLOOP          4\nTIME\nRODP          9\nNEXT\n")
    heads = {key.partition("/")[0] for key in result}
    assert heads == {"mesh", "laminate", "history", "energy"}


def test_a_change_of_dt_changes_the_rods_constants_but_not_under_its_slip() -> None:
    text = (
        "LMAS\nDT        .5E-6\nLOOP         10\nTIME\nRODP\nNEXT\n"
        "DT        .2E-6\nLOOP         25\nTIME\nRODP\nNEXT\n"
    )
    fine = run("LMAS\nDT        .1E-6\nLOOP        100\nTIME\nRODP\nNEXT\n")
    right, slipped = run(text), run(text, slips=("rod-dt",))
    np.testing.assert_array_equal(right.force[:10], slipped.force[:10])
    # Up to the same instant, 10 us, the converged acceleration is met by the one, not the other.
    end = fine.force[99]
    assert abs(right.force[-1] - end) < 0.05 * end
    assert abs(right.acceleration[-1] - slipped.acceleration[-1]) > 1e-3 * abs(end)


def test_two_problems_in_one_file_know_nothing_of_each_other() -> None:
    alone = run(
        "LMAS\nDT        .5E-6\nLOOP         10\nTIME\nRODP          5\nDISP          5\nNEXT\n"
    )
    both = fecm.run(small(stop=False) + small(), solver="numpy")
    assert isinstance(both, list)
    for result in both:
        np.testing.assert_array_equal(result.force, alone.force)


def test_each_slip_alone_changes_what_it_says() -> None:
    plain = run(
        "LMAS\nDT        .5E-6\nLOOP         40\nTIME\nRODP          5\nDISP          5\nNEXT\n"
    )
    text = "LMAS\nDT        .5E-6\nLOOP         40\nTIME\nRODP          5\nDISP          5\nNEXT\n"
    target = run(text, slips=("target",))
    assert not target.plate_w.any()
    assert target.tape3.w.any()
    density = run(text, slips=("density",))
    assert density.energy.attributes["initial"] / plain.energy.attributes["initial"] == (
        pytest.approx(0.0003225 / 0.0006875)
    )
    start = run(text, slips=("rod-start",))
    assert abs(start.transducer[0]) > 1000 * abs(plain.transducer[0])
    station = run(text, slips=("station",))
    assert station.transducer.min() < 0.0 < plain.transducer.max()
    np.testing.assert_array_equal(station.force, plain.force)
    tapes = run(text, slips=("tapes",))
    assert len(tapes.tape9.force) == 40
    np.testing.assert_array_equal(tapes.force, plain.force)
    assert tapes.slips == ("tapes",)
    assert tapes.mode == "report"


def test_shear_order_and_g12_change_the_stiffness_only_where_the_deck_lets_them() -> None:
    text = "LMAS\nDT        .5E-6\nLOOP         40\nTIME\nRODP\nNEXT\n"
    reduced = DATA_CARDS.replace("    3    3   -3", "    3    2   -3")
    woven = DATA_CARDS.replace("  1150000.", " 17500000.")

    def force(data: str, *slips: str) -> float:
        result = fecm.run_one(small(text, data=data), slips=slips, force=True, solver="numpy")
        return float(result.force[-1])

    assert force(DATA_CARDS, "shear-order") == force(DATA_CARDS)
    assert force(reduced, "shear-order") == force(DATA_CARDS)
    assert force(reduced) != force(DATA_CARDS)
    assert force(DATA_CARDS, "g12") == force(DATA_CARDS)
    assert force(woven, "g12") != force(woven)


def test_forces_on_a_free_plate_give_its_centre_of_mass_newtons_motion() -> None:
    zero, one = "       0.0", "       1.0"
    forces = f"FORC\n    1    1{zero}{zero}{one}\n   25    0{zero}{zero}{one}\n\n"
    text = small(
        "LMAS\nDT        .5E-6\nLOOP         20\nTIME\nRODP\nDISP\nNEXT\n",
        data=DATA_CARDS.replace("     115.0", zero) + forces,
    )
    result = fecm.run_one(text)
    plate = ready(text).plate
    moment = plate.mass @ result.tape3.displacement[-1][plate.mesh.equations > 0]
    # Leapfrog from rest under 25 unit forces: sum of m w = F dt^2 n (n + 1)/2 after n steps.  The
    # rotations have no resultant by symmetry.
    assert moment == pytest.approx(25.0 * (5e-7) ** 2 * 20 * 21 / 2, rel=1e-9)
    held = result.energy.plate_kinetic[-1] + result.energy.plate_strain[-1]
    assert result.energy.external_work[-1] == pytest.approx(held, rel=0.06)  # first-order sum
    scaled = fecm.run_one(text, slips=("force-scale",))
    assert not scaled.tape3.w.any()  # without contact there is no force to scale by


def test_a_prescribed_displacement_is_followed_and_loads_the_free_unknowns() -> None:
    zero = "       0.0"
    # The edge x = 0 is held in w and displaced by 1e-3.
    held = "BOUN\n    1    5    0    0   -1    0    0\n   21    0    0    0   -1    0    0\n\n"
    held += f"FORC\n    1    5{zero}{zero}     0.001\n   21    0{zero}{zero}     0.001\n\n"
    data = DATA_CARDS.replace("     115.0", zero)
    text = small(
        "LMAS\nDT        .5E-6\nLOOP         20\nTIME\nRODP\nDISP\nNEXT\n", data=data + held
    )
    result = fecm.run_one(text)
    np.testing.assert_array_equal(result.tape3.w[:, [0, 5, 10, 15, 20]], 1e-3)
    assert (result.tape3.w[-1, [1, 6, 11, 16, 21]] > 0.0).all()


def test_dt_0_takes_nine_tenths_of_the_critical_time_step_and_says_so() -> None:
    text = small(PROGRAM.replace("DT        .5E-6", "DT"))
    assert load_deck(text).errors() == []
    problem = load_deck(text).problems[0]
    sink = MemorySink()
    simulation = simulate(problem, sink)
    critical = critical_time_step(simulation.model.plate)
    assert simulation.state.dt == pytest.approx(0.9 * critical, rel=5e-3)
    assert sink.arrays["history/time"][0] == simulation.state.dt
    (note,) = simulation.state.notes
    assert f"{simulation.state.dt:g}" in note


def test_the_sparse_solver_gives_the_same_history_to_rounding() -> None:
    auto, csr = (fecm.run(small(), solver=solver) for solver in ("auto", "csr"))
    assert isinstance(auto, Result)
    assert isinstance(csr, Result)
    np.testing.assert_allclose(csr.force, auto.force, rtol=1e-11)


@pytest.mark.parametrize(
    ("choice", "told"),
    [
        ({"solver": "dense"}, "unknown solver 'dense'; known are auto, kernels, numpy, csr"),
        ({"threads": -1}, "threads is -1; it must be 0 or more"),
        ({"energy_limit": 0.0}, "energy_limit is 0; it must be positive"),
        ({"energy_limit": float("nan")}, "energy_limit is nan; it must be positive"),
        ({"rod_mass": "none"}, "unknown rod mass 'none'"),
        ({"slips": ("denser",)}, "denser"),
    ],
)
def test_a_choice_that_there_is_not_is_refused(choice: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        fecm.run(small(), **choice)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_finished_run_goes_with_its_plate_at_once(threads: int) -> None:
    # Thousands of runs in one process would fill its memory before cycles are looked for.
    gc.collect()
    gc.disable()
    try:
        simulation = simulate(
            load_deck(small()).problems[0], MemorySink(), RunOptions(threads=threads)
        )
        parts = [
            simulation,
            simulation.model.motion,
            simulation.model.plate,
            simulation.model.impact,
        ]
        gone = [weakref.ref(part) for part in parts]
        del simulation, parts
        assert [one() for one in gone] == [None] * 4
    finally:
        gc.enable()
