"""Data of pictures of sweeps: the cases to draw, and their parameters and quantities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator

from fecm._errors import did_you_mean, warn
from fecm._typing import Array, Bools, Indices
from fecm.authoring.values import NAMES, VARIABLES, ValueKind
from fecm.judge.end import PEAK_NOT_REACHED
from fecm.judge.limits import THRESHOLD
from fecm.judge.validity import counted
from fecm.plot import style
from fecm.plot.kinds import PlotError
from fecm.results.metrics import COLUMNS, VERDICTS
from fecm.results.metrics import INTEGERS as COUNTS
from fecm.sweeps.result import SweepResult
from fecm.sweeps.summary import reasons

if TYPE_CHECKING:
    from matplotlib.axis import Axis

LABELS = {
    "velocity": "Impact velocity", "k": "Contact coefficient $k$", "alpha_p": r"$\alpha_p$",
    "s_p": "$s_p$", "q": "$q$", "rod_length": "Length of the rod",
    "rod_modulus": "Modulus of the rod", "rod_density": "Density of the rod",
    "mass": "Mass of the projectile", "rod_mass": "Mass of the projectile",
    "energy": "Impact energy", "radius": "Radius of the sphere", "at": "Impact point",
    "angle": "Angle added (°)", "nu12": r"$\nu_{12}$", "e1": "$E_1$", "e2": "$E_2$",
    "g12": "$G_{12}$", "g13": "$G_{13}$", "g23": "$G_{23}$", "dt": "Time step",
    "patch": "Radius of the patch", "x0": "$x_0$", "y0": "$y_0$",
    "giic": r"Toughness $G_\mathrm{IIc}$", "xt": "$X_T$", "xc": "$X_C$", "yt": "$Y_T$",
    "yc": "$Y_C$", "s12": "$S_{12}$", "s13": "$S_{13}$", "s23": "$S_{23}$",
    "max_indentation": "Largest indentation",
}  # fmt: skip
_NUMBERS_OF_NODES = (
    name for name, variable in VARIABLES.items() if variable.kind is ValueKind.INTEGER
)
INTEGERS = (*_NUMBERS_OF_NODES, *COUNTS)
STILL = "still in contact at the end"
ENDED = "contact not over at the end"
Where = Mapping[str, float | str]  # values of parameters that select cases, by name


class DrawnVariable(NamedTuple):
    """Parameter or quantity of cases, shown by an axis or by colours."""

    name: str
    scale: style.AxisScale
    values: Array  # (cases,): numbers, or positions of texts in `ticks`
    ticks: tuple[str, ...] = ()  # texts in the order of the cases; empty for numbers

    @property
    def label(self) -> str:
        """Name in words."""
        plain = self.name.replace("_", " ")
        is_user_name = self.name not in (*COLUMNS, *NAMES)  # a word or symbol of the user
        return LABELS.get(self.name, plain if is_user_name else plain.capitalize())

    @property
    def whole(self) -> bool:
        """Whether the numbers are integers."""
        return self.name in INTEGERS

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest number, without NaN."""
        return float(np.nanmin(self.values)), float(np.nanmax(self.values))

    def mark(self, axis: Axis) -> None:
        """Label an axis of a graph; integers have ticks at integers only."""
        self.scale.name(axis, self.label)
        if self.whole:
            axis.set_major_locator(MaxNLocator(integer=True))


def variable_of(sweep: SweepResult, name: str, values: Array) -> DrawnVariable:
    """Return the values of a parameter or quantity as a variable; integers are not scaled."""
    plain = style.AxisScale(1.0, "")
    if values.dtype.kind == "U":
        ticks = tuple(dict.fromkeys(values.tolist()))
        places = {text: place for place, text in enumerate(ticks)}
        return DrawnVariable(
            name, plain, np.array([places[text] for text in values.tolist()]), ticks
        )
    if name in INTEGERS:
        return DrawnVariable(name, plain, values)
    return DrawnVariable(
        name, style.scale(style.largest_absolute(values), sweep.unit(name)), values
    )


def case_rows(sweep: SweepResult, name: str, where: Where) -> Indices:
    """Return the cases that `where` selects; a number selects the nearest value."""
    kept = np.ones(len(sweep), dtype=bool)
    for parameter, value in where.items():
        values = parameter_values(sweep, name, parameter)
        if values.dtype.kind == "U":
            kept &= _equal_texts(values, value, f"{name} has no {parameter} {value}")
        else:
            kept &= _nearest_numbers(values, value, f"{name} has no {parameter} {value}")
    if not kept.any():
        raise PlotError(f"{name} has no case with these values of {names_in_words(where)}")
    return np.flatnonzero(kept)


def _equal_texts(values: Array, text: float | str, otherwise: str) -> Bools:
    """Return a mask of the cases with a text.

    Raises PlotError, with a message that starts with `otherwise`, if no case has it.
    """
    chosen = np.asarray(values == str(text))
    if not chosen.any():
        raise PlotError(f"{otherwise}; there is {names_in_words(dict.fromkeys(values))}")
    return chosen


def _nearest_numbers(values: Array, value: float | str, otherwise: str) -> Bools:
    """Return a mask of the cases nearest to a number.

    Raises PlotError, with a message that starts with `otherwise`, if it is outside all values.
    """
    try:
        number = float(value)
    except ValueError:
        number = np.nan
    low, high = values.min(), values.max()
    room = 1e-6 * (high - low)
    if not low - room <= number <= high + room:
        raise PlotError(f"{otherwise}; its values range from {low:g} to {high:g}")
    return np.asarray(values == values[np.abs(values - number).argmin()])


def parameter_values(sweep: SweepResult, name: str, parameter: str) -> Array:
    """Return the values of a parameter, (cases,).

    Raises PlotError if the sweep has no such parameter.
    """
    if parameter not in sweep.cases:
        raise PlotError(
            f"{name} has no parameter {parameter}; it has {names_in_words(sweep.cases)}"
        )
    return sweep.cases[parameter]


def names_in_words(names: Iterable[object]) -> str:
    """Join names with commas and `and`."""
    *most, last = map(str, names)
    return f"{', '.join(most)} and {last}" if most else last


def quantity_of(sweep: SweepResult, name: str, rows: Indices, quantity: str) -> DrawnVariable:
    """Return the quantity to show, with NaN for cases without a value; warn of these cases.

    The default is the velocity that was searched; without a search, the peak force.
    """
    quantity = quantity or ("found_velocity" if "found_velocity" in sweep.summary else "peak_force")
    names = [name for name in sweep.summary if name not in VERDICTS]
    if quantity not in names:
        alternatives = did_you_mean(quantity, names) or f"; the sweep has {names_in_words(names)}"
        raise PlotError(f"unknown quantity {quantity}{alternatives}")
    fine = sweep.completed[rows]
    values = np.where(fine, sweep[quantity][rows].astype(float), np.nan)
    _warn_of_gaps(sweep, name, rows, quantity, np.isnan(values))
    return variable_of(sweep, quantity, values)


def _warn_of_gaps(
    sweep: SweepResult, name: str, rows: Indices, quantity: str, lacking: Bools
) -> None:
    """Warn of cases that lack a quantity, by reason.

    Raises PlotError if all cases lack it.
    """
    fine = sweep.completed[rows]
    open_ends = ended(sweep, rows)
    still = next(iter(open_ends.values()), np.zeros_like(fine))
    of_all = f"of {len(rows)} cases of {name}"
    what = f"were {STILL}" if STILL in open_ends else "ended before their contact was over"
    text_of_open = f"{still.sum()} {of_all} {what}"
    failures = ""
    if not fine.all():
        failures = f"{(~fine).sum()} {of_all} failed ({reasons(sweep['status'][rows][~fine])})"

    if lacking.all():
        nothing = f"no case of {name} has a {quantity}"
        if still.any():
            raise PlotError(f"{nothing}: {text_of_open}; a deck with a longer duration may show it")
        raise PlotError(failures or f"{nothing}: there was no contact")
    if failures:
        warn(f"{failures}; they are gaps in the picture")
    if still.any():
        gaps = "; they have no value in the picture" if lacking[still].any() else ""
        warn(f"{text_of_open}{gaps}")
    without_contact = int((lacking & fine & ~still).sum())
    if without_contact:
        warn(f"{without_contact} cases of {name} without contact have no {quantity}")


def beyond(sweep: SweepResult, rows: Indices) -> dict[str, Bools]:
    """Return masks of the cases beyond the range of the model, by reason."""
    elsewhere = (PEAK_NOT_REACHED, THRESHOLD.doubt)  # these have their own mark and line
    masks = counted(sweep.validity[rows])
    return {doubt.case: mask for doubt, mask in masks if doubt not in elsewhere}


def ended(sweep: SweepResult, rows: Indices) -> dict[str, Bools]:
    """Return masks of the cases whose contact is not over, by reason."""
    mask = sweep.completed[rows] & ~sweep.contact_over[rows]
    what = STILL if np.array_equal(mask, sweep.still_in_contact[rows]) else ENDED
    return {what: mask} if mask.any() else {}


def case_counts(masks: Mapping[str, Bools], sign: str = "") -> list[str]:
    """Return lines for the footer of a picture that count the cases by reason."""
    return [f"{sign}{what}: {mask.sum()} of {len(mask)} cases" for what, mask in masks.items()]
