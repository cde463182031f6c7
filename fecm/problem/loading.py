"""Loading of decks: reading and checking."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple, TypeVar

from fecm._errors import OptionsError, warn
from fecm._typing import AnyFile
from fecm.deck.findings import DeckError, Finding
from fecm.deck.model import Deck
from fecm.deck.reader import Reader, load_text, read_deck
from fecm.listing.slips import LISTING, REPORT
from fecm.mechanics.plate import PlateModel
from fecm.problem.check import check_listing, check_problem
from fecm.problem.problem import Problem
from fecm.problem.rules.quadrature import HOURGLASS
from fecm.problem.rules.time_step import UNSTABLE

TANGENT = (
    "the plate stretches as it bends (NONL): `stiffness` is the stiffness at rest, and the "
    "internal forces of a deflected plate are not K u"
)

_Problem = TypeVar("_Problem")


class LoadedDeck(NamedTuple):
    """File that was read and checked."""

    source: str  # its name
    problems: list[Problem]  # the problems that could be read
    findings: list[Finding]  # all findings, in the deck's order

    def errors(self, force: bool = False) -> list[Finding]:
        """Return the findings that make the deck unusable.

        With `force`, unstable motions are permitted.
        """
        allowed = (UNSTABLE, HOURGLASS) if force else ()
        return [f for f in self.findings if f.severity == "error" and f.code not in allowed]

    def refuse_errors(self, force: bool = False) -> None:
        """Raise DeckError, with all findings, if the deck is unusable."""
        if self.errors(force):
            raise DeckError(self.findings, self.source)

    @property
    def warnings(self) -> list[str]:
        """Findings that are warnings, as texts."""
        return [
            finding.render(self.source)
            for finding in self.findings
            if finding.severity == "warning"
        ]


# What a deck may be given as: a file's path, its text, an open file, a model, or a deck that was
# read before.
AnyDeck = str | Path | AnyFile | Deck | LoadedDeck


def load_deck(
    deck: AnyDeck, mode: str = REPORT, change: Callable[[Deck], Deck] | None = None
) -> LoadedDeck:
    """Read and check a deck without running it.

    In listing mode blanks inside numbers are zeros, and decks that the printed program can't
    compute are errors. `change` gives each problem another program, and perhaps other segments,
    before it is checked; problems may then lack a program. Raises OSError if the file can't be
    read.
    """
    return _loaded(deck, partial(_load, mode=mode, change=change))


def load_again(deck: AnyDeck) -> LoadedDeck:
    """Read and check a deck, as :func:`load_deck` does, or return the last one if it is the same.

    For jobs that are repeated with one deck, which must not change what they get.
    """
    return _loaded(deck, _last)


def _loaded(deck: AnyDeck, load: Callable[[str, str], LoadedDeck]) -> LoadedDeck:
    """Load a deck from its text and the name of its source, unless it is loaded."""
    if isinstance(deck, LoadedDeck):
        return deck
    return load(*((deck.to_text(), "<deck>") if isinstance(deck, Deck) else load_text(deck)))


@lru_cache(maxsize=1)
def _last(text: str, source: str) -> LoadedDeck:
    return _load(text, source)


def _load(
    text: str, source: str, mode: str = REPORT, change: Callable[[Deck], Deck] | None = None
) -> LoadedDeck:
    listing = mode == LISTING
    reader = Reader(text, blanks_are_zeros=listing, needs_program=change is None)
    problems: list[Problem] = []
    for read in reader.problems():
        if reader.findings.closed:
            break
        if change is not None and read.deck is not None:
            read = replace(read, deck=change(read.deck))
        if (checked := check_problem(read, reader.findings, uses_l2=not listing)) is not None:
            problems.append(checked)
    if listing and not reader.findings.errors:
        for problem in problems:
            check_listing(problem, reader.findings)
    return LoadedDeck(source, problems, list(reader.findings))


def load_one(deck: AnyDeck, mode: str = REPORT) -> Problem:
    """Load a deck with exactly one problem.

    Raises DeckError if the deck has errors, OptionsError if it has several problems or none.
    """
    loaded = load_deck(deck, mode)
    loaded.refuse_errors()
    return sole(loaded.problems)


def sole_problem(deck: AnyDeck, *, warns: bool = True) -> Problem:
    """Return the checked problem of a deck with one problem.

    With `warns`, warnings about it are FecmWarnings. Raises DeckError if the deck has errors, apart
    from unstable motions. Raises OptionsError if the deck does not have exactly one problem.
    """
    loaded = load_deck(deck)
    loaded.refuse_errors(force=True)
    problem = sole(loaded.problems)
    for text in loaded.warnings if warns else ():
        warn(text)
    return problem


def read_one(path_or_text: str | Path | AnyFile) -> Deck:
    """Read a deck with exactly one problem; see :func:`read_deck`.

    Raises
    ------
    DeckError
        If the deck has errors.
    OptionsError
        If it has several problems, or none.
    """
    read = read_deck(path_or_text)
    return sole([read] if isinstance(read, Deck) else read)


def plate_model(deck: AnyDeck) -> PlateModel:
    """Build the discrete plate of a deck: K, M and P of M a + K u = P (equation 4-14).

    It is the plate that :func:`fecm.run_one` moves. Projectile, contact law, damping and macro
    program are not part of it. A deck with lines of symmetry gives the part of the plate that it
    describes. Each warning about the deck is a :class:`~fecm.FecmWarning`.

    Parameters
    ----------
    deck : str, Path, file or Deck
        Deck with a single problem: a file's path, a deck's text, an open file, or a model built in
        Python.

    Returns
    -------
    PlateModel
        Matrices and loads in the deck's units.

    Raises
    ------
    DeckError
        If the deck has errors.
    OptionsError
        If it does not have exactly one problem.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> import fecm
    >>> plate = fecm.plate_model("decks/static-bending.inp")
    >>> plate.stiffness.shape == (plate.neq, plate.neq)
    True
    """
    plate = sole_problem(deck).plate
    if plate.nonlinear:
        warn(TANGENT)
    return plate


def sole(problems: Sequence[_Problem], deck: str | Path = "the deck") -> _Problem:
    """Return the only problem of a deck, which messages name.

    Raises OptionsError unless there is exactly one problem.
    """
    if len(problems) != 1:
        raise OptionsError(f"{deck} has {len(problems)} problems, not one")
    return problems[0]
