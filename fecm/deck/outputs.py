"""What a macro program stores, and how often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from numbers import Integral

from fecm._dataclasses import frozen
from fecm._errors import FecmError
from fecm.deck.macros import STEPS, Macro
from fecm.deck.macros import every as every_of

HISTORY = "RODP"
FIELDS = "DISP"
PLIES = "PLYS"
FAILURE = "FAIL"
PLY_ROWS = 20  # rows of ply stresses where their number is not given: they are large

# Steps between stored rows: a number, True for a default, False for no rows.
Rows = int | bool
# The same, or the number and that of the elements nearest to the load.
RowsOfPlies = Rows | tuple[int, int]


class RowsError(FecmError, ValueError):
    """A program can't store what it is asked for."""


@frozen
class _Output:
    """A macro that stores rows."""

    word: str
    rows: Rows
    nearest: int | None = None  # elements nearest to the load

    def changed(self, old: Macro) -> Macro:
        """A macro of the program with the new numbers."""
        value = old.value if self.rows is True else float(self.rows)
        second = old.second if self.nearest is None else float(self.nearest)
        return replace(old, value=value, second=second, source=None)

    def macro(self, passes: int, step: int) -> Macro:
        """A new macro for a loop of some passes, where RODP stores every `step` steps."""
        default = max(1, passes // PLY_ROWS) if self.word == PLIES else min(step, passes)
        value = default if self.rows is True else self.rows
        return Macro(self.word, value=float(value), second=float(self.nearest or 0))


def with_outputs(
    macros: Sequence[Macro],
    *,
    every: int | None = None,
    plies: RowsOfPlies | None = None,
    failure: Rows | None = None,
) -> tuple[Macro, ...]:
    """Macros that store other rows; what is None stays as it is.

    `every` is the number of RODP and DISP, `plies` that of PLYS and `failure` that of FAIL.  A
    macro that the program lacks is put at the end of each loop that takes steps, or at the end of a
    program without such a loop.  True stores failure with the rows of RODP, and about
    :data:`PLY_ROWS` rows of ply stresses; a macro that is there keeps its number.

    Raises RowsError if a number is not positive and whole.
    """
    made = list(macros)
    if every is not None:
        rows = _count("every", every)
        for new in (_Output(HISTORY, rows), _Output(FIELDS, rows)):
            made = [new.changed(macro) if macro.word == new.word else macro for macro in made]
    for output in (_of_failure(failure), _of_plies(plies)):
        if output is not None:
            made = _with_output(made, output)
    return tuple(made)


def _of_plies(given: RowsOfPlies | None) -> _Output | None:
    if given is None:
        return None
    if not isinstance(given, tuple):
        return _Output(PLIES, _rows("plies", given))
    if len(given) != 2:
        raise RowsError(f"`plies` is {given!r}, not a number of steps and one of elements")
    return _Output(PLIES, _rows("plies", given[0]), _count("plies", given[1]))


def _of_failure(given: Rows | None) -> _Output | None:
    return None if given is None else _Output(FAILURE, _rows("failure", given))


def _rows(name: str, value: object) -> Rows:
    return value if isinstance(value, bool) else _count(name, value)


def _count(name: str, value: object) -> int:
    """A number of steps or elements."""
    if isinstance(value, Integral) and not isinstance(value, bool) and (count := int(value)) > 0:
        return count
    raise RowsError(f"`{name}` is {value!r}, not a whole number above 0")


def _with_output(macros: Sequence[Macro], output: _Output) -> list[Macro]:
    """Add a macro that stores rows, change its number, or remove it."""
    if output.rows is False:
        return [macro for macro in macros if macro.word != output.word]
    if any(macro.word == output.word for macro in macros):
        return [output.changed(m) if m.word == output.word else m for m in macros]
    step = next((every_of(macro) for macro in macros if macro.word == HISTORY), 1)
    made: list[Macro] = []
    loops: list[int] = []  # passes of the open ones
    stepping: set[int] = set()  # depths of those that take steps
    for macro in macros:
        depth = len(loops)
        if macro.word == "LOOP":
            loops.append(max(1, int(macro.value)))
        elif macro.word in STEPS and loops:
            stepping.add(depth)
        elif macro.word == "NEXT" and loops:
            passes = loops.pop()
            if depth in stepping:
                made.append(output.macro(passes, step))
            stepping.discard(depth)
        made.append(macro)
    if len(made) == len(macros):
        made.append(output.macro(1, 1))
    return made
