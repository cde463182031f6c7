"""Pages on which an impact follows sliders, as a job of a deck."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fecm._files import beside, check_outputs
from fecm._options import documented, option, with_parameters_of
from fecm.authoring.strike_values import strike_of
from fecm.authoring.values import OF_PLATE, Changes, names_of
from fecm.deck.catalogue import system_of
from fecm.deck.units import PREFIXED, PREFIXES, in_si, unit_names, unit_of
from fecm.exploration.page import page
from fecm.exploration.plates import (
    KINDS,
    SPANS,
    ExploreError,
    page_plates,
    run_quietly,
)
from fecm.judge import end
from fecm.mechanics.impact_sweep import Given, ResultRow
from fecm.problem.loading import AnyDeck, load_deck, load_one
from fecm.results.comparison import Measurement, measurement_of
from fecm.results.metrics import METRICS
from fecm.simulation.notes import STANDARD_GRAVITY
from fecm.sweeps.backends import only_impacts
from fecm.sweeps.case_tables import table_of_cases
from fecm.sweeps.job import Named
from fecm.sweeps.plan import plan

SUFFIXES = (".html", ".htm")
MOST = 8_000_000  # bytes of the responses of all plates
HEIGHT = 900  # pixels of the page in a notebook
DIMENSIONS = {
    **{name: quantity.dimension for name, quantity in METRICS.items()},
    "velocity": "length/time",
    "height": "length",
    "energy": "force*length",
    "mass": "force*time^2/length",
    "k": "force/length^1.5",
    "radius": "length",
    "giic": "force/length",
    "time": "time",
}
# Units of ratios.
SIZES = {"none": "", "thickness": "h", "percent": "%"}
# Constants that say what the end of an impact decides, by their names there.
END_RULES = (
    "FALLEN", "CLEAR", "CLEAR_FREE", "PRESSED", "LIGHT", "GONE", "RESERVE", "RINGING",
)  # fmt: skip


@documented
@dataclass(eq=False, repr=False)
class Exploration:
    """Page on which an impact follows sliders.

    The page is one file with the plate and the compiled kernel of sweeps as WebAssembly. It opens
    in a browser without a server or a network. A plate with `NONL` is reduced to bending modes,
    and compared with full runs while the page is made.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem, without one-sided supports.
    {parameters}

    Raises
    ------
    ExploreError
        If the deck has one-sided supports, the program has more than impact steps, the modes of a
        plate with `NONL` do not give the peak force, or the page would be too large.
    CasesError
        If values of `vary` are invalid.
    DeckError
        If the deck has errors.
    StudyError
        If the measured force is invalid.

    Examples
    --------
    >>> page = Exploration("decks/impact-115.inp")
    >>> page.save("impact.html")  # doctest: +SKIP
    """

    deck: AnyDeck
    vary: Mapping[str, Sequence[Any]] | Named | None = option(
        None,
        "Plates to choose from: values by name, as for a sweep, of what changes the plate, as in "
        "ply_thickness=.125,.184; all combinations.",
        form='Mapping of names to values, or texts such as ``"ply_thickness=.125,.184"``.',
        group="Page",
    )
    _: KW_ONLY
    overlay: Path | str | tuple[Any, Any] | None = option(
        None,
        "Measured force to draw with the computed one: a table of time and force.",
        python="Or a pair of times and forces.",
        group="Page",
        metavar="MEASURED.csv",
    )
    columns: Sequence[str] | None = option(
        None,
        "Its columns of time and force, by name or number.",
        group="Page",
        metavar="TIME,FORCE",
    )
    units: Sequence[str] | None = option(
        None, "Its units, if it names none.", group="Page", metavar="TIME,FORCE"
    )

    modes: int = option(
        0,
        "Natural modes that give the response at other places: the impact can be moved, by a click "
        "on the plate. Some 60 are enough; with 0 it stays.",
        group="Page",
        metavar="N",
    )

    def __post_init__(self) -> None:
        loaded = load_deck(self.deck)
        problem = load_one(loaded)
        cases = table_of_cases(self.vary, None, system=system_of(problem.deck)).cases
        if (words := problem.deck.nonlinear_words) not in KINDS:
            raise ExploreError(
                f"the deck has {words}, and a page has no one-sided supports: take a window that "
                "holds (fecm new --window held); the notes of a run then say how hard it pulls"
            )
        if not only_impacts(problem, cases[0]):
            raise ExploreError(
                "the page has impacts that start at rest, with steps of one size: the deck has "
                "other steps, nodal forces or prescribed displacements"
            )
        self._kind = KINDS[words]
        if self.modes:
            if reason := self._kind.fixed(problem):
                raise ExploreError(reason)
            if moving := [name for name in cases[0] if name in names_of(Changes.PLACE)]:
                raise ExploreError(
                    f"{moving[0]} moves the impact, as a click does: leave it out of `vary`"
                )
        self._plan = plan(problem, cases, model=self._kind.sweep_model)
        if not strike_of(problem.deck).velocity:
            raise ExploreError(
                "the sliders start at the velocity of ROD, which must not be 0: give the deck one"
            )
        names = [name for name in self._plan.cases[0] if name not in OF_PLATE]
        if names:
            raise ExploreError(
                f"{names[0]} does not change the plate: leave it out of `vary`; energy, velocity, "
                "mass, k, radius and giic have sliders"
            )
        self._file, self._problem = Path(loaded.source), problem
        self._measured: Measurement | None = None
        if self.overlay is not None:
            self._measured = measurement_of(
                self.overlay, unit_names(problem.deck), self.columns or (), self.units or ()
            )
        elif self.columns or self.units:
            raise ExploreError("columns and units describe a measured force: give overlay too")

    @property
    def price(self) -> str:
        """What takes long before the page is written; empty if nothing does."""
        return self._kind.price

    @cached_property
    def html(self) -> str:
        """The page."""
        result = run_quietly(self._problem.deck)  # the page has its notes
        plates, size, cases = [], 0, self._plan.cases
        for plate in page_plates(self._kind, self._plan.settings, cases, result, self.modes):
            plates.append(plate)
            size += len(json.dumps(plate))
            if size > MOST:
                raise ExploreError(
                    f"{len(plates)} of {len(cases)} plates take {size / 1e6:.3g} MB, and a page "
                    f"has at most {MOST / 1e6:g} MB: leave out values of `vary`, or shorten the run"
                    + (", or take fewer modes" if self.modes else "")
                )
        deck, names = self._problem.deck, unit_names(self._problem.deck)
        units = {name: unit_of(dimension, names) for name, dimension in DIMENSIONS.items()}
        data = {
            "title": deck.title or "(no title)",
            "deck": {
                "name": self._file.name if self._file.is_file() else "deck.inp",
                "text": deck.to_text(),
            },
            "units": {
                name: [unit, *PREFIXED.get(unit, ("", 0))] for name, unit in (units | SIZES).items()
            },
            "prefixes": {str(power): prefix for power, prefix in PREFIXES.items()},
            "labels": {name: quantity.description for name, quantity in METRICS.items()},
            "gravity": STANDARD_GRAVITY / (in_si("length/time^2", names) or math.inf) or None,
            "given": [row.name for row in Given],
            "found": [row.name for row in ResultRow],
            "ends": {
                "rules": {name: getattr(end, name) for name in END_RULES},
                "words": {
                    name: [meaning.level, meaning.words, meaning.brief]
                    for name, meaning in end.ENDS.items()
                },
            },
            "spans": SPANS,
            "plates": plates,
            "notes": list(dict.fromkeys(result.notes)),
            "measured": self._measured
            and {
                "name": self._measured.name,
                "time": self._measured.time.tolist(),
                "force": self._measured.force.tolist(),
            },
        }
        return page(data, result.time, result.force)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the page.

        Raises ExploreError if the name does not end in .html. Raises OSError if the file can't be
        written, or exists and may not be replaced.
        """
        file = Path(path)
        check_page(file, overwrite, self.inputs)
        text = self.html
        with beside(file, overwrite=overwrite) as partial:
            partial.write_text(text, encoding="utf-8", newline="\n")

    @property
    def inputs(self) -> list[Path]:
        """Files that the page is made of."""
        measured = [Path(self.overlay)] if isinstance(self.overlay, str | Path) else []
        return [self._file, *measured]

    def __repr__(self) -> str:
        return f"<fecm page of {self._problem.deck.title!r}, {len(self._plan.cases)} plates>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" sandbox="allow-scripts allow-downloads" '
            f'style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )


def check_page(path: Path, overwrite: bool, inputs: Sequence[Path] = ()) -> None:
    """Refuse a page that can't be written."""
    if path.suffix.lower() not in SUFFIXES:
        raise ExploreError(f"{path}: a page is written as {SUFFIXES[0]}")
    check_outputs([path], overwrite, inputs)


@with_parameters_of(Exploration)
def explore(job: Exploration) -> Exploration:
    """Make a page on which an impact follows sliders.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem, without one-sided supports.
    {parameters}

    Returns
    -------
    Exploration
        Shown by a notebook; :meth:`Exploration.save` writes it as a file.

    Examples
    --------
    >>> import fecm
    >>> page = fecm.explore("decks/impact-115.inp")
    >>> page.save("impact.html")  # doctest: +SKIP
    """
    return job
