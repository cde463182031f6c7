"""What a map shows of a sweep: its cases, what they vary, their numbers, scaled and named."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm.plot.kinds import PlotError, PlotNote
from fecm.plot.pictures import Options
from fecm.plot.style import COLOURS, Scale, scale
from fecm.sweeps.cases import INTEGERS as WHOLE_VALUES
from fecm.sweeps.cases import TEXTS
from fecm.sweeps.outcome import INTEGERS as WHOLE_NUMBERS
from fecm.sweeps.outcome import RUN, STILL, SUMMARY
from fecm.sweeps.result import SweepResult

Array = NDArray[Any]
Ints = NDArray[np.intp]

INTEGERS = (*WHOLE_VALUES, *WHOLE_NUMBERS)
# Texts that get a curve each; there are as many colours.
CURVES = len(COLOURS)
LABELS = {
    "velocity": "Impact velocity", "k": "Contact coefficient $k$", "alpha_p": r"$\alpha_p$",
    "s_p": "$s_p$", "q": "$q$", "rod_length": "Length of the rod",
    "rod_modulus": "Modulus of the rod", "rod_density": "Density of the rod",
    "rod_mass": "Mass of the projectile", "nu12": r"$\nu_{12}$", "e1": "$E_1$", "e2": "$E_2$",
    "g12": "$G_{12}$", "g13": "$G_{13}$", "g23": "$G_{23}$", "dt": "Time step",
    "max_indentation": "Largest indentation",
}  # fmt: skip


@dataclass(frozen=True)
class Axis:
    """What an axis or the colours show.

    Attributes
    ----------
    name : str
    scale : Scale
    values : ndarray (cases,)
        Scaled numbers; of texts the rows of `ticks`.
    ticks : tuple of str
        Texts in the order of the cases; none for numbers.
    """

    name: str
    scale: Scale
    values: Array
    ticks: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Text of the axis."""
        plain = self.name.replace("_", " ").capitalize()
        return self.scale.label(LABELS.get(self.name, plain))

    @property
    def whole(self) -> bool:
        """Whether the numbers count something."""
        return self.name in INTEGERS


@dataclass(frozen=True)
class Choice:
    """What a map shows.

    Attributes
    ----------
    over : list of Axis
        One or two.
    shown : Axis
        NaN where a case has no such number.
    levels : list of float
        Values to mark, scaled.
    title : str
        What picks the cases; empty for all of them.
    other : Axis or None
        The one other value in which the cases of a map over one value differ.
    still : ndarray (cases,) of bool
        Which cases ended while the projectile was on the plate.
    """

    over: list[Axis]
    shown: Axis
    levels: list[float]
    title: str
    other: Axis | None
    still: NDArray[np.bool_]


def choose(sweep: SweepResult, name: str, options: Options) -> Choice:
    """Take from a sweep what a map shows; cases without a number are told as warnings.

    Raises
    ------
    PlotError
        If the options don't fit the sweep, or nothing is left to show.
    """
    rows = _rows(sweep, name, options.where)
    over = [_axis(sweep, parameter, rows) for parameter in _over(sweep, name, rows, options)]
    if len(over) > 1:
        _check_crossings(sweep, rows, over)
    shown = _quantity(sweep, name, rows, options.quantity)
    told = (f"{other} {_text(sweep, other, rows[0])}" for other in options.where)
    others = [n for n in _varying(sweep, rows) if n not in [axis.name for axis in over]]
    other = _axis(sweep, others[0], rows) if others and len(over) == 1 else None
    if len(over) == 1 and (len(others) > 1 or (other is not None and len(other.ticks) > CURVES)):
        raise PlotError(
            f"{_told(others)} {'varies' if len(others) == 1 else 'vary'} too; --where "
            f"{others[0]}=VALUE picks some of the cases, --over {over[0].name},{others[0]} draws "
            "over both"
        )
    still = sweep["status"][rows] == STILL
    return Choice(over, shown, _levels(options, shown), ", ".join(told), other, still)


def _rows(sweep: SweepResult, name: str, where: Mapping[str, Any]) -> Ints:
    """Cases at given values; of numbers the nearest ones that there are."""
    kept = np.ones(len(sweep), dtype=bool)
    for parameter, wanted in where.items():
        values = _values(sweep, name, parameter)
        if parameter in TEXTS:
            chosen = values == str(wanted)
            if not chosen.any():
                raise PlotError(
                    f"{name} has no {parameter} {wanted}; there is {_told(dict.fromkeys(values))}"
                )
        else:
            try:
                number = float(wanted)
            except ValueError:
                number = np.nan
            low, high = values.min(), values.max()
            room = 1e-6 * (high - low)
            if not low - room <= number <= high + room:
                raise PlotError(
                    f"{name} has no {parameter} {wanted}; its values reach from {low:g} to {high:g}"
                )
            chosen = values == values[np.abs(values - number).argmin()]
        kept &= chosen
    if not kept.any():
        raise PlotError(f"{name} has no case where all of {_told(where)} are as given")
    return np.flatnonzero(kept)


def _values(sweep: SweepResult, name: str, parameter: str) -> Array:
    if parameter not in sweep.cases:
        raise PlotError(f"{parameter} is not among what {name} varies: {_told(sweep.cases)}")
    return sweep.cases[parameter]


def _told(names: Any) -> str:
    *most, last = map(str, names)
    return f"{', '.join(most)} and {last}" if most else last


def _text(sweep: SweepResult, name: str, row: int) -> str:
    """A value in a title."""
    value = sweep[name][row]
    if name in TEXTS:
        return str(value)
    return scale(abs(float(value)), _unit(sweep, name)).show(float(value))


def _varying(sweep: SweepResult, rows: Ints) -> list[str]:
    return [name for name, values in sweep.cases.items() if len(np.unique(values[rows])) > 1]


def _over(sweep: SweepResult, name: str, rows: Ints, options: Options) -> list[str]:
    """One or two names of what the picture is over."""
    varying = _varying(sweep, rows)
    for parameter in options.over:
        if parameter not in varying and len(_values(sweep, name, parameter)):
            raise PlotError(
                f"{parameter} is the same in all of the cases; a map is over what varies"
            )
    over = list(dict.fromkeys(options.over)) or varying
    if not over:
        raise PlotError(f"nothing varies in {name}: all its cases are the same")
    if len(over) > 2:
        raise PlotError(
            f"{_told(over)} are {len(over)} values to draw over; --over NAME or NAME,NAME says "
            "which"
        )
    return over


def _quantity(sweep: SweepResult, name: str, rows: Ints, quantity: str) -> Axis:
    """The numbers to show, with a note of cases that have none."""
    if quantity not in SUMMARY:
        raise PlotError(f"there is no quantity {quantity}; there is {_told(SUMMARY)}")
    status, values = sweep["status"][rows], sweep[quantity][rows].astype(float)
    run, still = np.isin(status, RUN), status == STILL
    values = np.where(run, values, np.nan)
    failed = Counter(status[~run].tolist()).most_common()
    told = ""
    if failed:
        more = f", and {len(failed) - 1} other reasons" if len(failed) > 1 else ""
        total = sum(count for _, count in failed)
        told = f"{total} of {len(rows)} cases of {name} failed ({failed[0][0]}{more})"
    open_ends = (
        f"{int(still.sum())} of {len(rows)} cases of {name} were still in contact at the end"
    )
    if np.isnan(values).all():
        nothing = f"no case of {name} has a {quantity}"
        if still.any():
            raise PlotError(f"{nothing}: {open_ends}; a deck with a longer duration may show it")
        raise PlotError(told or f"{nothing}: nothing was hit")
    if told:
        warnings.warn(f"{told}; they are gaps in the picture", PlotNote, stacklevel=2)
    if still.any():
        gaps = "; they have no value in the picture" if np.isnan(values[still]).any() else ""
        warnings.warn(f"{open_ends}{gaps}", stacklevel=2)
    if lacking := int((np.isnan(values) & run & ~still).sum()):
        warnings.warn(
            f"{lacking} cases of {name} without contact have no {quantity}", PlotNote, stacklevel=2
        )
    if quantity in INTEGERS:
        return Axis(quantity, Scale(1.0, ""), values)
    shown = scale(float(np.nanmax(np.abs(values))), _unit(sweep, quantity))
    return Axis(quantity, shown, shown.factor * values)


def _unit(sweep: SweepResult, name: str) -> str:
    """A unit whose powers are raised."""
    raised = str.maketrans("0123456789.", "⁰¹²³⁴⁵⁶⁷⁸⁹·")
    return re.sub(r"\^([\d.]+)", lambda power: power[1].translate(raised), sweep.unit(name))


def _axis(sweep: SweepResult, name: str, rows: Ints) -> Axis:
    values = sweep[name][rows]
    if name in TEXTS:
        ticks = tuple(dict.fromkeys(values.tolist()))
        places = {text: place for place, text in enumerate(ticks)}
        return Axis(name, Scale(1.0, ""), np.array([places[v] for v in values.tolist()]), ticks)
    if name in INTEGERS:
        return Axis(name, Scale(1.0, ""), values)
    shown = scale(float(np.abs(values).max()), _unit(sweep, name))
    return Axis(name, shown, shown.factor * values)


def _levels(options: Options, shown: Axis) -> list[float]:
    """Scaled values to mark, with a note of those that no case comes near."""
    low, high = np.nanmin(shown.values), np.nanmax(shown.values)
    for level in options.level:
        if not low <= shown.scale.factor * level <= high:
            warnings.warn(
                f"the level {level:g} is outside of the picture's values, which reach from "
                f"{low / shown.scale.factor:g} to {high / shown.scale.factor:g}",
                PlotNote,
                stacklevel=2,
            )
    return [shown.scale.factor * level for level in options.level]


def _check_crossings(sweep: SweepResult, rows: Ints, axes: list[Axis]) -> None:
    """Refuse cases that hide one another, as they differ in what is not shown."""
    others = [n for n in _varying(sweep, rows) if n not in [axis.name for axis in axes]]
    points = np.column_stack([axis.values for axis in axes])
    if others and len(np.unique(points, axis=0)) < len(points):
        raise PlotError(
            f"{_told(others)} {'varies' if len(others) == 1 else 'vary'} too, so that cases would "
            f"hide one another; --where {others[0]}=VALUE picks some of them"
        )
