"""Data of a map: cases of a sweep, their parameters and a quantity, scaled and named."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._errors import warn
from fecm._frozen import frozen
from fecm.plot.kinds import PlotError
from fecm.plot.style import COLOURS, Scale, peak, scale
from fecm.results.metrics import COLUMNS
from fecm.results.metrics import INTEGERS as WHOLE_NUMBERS
from fecm.sweeps.cases import INTEGERS as WHOLE_VALUES
from fecm.sweeps.cases import NAMES
from fecm.sweeps.outcome import RUN, STILL
from fecm.sweeps.result import SweepResult, reasons

Array = NDArray[Any]
Ints = NDArray[np.intp]

INTEGERS = (*WHOLE_VALUES, *WHOLE_NUMBERS)
CURVES = len(COLOURS)  # most texts with one curve each
LABELS = {
    "velocity": "Impact velocity", "k": "Contact coefficient $k$", "alpha_p": r"$\alpha_p$",
    "s_p": "$s_p$", "q": "$q$", "rod_length": "Length of the rod",
    "rod_modulus": "Modulus of the rod", "rod_density": "Density of the rod",
    "mass": "Mass of the projectile", "rod_mass": "Mass of the projectile",
    "energy": "Impact energy", "radius": "Radius of the sphere", "at": "Impact point",
    "angle": "Angle added (°)", "nu12": r"$\nu_{12}$", "e1": "$E_1$", "e2": "$E_2$",
    "g12": "$G_{12}$", "g13": "$G_{13}$", "g23": "$G_{23}$", "dt": "Time step",
    "patch": "Radius of the patch", "x0": "$x_0$", "y0": "$y_0$",
    "max_indentation": "Largest indentation",
}  # fmt: skip


@frozen
class Axis:
    """A parameter or quantity, shown by an axis or by colours."""

    name: str
    scale: Scale
    values: Array  # (cases,): numbers; for texts their positions in `ticks`
    ticks: tuple[str, ...] = ()  # texts in the order of the cases; empty for numbers

    @property
    def label(self) -> str:
        """Name in words."""
        plain = self.name.replace("_", " ")
        own = self.name not in (*COLUMNS, *NAMES)  # the caller's symbol or word
        return LABELS.get(self.name, plain if own else plain.capitalize())

    @property
    def whole(self) -> bool:
        """Whether the numbers are counts."""
        return self.name in INTEGERS


@frozen
class Choice:
    """Contents of a map."""

    over: list[Axis]  # one or two
    shown: Axis  # quantity; NaN where a case has none
    levels: list[float]  # values to mark
    title: str  # values that select the cases; empty for all cases
    other: Axis | None  # second varying parameter of a map over one
    still: NDArray[np.bool_]  # (cases,): mask of the cases that ended in contact
    # (cases,): delamination thresholds, if they differ and peak forces are shown; else empty.
    limits: Array


def choose(
    sweep: SweepResult,
    name: str,
    quantity: str,
    over: Sequence[str],
    where: Mapping[str, Any],
    level: Sequence[float],
) -> Choice:
    """Select the contents of a map; warn of cases without a value.

    Raises PlotError if the options do not fit the sweep, or no case remains.
    """
    rows = case_rows(sweep, name, where)
    varying = [n for n, values in sweep.cases.items() if len(np.unique(values[rows])) > 1]
    axes = [_parameter(sweep, parameter, rows) for parameter in _over(sweep, name, varying, over)]
    others = [parameter for parameter in varying if parameter not in [axis.name for axis in axes]]
    other = _parameter(sweep, others[0], rows) if others and len(axes) == 1 else None
    if others:
        _check_others(axes, others, other)
    shown = quantity_of(sweep, name, rows, quantity)
    title = ", ".join(f"{held} {_text(sweep, held, rows[0])}" for held in where)
    still = sweep["status"][rows] == STILL
    limits = np.empty(0)
    if shown.name == "peak_force" and "threshold_force" in sweep.summary:
        limits = sweep["threshold_force"][rows]
        highest = float(np.nanmax(limits))
        if highest - np.nanmin(limits) <= 1e-9 * highest:
            level, limits = [*level, highest], np.empty(0)
    low, high = np.nanmin(shown.values), np.nanmax(shown.values)
    for value in level:
        if not low <= value <= high:
            warn(
                f"the level {value:g} is outside the picture's values, which range from {low:g} "
                f"to {high:g}"
            )
    return Choice(axes, shown, list(level), title, other, still, limits)


def case_rows(sweep: SweepResult, name: str, where: Mapping[str, Any]) -> Ints:
    """Cases at given values; numbers select the nearest value."""
    kept = np.ones(len(sweep), dtype=bool)
    for parameter, wanted in where.items():
        values = _values(sweep, name, parameter)
        if values.dtype.kind == "U":
            chosen = values == str(wanted)
            if not chosen.any():
                raise PlotError(
                    f"{name} has no {parameter} {wanted}; there is {_listed(dict.fromkeys(values))}"
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
                    f"{name} has no {parameter} {wanted}; its values range from {low:g} to {high:g}"
                )
            chosen = values == values[np.abs(values - number).argmin()]
        kept &= chosen
    if not kept.any():
        raise PlotError(f"{name} has no case with these values of {_listed(where)}")
    return np.flatnonzero(kept)


def _values(sweep: SweepResult, name: str, parameter: str) -> Array:
    if parameter not in sweep.cases:
        raise PlotError(f"{name} has no parameter {parameter}; it has {_listed(sweep.cases)}")
    return sweep.cases[parameter]


def _listed(names: Iterable[Any]) -> str:
    """Join names in words."""
    *most, last = map(str, names)
    return f"{', '.join(most)} and {last}" if most else last


def _text(sweep: SweepResult, name: str, row: int) -> str:
    """A value for a title."""
    value = sweep[name][row]
    if isinstance(value, str):
        return str(value)
    return scale(abs(float(value)), sweep.unit(name)).show(float(value))


def _over(sweep: SweepResult, name: str, varying: list[str], asked: Sequence[str]) -> list[str]:
    """One or two parameters of the axes."""
    for parameter in asked:
        if parameter not in varying and len(_values(sweep, name, parameter)):
            raise PlotError(f"{parameter} does not vary among the cases; a map needs one that does")
    over = list(dict.fromkeys(asked)) or varying
    if not over:
        raise PlotError(f"nothing varies in {name}: all cases are equal")
    if len(over) > 2:
        raise PlotError(
            f"a map has at most two axes, and {_listed(over)} vary; choose with --over NAME or "
            "NAME,NAME"
        )
    return over


def _check_others(axes: list[Axis], others: list[str], other: Axis | None) -> None:
    """Refuse parameters that vary and are not shown, if cases would hide one another."""
    vary = f"{_listed(others)} {'varies' if len(others) == 1 else 'vary'} too"
    selects = f"--where {others[0]}=VALUE selects some of"
    points = np.column_stack([axis.values for axis in axes])
    if len(axes) > 1 and len(np.unique(points, axis=0)) < len(points):
        raise PlotError(f"{vary}, so that cases would hide one another; {selects} them")
    if len(axes) == 1 and (len(others) > 1 or (other is not None and len(other.ticks) > CURVES)):
        raise PlotError(
            f"{vary}; {selects} the cases, --over {axes[0].name},{others[0]} draws over both"
        )


def quantity_of(sweep: SweepResult, name: str, rows: Ints, quantity: str) -> Axis:
    """The quantity to show, with a note about cases that lack it."""
    quantity = quantity or ("found_velocity" if "found_velocity" in sweep.summary else "peak_force")
    known = [name for name in sweep.summary if name != "status"]
    if quantity not in known:
        raise PlotError(f"unknown quantity {quantity}; the sweep has {_listed(known)}")
    status, values = sweep["status"][rows], sweep[quantity][rows].astype(float)
    run, still = np.isin(status, RUN), status == STILL
    values = np.where(run, values, np.nan)
    failures = ""
    if not run.all():
        failed = f"{(~run).sum()} of {len(rows)} cases of {name} failed"
        failures = f"{failed} ({reasons(status[~run])})"
    open_ends = f"{still.sum()} of {len(rows)} cases of {name} were still in contact at the end"
    if np.isnan(values).all():
        nothing = f"no case of {name} has a {quantity}"
        if still.any():
            raise PlotError(f"{nothing}: {open_ends}; a deck with a longer duration may show it")
        raise PlotError(failures or f"{nothing}: there was no contact")
    if failures:
        warn(f"{failures}; they are gaps in the picture")
    if still.any():
        gaps = "; they have no value in the picture" if np.isnan(values[still]).any() else ""
        warn(f"{open_ends}{gaps}")
    if lacking := int((np.isnan(values) & run & ~still).sum()):
        warn(f"{lacking} cases of {name} without contact have no {quantity}")
    return numbers(sweep, quantity, values)


def _parameter(sweep: SweepResult, name: str, rows: Ints) -> Axis:
    """Axis of a parameter."""
    values = sweep[name][rows]
    if values.dtype.kind != "U":
        return numbers(sweep, name, values)
    ticks = tuple(dict.fromkeys(values.tolist()))
    places = {text: place for place, text in enumerate(ticks)}
    return Axis(name, Scale(1.0, ""), np.array([places[v] for v in values.tolist()]), ticks)


def numbers(sweep: SweepResult, name: str, values: Array) -> Axis:
    """Axis of numbers; counts are not scaled."""
    shown = Scale(1.0, "") if name in INTEGERS else scale(peak(values), sweep.unit(name))
    return Axis(name, shown, values)
