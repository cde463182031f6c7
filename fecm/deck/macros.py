"""Macro program: its cards, words and loops, the order of execution, and the rows that it stores.

Passes of the innermost loop are counted from 1. Outside any loop the pass is 1. LOOP 0 runs once.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from numbers import Integral
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm.deck.card import Fields, Record, Value, layout, parse_real
from fecm.deck.findings import Findings

NESTING = 64  # deepest nesting of loops
MOST_MACROS = 10**9  # a program of more macros would run for days
EXACT = 2**53  # a float can represent every integer below this number


def without_points(values: Sequence[Value]) -> list[Value]:
    """Return the values of a card; whole floats become integers, without a decimal point."""
    return [
        int(v) if isinstance(v, float) and v.is_integer() and abs(v) < EXACT else v for v in values
    ]


@dataclass(frozen=True)
class Macro(Record):
    """Macro card: (A4,1X,A4,1X,2F5.0)."""

    word: str  # name, in capitals
    option: str = ""  # second word, in capitals; often blank
    # The two numbers; 0 if blank.
    value: float = 0.0
    second: float = 0.0

    fields: ClassVar[Fields] = layout(
        "A4 macro", "X1", "A4 second word", "X1", "F5 value", "F5 second value"
    )
    # With commas the card may leave out the second word before the value: LOOP,794.
    short_fields: ClassVar[Fields] = (fields[0], *fields[2:])

    optional: ClassVar[int] = 3

    def row(self) -> list[Value]:
        """Return the values in the card's order, whole numbers as integers."""
        return without_points(super().row())


@dataclass(frozen=True)
class LoadTable(Record):
    """Card of PROP: (2I5,7F10.0), after the macro program's END."""

    # Type of the table, 1 (or blank), and the power L of the sine.
    kind: int
    exponent: int
    # Times between which the load acts.
    begin: float
    end: float
    constants: tuple[float, ...]  # A1 to A5 of A1 + A2 t + A3 sin(A4 t + A5)^L

    packed: ClassVar[slice] = slice(4, None)
    fields: ClassVar[Fields] = layout(
        "I5 type",
        "I5 exponent|exp",
        "F10 begin|t_min",
        "F10 end|t_max",
        *(f"F10 constant A{i}|A{i}" for i in range(1, 6)),
    )


def load_factor(table: LoadTable, clock: float) -> float:
    """Return A1 + A2 t + A3 sin(A4 t + A5)^L between t_min and t_max, 0 outside.

    L below 1 counts as 1.
    """
    if not table.begin <= clock <= table.end:
        return 0.0
    a1, a2, a3, a4, a5 = table.constants
    return a1 + a2 * clock + a3 * math.sin(a4 * clock + a5) ** max(table.exponent, 1)


class MacroNumber(Enum):
    """Meaning of the number of a macro."""

    COUNT = auto()  # an integer, at least 0
    EVERY = auto()  # an integer, at least 0; 0 or blank means 1
    TIME_STEP = auto()  # positive, or 0 for 0.9 of the critical time step
    TOLERANCE = auto()  # positive


class StoredRows(Enum):
    """Rows that a macro stores, besides those of time steps."""

    NONE = auto()
    EVERY_NTH_PASS = auto()  # one
    N_EACH_TIME = auto()


class Word(NamedTuple):
    """Word of the macro language."""

    name: str  # up to four letters
    meaning: str  # its effect, in one sentence
    value: MacroNumber | None = None
    # Words that must come before. One word of each tuple is enough.
    needs: tuple[tuple[str, ...], ...] = ()
    inside: bool = False  # whether it belongs inside a loop
    second: bool = False  # whether it takes a second number, an integer of at least 0
    rows: StoredRows = StoredRows.NONE


A_MASS = ("LMAS", "CMAS")
A_SOLUTION = ("SOLV", "EXCD", "RODP")
EXPLICIT = (("LMAS",), ("DT",))  # needs of a step of central differences
WORDS = {
    word.name: word
    for word in (
        Word("LOOP", "Repeats the macros up to its NEXT N times.", MacroNumber.COUNT),
        Word("NEXT", "Ends a loop."),
        Word("DT", "Sets the time step; 0 takes 0.9 of the critical one.", MacroNumber.TIME_STEP),
        Word("TIME", "Advances the clock by DT."),
        Word(
            "PROP",
            "Reads a proportional load from a card after END, or evaluates it again.",
            MacroNumber.COUNT,
        ),
        Word("LMAS", "Forms the lumped mass."),
        Word("CMAS", "Forms the consistent mass."),
        Word("TANG", "Forms and factorises the stiffness."),
        Word("FORM", "Forms the residual: the loads less the internal forces."),
        Word(
            "SOLV",
            "Solves for the displacement that removes the residual.",
            needs=(("TANG",), ("FORM",)),
        ),
        Word("TOL", "Sets the tolerance of CONV.", MacroNumber.TOLERANCE),
        Word(
            "CONV",
            "Leaves the loop once the solution has converged.",
            needs=(("SOLV",),),
            inside=True,
        ),
        Word(
            "REAC",
            "Stores and prints the reactions.",
            needs=(A_SOLUTION,),
            rows=StoredRows.N_EACH_TIME,
        ),
        Word(
            "EIGE",
            "Finds the N lowest natural modes.",
            MacroNumber.EVERY,
            needs=(A_MASS,),
            rows=StoredRows.N_EACH_TIME,
        ),
        Word("EXCD", "Takes one step of central differences.", needs=EXPLICIT),
        Word(
            "RODP",
            "Takes one impact step; stores contact and strains at every N-th step.",
            MacroNumber.EVERY,
            needs=EXPLICIT,
        ),
        Word(
            "DISP",
            "Stores displacements at every N-th pass of the loop.",
            MacroNumber.EVERY,
            rows=StoredRows.EVERY_NTH_PASS,
        ),
        Word(
            "STRE",
            "Stores and prints strains and stress resultants at every N-th pass.",
            MacroNumber.EVERY,
            rows=StoredRows.EVERY_NTH_PASS,
        ),
        Word(
            "PLYS",
            "Stores ply stresses at every N-th pass, in the M elements nearest to the load or all.",
            MacroNumber.EVERY,
            second=True,
            rows=StoredRows.EVERY_NTH_PASS,
        ),
        Word(
            "FAIL",
            "Evaluates the failure criteria at every N-th pass.",
            MacroNumber.EVERY,
            rows=StoredRows.EVERY_NTH_PASS,
        ),
        Word(
            "OVER",
            "Leaves the loop at an N-th pass, from the M-th on, once the impact is over.",
            MacroNumber.EVERY,
            needs=(("RODP",),),
            inside=True,
            second=True,
        ),
        Word("CHEC", "Reports mesh and storage."),
    )
}
STEPS = {"RODP", "EXCD"}  # words that take a time step


@dataclass(frozen=True)
class Loop:
    """Loop: its LOOP card, number of passes and body."""

    macro: Macro
    count: int
    body: tuple[Macro | Loop, ...]


Body = tuple[Macro | Loop, ...]


def every(macro: Macro) -> int:
    """Return N of a macro that acts at every N-th step or pass; a blank means 1."""
    return max(1, int(macro.value))


def macro_number(macro: Macro) -> float:
    """Return the number that a macro works with: N of :func:`every`, or the number on the card."""
    return every(macro) if WORDS[macro.word].value is MacroNumber.EVERY else macro.value


class _OpenLoop(NamedTuple):
    """LOOP without its NEXT so far."""

    head: Macro
    outer: list[Macro | Loop]  # items before it in the loop around it


def compile_program(macros: tuple[Macro, ...], findings: Findings) -> Body:
    """Nest the loops of a macro program and check its words; empty after an error in loops."""
    open_loops: list[_OpenLoop] = []
    body: list[Macro | Loop] = []
    done: set[str] = set()
    for macro in macros:
        if findings.closed:
            return ()
        if (word := WORDS.get(macro.word)) is not None:
            _check_unused(word, macro, findings)
        elif (word := _guess_word(macro, findings)) is None:
            continue
        _check_value(word, macro, findings)
        _check_needs(word, macro, done, findings)
        if word.inside and not open_loops:
            message = f"{word.name} is outside any loop."
            findings.add("E513", message, macro.place("macro"), "put it between LOOP and NEXT")
        match word.name:
            case "LOOP":
                open_loops.append(_OpenLoop(macro, body))
                body = []
                if len(open_loops) > NESTING:
                    message = f"Loops are nested deeper than {NESTING}."
                    findings.add("E506", message, macro.place("macro"))
                    return ()
            case "NEXT" if open_loops:
                head, outer = open_loops.pop()
                count = max(1, int(head.value)) if head.value >= 0 else 1
                outer.append(Loop(head, count, tuple(body)))
                body = outer
            case "NEXT":
                findings.add("E503", "NEXT has no LOOP.", macro.place("macro"))
            case _:
                body.append(macro)
    for head, _ in open_loops:
        message = "The LOOP is not closed by a NEXT."
        hint = "put a NEXT card after the loop's last macro"
        findings.add("E502", message, head.place("macro"), hint)
    if open_loops:
        return ()
    _warn_of_stopped_clock(tuple(body), findings)
    return tuple(body)


def _check_needs(word: Word, macro: Macro, done: set[str], findings: Findings) -> None:
    """Report each missing word that must come before, once, and record this word as done."""
    for choices in word.needs:
        if not done.intersection(choices):
            names = " or ".join(choices)
            message = f"{names} must come before {word.name}."
            findings.add("E504", message, macro.place("macro"), f"put {names} before it")
            done.add(choices[0])
    done.add(word.name)


def _guess_word(macro: Macro, findings: Findings) -> Word | None:
    """Report an unknown word; return the closest known one, so that loops stay complete."""
    import difflib  # takes 1 ms; only a misspelt word needs it

    near = difflib.get_close_matches(macro.word, WORDS, 1, 0.5)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(WORDS)}, END"
    findings.add("E501", f"`{macro.word}` is not a macro.", macro.place("macro"), hint)
    return WORDS[near[0]] if near else None


def _check_unused(word: Word, macro: Macro, findings: Findings) -> None:
    """Report the first filled field that a word does not use."""
    if macro.option:
        is_number = word.value and not macro.value and parse_real(macro.option) is not None
        hint = f"the number is in columns 11-15 or after a comma: {word.name},{macro.option}"
        message = f"{word.name} takes no second word; the card has `{macro.option}`."
        place = macro.place("second word")
        findings.add("E514", message, place, hint if is_number else "remove it")
    elif macro.value and not word.value:
        message = f"{word.name} takes no number; the card has {macro.value:g}."
        findings.add("E514", message, macro.place("value"), "remove it")
    elif macro.second and not word.second:
        message = f"{word.name} takes no second number; the card has {macro.second:g}."
        hint = f"a number of more than five digits goes after a comma: {word.name},123456"
        findings.add("E514", message, macro.place("second value"), hint)


def _check_value(word: Word, macro: Macro, findings: Findings) -> None:
    if word.second and not (macro.second >= 0 and macro.second.is_integer()):
        must = f"takes a whole number of 0 or more as its second value, not {macro.second:g}"
        findings.add("E505", f"{word.name} {must}.", macro.place("second value"))
    value = macro.value
    match word.value:
        case MacroNumber.COUNT | MacroNumber.EVERY if not (
            0 <= value <= MOST_MACROS and value.is_integer()
        ):
            must = f"whole number from 0 to {MOST_MACROS:g}"
        case MacroNumber.TIME_STEP if value < 0:
            must = "positive time step"
        case MacroNumber.TOLERANCE if value <= 0:
            must = "positive tolerance"
        case _:
            return
    findings.add("E505", f"{word.name} takes a {must}, not {value:g}.", macro.place("value"))


def _warn_of_stopped_clock(body: Body, findings: Findings) -> None:
    for item in body:
        if isinstance(item, Loop):
            words = {m.word for m in flat(item.body)}
            if words & STEPS and "TIME" not in words:
                why = "the clock of time-dependent loads does not advance"
                message = f"The loop steps without TIME, so {why}."
                findings.add("W507", message, item.macro.place("macro"), "put TIME before the step")
            else:
                _warn_of_stopped_clock(item.body, findings)


def flat(body: Body) -> Iterator[Macro]:
    """Return every macro once, in the order of the cards, without LOOP and NEXT."""
    return (macro for macro, *_ in _executed(body) if macro.word != "LOOP")


def hits(body: Body) -> bool:
    """Return whether a program takes impact steps."""
    return any(macro.word == "RODP" for macro in flat(body))


EXTENDED = 4  # largest number of passes of an extended loop, over its own
TESTS = 200  # tests of OVER in as many passes as the loop had


def extended(body: Body) -> Body:
    """Return a program whose loops of impact steps go on until the impact is over.

    They make at least their own number of passes, and at most EXTENDED times as many. Loops within
    loops stay as they are.
    """
    return tuple(_extended(item) if isinstance(item, Loop) else item for item in body)


def _extended(loop: Loop) -> Loop:
    words = [item.word for item in loop.body if isinstance(item, Macro)]
    if "RODP" not in words:
        return loop
    body = loop.body
    if "OVER" not in words:
        body += (Macro("OVER", value=max(1.0, loop.count // TESTS), second=float(loop.count)),)
    return replace(loop, count=EXTENDED * loop.count, body=body)


def moves_only(body: Body) -> bool:
    """Return whether a program has no static solution, so that the plate moves from rest."""
    return all(macro.word not in ("TANG", "FORM", "SOLV") for macro in flat(body))


class WorkEstimate(NamedTuple):
    """Work and output of a program; upper bounds if CONV or OVER may leave loops early."""

    macros: int  # executed macros; each pass of a loop executes its NEXT
    steps: int  # time steps, impact steps and central differences
    contact_rows: int  # steps that store contact and strains
    passes: Counter[str]  # rows by the word that stores them, see `StoredRows`
    at_most: bool = False  # whether OVER may end the steps earlier


def estimate_work(body: Body) -> WorkEstimate:
    """Count the work of a program without executing its loops.

    The counts are exact, with one exception: `contact_rows` is an upper bound if RODP cards have
    different numbers or are mixed with EXCD.
    """
    macros, passes = 0, Counter[str]()
    steps = Counter[int]()  # by the number of RODP; 0 for EXCD
    for macro, count, outer in _executed(body):
        macros += count * outer
        match WORDS[macro.word].rows:
            case StoredRows.EVERY_NTH_PASS:
                passes[macro.word] += count // every(macro) * outer
            case StoredRows.N_EACH_TIME:
                passes[macro.word] += count * outer * every(macro)
        if macro.word in STEPS:
            steps[every(macro) if macro.word == "RODP" else 0] += count * outer
    total = sum(steps.values())
    impact = {n: count for n, count in steps.items() if n}
    if len(steps) == 1 and impact:
        contact = total // next(iter(steps))
    else:
        contact = sum(min(count, total // n) for n, count in impact.items())
    return WorkEstimate(macros, total, contact, passes, any(m.word == "OVER" for m in flat(body)))


def _executed(body: Body, count: int = 1, outer: int = 1) -> Iterator[tuple[Macro, int, int]]:
    """Yield each macro, the passes of its loop, and the number of executions of that loop.

    LOOP comes after its body, in the place of NEXT.
    """
    for item in body:
        if isinstance(item, Loop):
            yield from _executed(item.body, item.count, outer * count)
            yield item.macro, item.count, outer * count
        else:
            yield item, count, outer


def steps_at(body: Body, word: str) -> NDArray[np.int64]:
    """Return the numbers of the impact steps, from 1, after which a macro stores a row.

    OVER does not end the steps.
    """
    parts: list[NDArray[np.int64]] = []
    _add_steps(body, word, 1, 0, parts)
    return np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)


def _add_steps(
    body: Body, word: str, passes: int, first: int, parts: list[NDArray[np.int64]]
) -> int:
    """Add the steps of `passes` passes of a body that begins after `first` steps.

    Returns the number of steps after it.
    """
    if any(isinstance(item, Loop) for item in body):
        for number in range(1, passes + 1):
            for item in body:
                if isinstance(item, Loop):
                    first = _add_steps(item.body, word, item.count, first, parts)
                elif item.word in STEPS:
                    first += 1
                if isinstance(item, Macro) and item.word == word and not number % every(item):
                    parts.append(np.array([first]))
        return first
    a_pass = sum(item.word in STEPS for item in body if isinstance(item, Macro))
    before = 0
    for item in body:
        if isinstance(item, Macro):
            before += item.word in STEPS
            if item.word == word:
                n = every(item)
                numbers = np.arange(n, passes + 1, n)
                parts.append(first + (numbers - 1) * a_pass + before)
    return first + passes * a_pass


HISTORY = "RODP"
FIELDS = "DISP"
PLIES = "PLYS"
FAILURE = "FAIL"
PLY_ROWS = 20  # least default number of rows of ply stresses; few, because a row is large
# Macro whose steps a new macro follows.
FOLLOWS = {PLIES: FIELDS, FAILURE: HISTORY}

# Steps between stored rows: a number, True for a default, False for no rows.
Rows = int | bool
# `Rows`, or the steps between rows and the number of elements nearest to the load.
RowsOfPlies = Rows | tuple[int, int]


def steps_of_plies(passes: int, fields: int) -> int:
    """Return the default number of PLYS in a loop of `passes` passes with this number of DISP.

    It is a multiple of the number of DISP, so that each row of ply stresses has displacements.

    Examples
    --------
    >>> steps_of_plies(25295, 126)
    1260
    """
    steps = max(1, passes // PLY_ROWS)
    return steps // fields * fields or min(fields, passes)


class RowsError(FecmError, ValueError):
    """A program can't store the requested rows."""


class _Output(NamedTuple):
    """Macro that stores rows."""

    word: str
    rows: Rows
    nearest: int | None = None  # number of elements nearest to the load

    def update(self, macro: Macro) -> Macro:
        """Return an existing macro with the new numbers."""
        value = macro.value if self.rows is True else float(self.rows)
        second = macro.second if self.nearest is None else float(self.nearest)
        return replace(macro, value=value, second=second, source=None)

    def create(self, passes: int, step: int) -> Macro:
        """Return a macro for a loop of `passes` passes.

        The macro that it follows stores every `step` steps.
        """
        default = steps_of_plies(passes, step) if self.word == PLIES else min(step, passes)
        value = default if self.rows is True else self.rows
        return Macro(self.word, value=float(value), second=float(self.nearest or 0))


def with_outputs(
    macros: Sequence[Macro],
    *,
    every: int | None = None,
    plies: RowsOfPlies | None = None,
    failure: Rows | None = None,
) -> tuple[Macro, ...]:
    """Return the macros of a program that stores other rows; None leaves rows as they are.

    `every` is the number of RODP and DISP, `plies` the number of PLYS, and `failure` the number of
    FAIL. A missing PLYS or FAIL is added at the end of each loop that takes steps, or at the end of
    a program without such a loop. True keeps the number of an existing macro. A new FAIL then has
    the number of RODP, and a new PLYS that of :func:`steps_of_plies`. Raises RowsError if a number
    is not positive and whole.
    """
    changed = list(macros)
    if every is not None:
        rows = _check_count("every", every)
        for output in (_Output(HISTORY, rows), _Output(FIELDS, rows)):
            changed = [output.update(m) if m.word == output.word else m for m in changed]
    for requested in (_failure_output(failure), _ply_output(plies)):
        if requested is not None:
            changed = _with_output(changed, requested)
    return tuple(changed)


def _ply_output(rows: RowsOfPlies | None) -> _Output | None:
    if rows is None:
        return None
    if not isinstance(rows, tuple):
        return _Output(PLIES, _check_rows("plies", rows))
    if len(rows) != 2:
        raise RowsError(f"`plies` is {rows!r}, not a number of steps and one of elements")
    return _Output(PLIES, _check_rows("plies", rows[0]), _check_count("plies", rows[1]))


def _failure_output(rows: Rows | None) -> _Output | None:
    return None if rows is None else _Output(FAILURE, _check_rows("failure", rows))


def _check_rows(name: str, value: object) -> Rows:
    return value if isinstance(value, bool) else _check_count(name, value)


def _check_count(name: str, value: object) -> int:
    """Return a number of steps or elements; raise RowsError if it is not positive and whole."""
    if isinstance(value, Integral) and not isinstance(value, bool) and (count := int(value)) > 0:
        return count
    raise RowsError(f"`{name}` is {value!r}, not a whole number above 0")


def _with_output(macros: Sequence[Macro], output: _Output) -> list[Macro]:
    """Add a macro that stores rows, change its number, or remove it."""
    if output.rows is False:
        return [macro for macro in macros if macro.word != output.word]
    if any(macro.word == output.word for macro in macros):
        return [output.update(m) if m.word == output.word else m for m in macros]
    step = next((every(macro) for macro in macros if macro.word == FOLLOWS[output.word]), 1)
    changed: list[Macro] = []
    loops: list[int] = []  # passes of the open loops
    stepping: set[int] = set()  # depths of open loops that take steps
    for macro in macros:
        depth = len(loops)
        if macro.word == "LOOP":
            loops.append(max(1, int(macro.value)))
        elif macro.word in STEPS and loops:
            stepping.add(depth)
        elif macro.word == "NEXT" and loops:
            passes = loops.pop()
            if depth in stepping:
                place = len(changed)
                if changed[-1].word == "OVER":  # which is the last macro, and ends most loops early
                    place, passes = place - 1, max(1, passes // EXTENDED)
                changed.insert(place, output.create(passes, step))
            stepping.discard(depth)
        changed.append(macro)
    if len(changed) == len(macros):
        changed.append(output.create(1, 1))
    return changed
