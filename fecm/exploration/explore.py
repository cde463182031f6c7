"""Pages on which an impact follows sliders, as a job of a deck."""

from __future__ import annotations

import html
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fecm._errors import FecmError, FecmWarning
from fecm._files import beside, check_outputs
from fecm._options import documented, option, with_parameters_of
from fecm.authoring.strike_values import strike_of
from fecm.authoring.values import OF_PLATE
from fecm.deck.catalogue import system_of
from fecm.deck.units import PREFIXED, PREFIXES, in_si, unit_names, unit_of
from fecm.exploration.page import page
from fecm.exploration.plates import SPANS, encoded, page_plates
from fecm.judge import end
from fecm.judge.limits import ENERGY_BALANCE, ITERATION, THRESHOLD
from fecm.mechanics.impact_sweep import Given, ResultRow, SweepStruct
from fecm.mechanics.kernels.webassembly import wasm_fields
from fecm.problem.loading import AnyDeck, load_deck, load_one
from fecm.results.comparison import Measurement, measurement_of
from fecm.results.metrics import METRICS
from fecm.simulation.job import run_one
from fecm.simulation.notes import STANDARD_GRAVITY
from fecm.sweeps.case_tables import table_of_cases
from fecm.sweeps.job import Named
from fecm.sweeps.methods import SharedResponse
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
# Constants that say what the end of an impact decides, by their names there.
END_RULES = (
    "FALLEN", "CLEAR", "CLEAR_FREE", "PRESSED", "LIGHT", "GONE", "RESERVE", "RINGING",
)  # fmt: skip


class ExploreError(FecmError, ValueError):
    """No page can be made of a deck."""


@documented
@dataclass(eq=False, repr=False)
class Exploration:
    """Page on which an impact on a linear plate follows sliders.

    The page is one file with the response of the plate and the compiled kernel of sweeps as
    WebAssembly. It opens in a browser without a server or a network.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem, whose plate is linear.
    {parameters}

    Raises
    ------
    ExploreError
        If the plate is not linear, the program has more than impact steps, or the page would be
        too large.
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

    def __post_init__(self) -> None:
        loaded = load_deck(self.deck)
        problem = load_one(loaded)
        cases = table_of_cases(self.vary, None, system=system_of(problem.deck)).cases
        self._plan = plan(problem, cases, history=False)
        if words := problem.deck.nonlinear_words:
            raise ExploreError(
                f"the page superposes responses of a linear plate, and the deck has {words}: make "
                "it without (fecm new --kinematics linear, --window held); the notes of a run then "
                "say by how much the force is off"
            )
        if not isinstance(self._plan.method, SharedResponse):
            raise ExploreError(
                "the page has impacts that start at rest, with steps of one size: the deck has "
                "other steps, nodal forces or prescribed displacements"
            )
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

    @cached_property
    def html(self) -> str:
        """The page."""
        plates = list(page_plates(self._plan.settings, self._plan.cases))
        size = sum(len(plate["structure"]["plate"]) for plate in plates)
        if size > MOST:
            raise ExploreError(
                f"the responses of {len(plates)} plates take {size / 1e6:.3g} MB, and a page has "
                f"at most {MOST / 1e6:g} MB: leave out values of `vary`, or shorten the run"
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FecmWarning)  # the page has the notes of the run
            result = run_one(self._problem.deck)
        deck, names = self._problem.deck, unit_names(self._problem.deck)
        units = {name: unit_of(dimension, names) for name, dimension in DIMENSIONS.items()}
        data = {
            "title": deck.title or "(no title)",
            "deck": {
                "name": self._file.name if self._file.is_file() else "deck.inp",
                "text": deck.to_text(),
            },
            "units": {name: [unit, *PREFIXED.get(unit, ("", 0))] for name, unit in units.items()},
            "prefixes": {str(power): prefix for power, prefix in PREFIXES.items()},
            "labels": {name: quantity.description for name, quantity in METRICS.items()},
            "gravity": STANDARD_GRAVITY / (in_si("length/time^2", names) or math.inf) or None,
            "fields": list(wasm_fields(SweepStruct)),
            "given": [row.name for row in Given],
            "found": [row.name for row in ResultRow],
            "ends": {
                "rules": {name: getattr(end, name) for name in END_RULES},
                "words": {
                    name: [meaning.level, meaning.words, meaning.brief]
                    for name, meaning in end.ENDS.items()
                },
            },
            "balance": [ENERGY_BALANCE.value, ENERGY_BALANCE.page, ITERATION.page],
            "elastic": [THRESHOLD.page, THRESHOLD.level],
            "spans": SPANS,
            "plates": plates,
            "notes": list(dict.fromkeys(result.notes)),
            "measured": self._measured
            and {
                "name": self._measured.name,
                "time": encoded(self._measured.time),
                "force": encoded(self._measured.force),
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
        Deck with a single problem, whose plate is linear.
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
