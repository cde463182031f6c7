"""OVER ends a loop once the impact is over; the pass at which it does depends on the deck alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import fecm
from fecm import Deck
from fecm.deck.model import Macro
from fecm.judge.end import End
from fecm.mechanics.impact_steps import ImpactSteps
from tests.calls import call
from tests.decks import LONG, model, small
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_stopping

REPORT = LONG.read_text()


def until_over(every: int = 20, passes: int = 16000) -> str:
    """The report's plate and rod, for as long as the impact lasts."""
    return REPORT.replace("LOOP       4000", f"LOOP      {passes:5}").replace(
        "NEXT", f"OVER,,{every}\nNEXT"
    )


@cache
def run_until_over() -> fecm.Result:
    """Result of the report's plate and rod, until the impact is over."""
    return fecm.run_one(until_over())


def test_a_loop_ends_at_the_first_tested_pass_at_which_the_impact_is_over() -> None:
    run = run_until_over()
    whole = fecm.run_one(REPORT.replace("LOOP       4000", "LOOP      12000"))
    steps = len(run.force)
    assert run.end is End.OVER
    assert run.notes == tuple(note for note in run.notes if "largest deflection" not in note)
    assert 4000 < steps < 12000
    assert steps % 20 == 0
    assert run.metrics["peak_force"] == pytest.approx(whole.metrics["peak_force"], rel=1e-9)
    assert run.metrics["rebound_velocity"] == pytest.approx(
        whole.metrics["rebound_velocity"], rel=1e-9
    )
    assert np.abs(run.force - whole.force[:steps]).max() < 1e-9 * whole.force.max()


def test_a_sweep_decides_cases_that_a_run_decides() -> None:
    deck = until_over(passes=8000)  # in contact after a quarter of them
    run, cases = fecm.run_one(deck), fecm.sweep(deck, {"velocity": [115.0]})
    assert list(cases["status"]) == ["ok"]
    for name in ("peak_force", "contact_time", "rebound_velocity"):
        assert cases[name] == pytest.approx([run.metrics[name]], rel=1e-6)


def steps_of(path: Path) -> int:
    """Number of steps of a stored run."""
    return len(fecm.load(path).force)


def test_no_solver_and_no_size_of_blocks_changes_the_last_pass(tmp_path: Path) -> None:
    steps = {len(run_until_over().force), len(fecm.run_one(until_over(), solver="numpy").force)}
    for interval in (7, 64, 1000):  # steps of a call of the kernels at most
        run_stopping(until_over(), tmp_path / "run.h5", interval=interval)
        steps.add(steps_of(tmp_path / "run.h5"))
    assert len(steps) == 1


def with_rows(words: str, passes: int) -> Deck:
    """A short impact whose loop has these macros after TIME and RODP.

    No ply is in pure shear anywhere, where rounding alone would tell tension from compression.
    """
    deck = fecm.impact(
        fecm.Plate.rectangle((40, 30), (2, 2), support="simple"),
        fecm.Laminate("[30/-60]s", "T300/5208", 0.5),
        fecm.RigidMass(2e-5),
        fecm.Contact.estimate(radius=8),
        velocity=8000,
        units="mm-N-s",
        damage=True,
    )
    numbers = {"RODP": 4, "DISP": 6, "FAIL": 5, "PLYS": 30, "STRE": 45, "OVER": 6}
    start = [macro for macro in deck.macros if macro.word in ("LMAS", "DT")]
    loop = (Macro(word, value=numbers[word]) for word in ("RODP", *words.split()))
    macros = (*start, Macro("LOOP", value=passes), Macro("TIME"), *loop, Macro("NEXT"))
    return replace(deck, macros=macros, text="")


ORDERS = ("DISP FAIL PLYS OVER", "OVER DISP FAIL PLYS", "FAIL OVER PLYS DISP", "DISP STRE OVER")


@pytest.mark.few(5)
@pytest.mark.parametrize("words", ORDERS)
@pytest.mark.parametrize("solver", ["kernels", "numpy"])
def test_a_loop_that_ends_early_stores_what_a_loop_of_its_passes_stores(
    words: str, solver: Literal["kernels", "numpy"], tmp_path: Path
) -> None:
    deck = with_rows(words, 4000)
    run = fecm.run_one(deck, solver=solver)
    passes = len(run.force)
    assert run.end is End.OVER
    assert 60 < passes < 2000
    assert passes % 6 == 0
    # Displacements are due in the last pass, but OVER before DISP leaves the loop first.
    before, _, after = words.partition("OVER")
    expected = fecm.run_one(with_rows(before + after, passes), solver=solver)
    assert expected["tape3/step"][-1] == passes
    assert set(run) == set(expected)
    for name in run:
        stored = expected[name]
        if name.startswith("tape3/") and "DISP" in after:
            stored = stored[:-1]
        assert run[name].shape == stored.shape
        if stored.dtype.kind == "f":  # compiled steps round differently where a block ends
            precision = 1e-9 * np.nanmax(np.abs(stored)) if solver == "kernels" else 0.0
            np.testing.assert_allclose(run[name], stored, rtol=0.0, atol=precision)
        else:
            assert np.array_equal(run[name], stored)
    run.save(tmp_path / "run.h5")
    assert call("tapes", tmp_path / "run.h5", "-d", tmp_path).exit_code == 0
    expected.save(tmp_path / "expected.h5")
    (tmp_path / "expected").mkdir()
    assert call("tapes", tmp_path / "expected.h5", "-d", tmp_path / "expected").exit_code == 0
    for tape in ("tape8", "tape9"):
        written, wanted = (
            (folder / tape).read_text() for folder in (tmp_path, tmp_path / "expected")
        )
        assert len(written) == len(wanted)
        assert written == wanted or solver == "kernels"


def test_macros_after_over_do_not_make_single_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    together: list[int] = []
    take = ImpactSteps.take

    def counted(self: ImpactSteps, *values: Any) -> Any:
        together.append(values[2])
        return take(self, *values)

    monkeypatch.setattr(ImpactSteps, "take", counted)
    steps = len(fecm.run_one(with_rows("OVER DISP FAIL", 4000), solver="kernels").force)
    assert sum(together) > 0.6 * steps


def test_a_loop_without_an_end_makes_all_its_passes() -> None:
    assert len(fecm.run_one(until_over(passes=900)).force) == 900


def test_over_waits_for_its_first_pass() -> None:
    early = len(run_until_over().force)
    late = fecm.run_one(until_over().replace("OVER,,20", f"OVER,,20,{early + 7}"))
    assert len(late.force) == early + 7


def test_a_deck_is_extended_until_its_impact_is_over() -> None:
    short = REPORT.replace("LOOP       4000", "LOOP       3000")
    plain, extended = fecm.run_one(short), fecm.run_one(short, extend=True)
    assert plain.end is not End.OVER
    assert any("--extend" in note for note in plain.notes)
    assert extended.end is End.OVER
    assert 3000 < len(extended.force) < 12000
    assert extended.deck_text == plain.deck_text
    decided = REPORT.replace("LOOP       4000", "LOOP      12000")
    assert len(fecm.run_one(decided, extend=True).force) == 12000


def test_what_can_not_be_extended_is_refused(tmp_path: Path) -> None:
    (tmp_path / "still.inp").write_text(small("LMAS\nDT        .5E-6\nRODP\n"))
    done = call("run", tmp_path / "still.inp", "--extend")
    assert done.exit_code == 2
    assert "extend needs a loop with RODP" in done.stderr
    done = call("run", LONG, "--extend", "--mode", "listing", "-o", tmp_path / "x.h5")
    assert done.exit_code == 2
    assert "extend needs report mode" in done.stderr


@pytest.mark.parametrize(
    ("text", "interval"),
    [(until_over(), 300), (with_rows("FAIL OVER PLYS DISP", 4000).to_text(), 20)],
)
def test_a_resumed_run_ends_at_the_same_pass_with_the_same_bytes(
    text: str, interval: int, tmp_path: Path
) -> None:
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    looks = run_stopping(text, whole, interval=interval)
    for look in (2, looks // 2, looks):  # also after the contact
        with pytest.raises(StoppedError):
            run_stopping(text, cut, look, interval=interval)
        run_stopping(text, cut, resume=True, interval=interval)
        assert cut.read_bytes() == whole.read_bytes()
        cut.unlink()


def test_a_check_says_that_steps_and_bytes_are_upper_bounds(tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_text(until_over())
    out = call("check", tmp_path / "deck.inp").stdout
    assert "at most 16000" in out
    assert str(fecm.Run(until_over()).price).startswith("at most 16000 steps")
    assert "at most" not in call("check", LONG).stdout


def test_the_printed_program_has_no_over(tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_text(until_over())
    done = call("check", tmp_path / "deck.inp", "--mode", "listing")
    assert "The printed program has no OVER" in done.stdout + done.stderr


def test_a_sweep_of_a_deck_with_over_knows_what_its_runs_know() -> None:
    deck = model(until_over())
    swept = fecm.sweep(deck, {"velocity": [60.0, 115.0]}, history=True)
    for number, velocity in enumerate((60.0, 115.0)):
        run = fecm.run_one(deck.with_(velocity=velocity))
        for name in ("peak_force", "rebound_velocity", "impulse", "contacts"):
            assert swept[name][number] == pytest.approx(run.metrics[name], rel=1e-7)
    assert swept.force is not None
    assert swept.force.shape[1] < 16000


def test_a_new_deck_without_a_duration_ends_by_itself() -> None:
    def deck(support: str, mass: float) -> Deck:
        return fecm.impact(
            fecm.Plate.rectangle((100, 80), (4, 4), support=support),
            fecm.Laminate("[0/90]2s", "T300/5208", 0.25),
            fecm.RigidMass(mass),
            fecm.Contact.estimate(radius=8),
            energy=300,
            units="mm-N-s",
        )

    for support, mass in (("simple", 1e-3), ("clamped", 2e-5), ("free", 1e-4)):
        text = deck(support, mass)
        words = [macro.word for macro in text.macros]
        assert words[-2:] == ["OVER", "NEXT"]
        run = fecm.run_one(text)
        assert run.end is End.OVER
        assert len(run.force) < text.macros[words.index("LOOP")].value
    fixed = fecm.impact(
        fecm.Plate.rectangle((100, 80), (4, 4), support="simple"),
        fecm.Laminate("[0/90]2s", "T300/5208", 0.25),
        fecm.RigidMass(1e-3),
        fecm.Contact.estimate(radius=8),
        energy=300,
        units="mm-N-s",
        duration=1e-4,
    )
    assert "OVER" not in {macro.word for macro in fixed.macros}
