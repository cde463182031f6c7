"""The macro program: words, loops, the order in which macros are carried out.

A pass is the number of times that the innermost loop has been entered at its head, from 1; outside
any loop it is 1.  LOOP 0 runs once.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from dataclasses import dataclass

from fecm.deck.findings import Findings
from fecm.deck.model import Macro

NESTING = 64


@dataclass(frozen=True, slots=True)
class Word:
    """A word of the macro language.

    Attributes
    ----------
    name : str
        Up to four letters.
    meaning : str
        What it does, in one sentence.
    value : str
        What its number is: ``"count"`` (whole, not negative), ``"time step"`` (positive), or empty
        where it takes none.
    needs : tuple of str
        Words that must have been carried out before.
    """

    name: str
    meaning: str
    value: str = ""
    needs: tuple[str, ...] = ()


WORDS = {
    word.name: word
    for word in (
        Word("LMAS", "Forms the lumped mass."),
        Word("DT", "Sets the time step.", "time step"),
        Word("LOOP", "Carries out N times what stands before its NEXT.", "count"),
        Word("NEXT", "Ends a loop."),
        Word("TIME", "Advances the clock by DT."),
        Word(
            "RODP",
            "Takes one impact step; stores contact and strains at every N-th.",
            "count",
            ("LMAS", "DT"),
        ),
        Word("DISP", "Stores displacements at every N-th pass of the loop.", "count", ("LMAS",)),
    )
}


@dataclass(frozen=True)
class Loop:
    """A loop: its LOOP card, how often it runs, and what it carries out."""

    macro: Macro
    count: int
    body: tuple[Macro | Loop, ...]


Body = tuple[Macro | Loop, ...]


def every(macro: Macro) -> int:
    """N of a macro that acts at every N-th step or pass; 1 where it is blank."""
    return max(1, int(macro.value))


def compile_program(macros: tuple[Macro, ...], findings: Findings) -> Body:
    """Nest a macro program's loops and check its words.

    Parameters
    ----------
    macros : tuple of Macro
        The cards.
    findings : Findings
        Receives what is wrong with them.
    """
    open_loops: list[tuple[Macro, list[Macro | Loop]]] = []
    body: list[Macro | Loop] = []
    done: set[str] = set()
    for macro in macros:
        word = WORDS.get(macro.word) or _unknown(macro, findings)
        if word is None:
            continue
        _check_value(word, macro, findings)
        _check_order(word, macro, done, findings)
        if word.name == "LOOP":
            open_loops.append((macro, body))
            body = []
            if len(open_loops) > NESTING:
                findings.add(
                    "E506", f"Loops are nested deeper than {NESTING}.", macro.place("macro")
                )
                return ()
        elif word.name == "NEXT":
            if not open_loops:
                findings.add("E503", "NEXT stands without a LOOP.", macro.place("macro"))
                continue
            head, outer = open_loops.pop()
            count = max(1, int(head.value)) if head.value >= 0 else 1
            outer.append(Loop(head, count, tuple(body)))
            body = outer
        else:
            body.append(macro)
    for head, _ in open_loops:
        findings.add(
            "E502", "The LOOP is not closed by a NEXT.", head.place("macro"),
            "put a NEXT card behind the loop's last macro",
        )  # fmt: skip
    if open_loops:
        return ()
    program = tuple(body)
    _warn_of_standing_clock(program, findings)
    return program


def _unknown(macro: Macro, findings: Findings) -> Word | None:
    """Report an unknown word; the word that it most likely means, so that loops stay whole."""
    near = difflib.get_close_matches(macro.word, WORDS, 1, 0.5)
    findings.add(
        "E501",
        f"`{macro.word}` is no macro.",
        macro.place("macro"),
        f"did you mean {near[0]}?" if near else f"known are {', '.join(WORDS)}, END",
    )
    return WORDS[near[0]] if near else None


def _check_order(word: Word, macro: Macro, done: set[str], findings: Findings) -> None:
    """Report the words that must have been carried out before this one, each once."""
    for need in word.needs:
        if need not in done:
            findings.add(
                "E504",
                f"{word.name} needs {need}, which does not stand before it.",
                macro.place("macro"),
                f"put {need} before it",
            )
            done.add(need)
    done.add(word.name)


def _check_value(word: Word, macro: Macro, findings: Findings) -> None:
    value = macro.value
    if word.value == "count" and (value < 0 or not value.is_integer()):
        findings.add(
            "E505",
            f"{word.name} takes a whole number that is not negative, not {value:g}.",
            macro.place("value"),
        )
    elif word.value == "time step" and value <= 0:
        findings.add(
            "E505", f"{word.name} takes a positive time step, not {value:g}.", macro.place("value")
        )


def _warn_of_standing_clock(body: Body, findings: Findings) -> None:
    """Warn of the loops that step without TIME."""
    for item in body:
        if isinstance(item, Loop):
            words = {m.word for m in flat(item.body)}
            if "RODP" in words and "TIME" not in words:
                findings.add(
                    "W507",
                    "The loop steps without TIME, so that the clock of time-dependent loads "
                    "stands still.",
                    item.macro.place("macro"),
                    "put TIME before RODP",
                )
            else:
                _warn_of_standing_clock(item.body, findings)


def flat(body: Body) -> Iterator[Macro]:
    """Every macro once, in the order of the cards, without LOOP and NEXT."""
    for item in body:
        if isinstance(item, Loop):
            yield from flat(item.body)
        else:
            yield item


def walk(body: Body, current: int = 1) -> Iterator[tuple[Macro, int]]:
    """Carry out a program: every macro as often as it runs, with the pass it runs in."""
    for item in body:
        if isinstance(item, Loop):
            for number in range(1, item.count + 1):
                yield from walk(item.body, number)
        else:
            yield item, current


@dataclass(frozen=True, slots=True)
class Tally:
    """How much a program does and stores.

    Attributes
    ----------
    macros : int
        Macros carried out.
    steps : int
        Impact steps.
    contact_rows : int
        Steps at which contact and strains are stored.
    displacement_rows : int
        Rows that DISP stores.
    """

    macros: int
    steps: int
    contact_rows: int
    displacement_rows: int


def estimate(body: Body) -> Tally:
    """Count what a program does without carrying out its loops.

    Exact, but for `contact_rows` where RODP cards differ in their number: then an upper bound.
    """
    macros, displacements, steps = _entry(body, 1)
    total = sum(steps.values())
    if len(steps) == 1:
        contact = total // next(iter(steps))
    else:
        contact = sum(min(count, total // n) for n, count in steps.items())
    return Tally(macros, total, contact, displacements)


def _entry(body: Body, passes: int) -> tuple[int, int, dict[int, int]]:
    """Macros, DISP's rows, and steps by RODP's number, of a body run `passes` times on end."""
    macros, displacements = 0, 0
    steps: dict[int, int] = {}
    for item in body:
        if isinstance(item, Loop):
            inner, rows, taken = _entry(item.body, item.count)
            macros += passes * inner
            displacements += passes * rows
            for n, count in taken.items():
                steps[n] = steps.get(n, 0) + passes * count
        else:
            macros += passes
            if item.word == "DISP":
                displacements += passes // every(item)
            elif item.word == "RODP":
                steps[every(item)] = steps.get(every(item), 0) + passes
    return macros, displacements, steps


def tally(body: Body) -> Tally:
    """Count exactly what a program does and stores; carries out its loops where it must."""
    counted = estimate(body)
    if len({every(macro) for macro in flat(body) if macro.word == "RODP"}) <= 1:
        return counted
    step = rows = 0
    for macro, _ in walk(body):
        if macro.word == "RODP":
            step += 1
            rows += step % every(macro) == 0
    return Tally(counted.macros, counted.steps, rows, counted.displacement_rows)
