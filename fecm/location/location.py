"""Location: the place and the force of an impact from strain gages, and its file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._arrays import read_only
from fecm._errors import FecmError, OptionsError, ResultFileError
from fecm._measured_tables import IN_MEMORY, Record
from fecm._table import Row, Summary, Table, html_of
from fecm._text import FITTED_DIGITS
from fecm._typing import AnyFile, Bools, Floats
from fecm.deck.model import Deck
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.results import schema
from fecm.results.groups import NotStoredError
from fecm.results.pictures import plot_results
from fecm.results.stored import deck_in
from fecm.results.written import Reported, Saved

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fecm.results.hdf5_reader import FileContents


class LocateError(FecmError):
    """The strains do not determine the place of the impact."""

    exit_code = 1


# Paths of the datasets, by attribute of a location.
PATHS = {
    "place": "locate/place",
    "covariance": "locate/covariance",
    "candidates": "locate/candidates",
    "candidate_misfit": "locate/misfit",
    "time": "locate/force/time",
    "force": "locate/force/value",
    "force_sd": "locate/force/sd",
    "determined": "locate/force/determined",
    "gages": "locate/gages/number",
    "gage_places": "locate/gages/place",
    "gains": "locate/gages/gain",
    "sd_gains": "locate/gages/gain_sd",
    "strain_time": "locate/strains/time",
    "strains": "locate/strains/measured",
    "fitted": "locate/strains/fitted",
}
BY_TIME = ("strains", "fitted")  # arrays that are transposed in the file, to (points, gages)
# Physical dimensions of the attributes; pure numbers have no entry.
DIMENSIONS = {
    **{name: schema.LOCATION_DATASETS[path].dimension for name, path in PATHS.items()},
    **dict.fromkeys(("x", "y", "sd_x", "sd_y", "mesh_error"), "length"),
    **dict.fromkeys(("peak_force", "sd_peak_force", "peak_bias"), "force"),
    **dict.fromkeys(("impulse", "sd_impulse"), "force*time"),
    **dict.fromkeys(("time_of_peak", "contact_end", "determined_until"), "time"),
    **dict.fromkeys(("shift", "sd_shift"), "time"),
    "energy_bound": "force*length",
    "mass": "force*time^2/length",
}
POINTS = 181  # points of an ellipse
BIASED = 0.1  # bias of a peak, over its standard deviation, above which it is shown
# Attributes of the group of the force, attributes that may be missing, and attributes of the group
# of the place.  The end of the contact is missing if the contact has not ended, errors in files of
# fecm 1.
OF_FORCE = ("determined_until", "peak_force", "time_of_peak", "impulse")
OPTIONAL = ("contact_end", "sd_peak_force", "peak_bias", "sd_impulse")
OF_PLACE = (
    *("x", "y", "sd_x", "sd_y", "correlation", "noise", "misfit", "shift", "sd_shift"),
    *("mass", "energy_bound", "mesh_error"),
)
IN_JSON = (
    *("x", "y", "sd_x", "sd_y", "correlation", "peak_force", "time_of_peak", "contact_end"),
    *("sd_peak_force", "peak_bias", "impulse", "sd_impulse", "mesh_error", "mass"),
    *("energy_bound", "determined_until", "noise", "noise_given", "misfit", "shift", "sd_shift"),
    "accepted",
)


class Candidate(NamedTuple):
    """Place with the ratio of its misfit to the misfit of the located place."""

    x: float
    y: float
    ratio: float


@dataclass(frozen=True, eq=False)
class Location(Saved, Reported):
    """Place and force history of an impact, located from strain gages.

    Standard deviations have two parts. The first is the Cramér-Rao bound for independent errors of
    the strains with the standard deviation `noise`, times `misfit` if it is above 1. The second is
    the error of the mesh, from the strains of elements half as long. Other errors of the model come
    in addition.

    Attributes
    ----------
    x, y : float
        Place of the impact.
    covariance : ndarray (2, 2)
        Covariance of x and y.
    time, force, force_sd : ndarray (hats,)
        Times of the peaks of the hats, and the force and its standard deviation at these times. The
        force is linear between them, and 0 one interval before the first.
    determined : ndarray (hats,) of bool
        Whether the strains determine the force. At the end of the record it has hardly reached a
        gage; `force` is 0 where it is not determined.
    determined_until : float
        Last time at which the strains determine the force.
    peak_force, time_of_peak : float
        Largest determined force, and its time.
    sd_peak_force, peak_bias : float or None
        Standard deviation of the peak force, and the mean excess of the largest noisy value over
        the true peak; None in files of older versions.
    contact_end : float or None
        Earliest end of the contact: for a third of the duration of the contact, the impulse after
        this time stays within three standard deviations. None if the record does not show an end.
    impulse, sd_impulse : float
        Time integral of the force until the end of the contact, or until the force is no longer
        determined, and its standard deviation (None in files of older versions).
    mesh_error : float or None
        Distance by which the strains of elements half as long move the place; None if it is
        unknown.
    mass : float or None
        Mass of the projectile; None if it was not given.
    candidates : ndarray (k, 2)
        Places at which the search starts.
    candidate_misfit : ndarray (k,)
        Misfits of the candidates over the least misfit.
    second : Candidate or None
        The second-best place, away from the first; None if no other candidate is a minimum.
    noise : float
        Standard deviation of a strain, given or estimated from the residual.
    noise_given : bool
        Whether `noise` was given.
    misfit : float
        Standard deviation of the residual over `noise`; 1 if `noise` is estimated from it.
    gages : ndarray (gages,)
        Numbers of the gages.
    gage_places : ndarray (gages, 2)
        Places of the gages.
    strain_time : ndarray (points,)
        Times of the measured strains.
    strains, fitted : ndarray (gages, points)
        Measured and fitted strains.
    shift, sd_shift : float
        Time at which the force may begin, and its standard deviation if it was fitted.
    gains, sd_gains : ndarray (gages,)
        Fitted gains of the gages over their geometric mean, and their standard deviations; 1 and 0
        if they were not fitted.
    notes : tuple of str
        Reasons to doubt the place or the force.
    accepted : bool
        Whether the strains determine the place, and the model describes the strains.
    deck : Deck
        The deck of the plate.
    record : Record
        Name and SHA-256 (`file`, `sha256`) of the file of the strains; empty texts for arrays, and
        in files of older versions.
    """

    x: float
    y: float
    covariance: Floats
    time: Floats
    force: Floats
    force_sd: Floats
    determined: Bools
    determined_until: float
    peak_force: float
    time_of_peak: float
    contact_end: float | None
    impulse: float
    mass: float | None
    candidates: Floats
    candidate_misfit: Floats
    second: Candidate | None
    noise: float
    noise_given: bool
    misfit: float
    gages: NDArray[np.int32]
    gage_places: Floats
    strain_time: Floats
    strains: Floats
    fitted: Floats
    shift: float
    sd_shift: float
    gains: Floats
    sd_gains: Floats
    notes: tuple[str, ...]
    accepted: bool
    deck: Deck = field(repr=False)
    sd_peak_force: float | None = None
    peak_bias: float | None = None
    sd_impulse: float | None = None
    mesh_error: float | None = None
    record: Record = IN_MEMORY

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                object.__setattr__(self, name, read_only(values))

    @property
    def title(self) -> str:
        """Title of the deck."""
        return self.deck.title

    @property
    def _name(self) -> str:
        return self.title or "the impact"

    @property
    def sd_x(self) -> float:
        """Standard deviation of x."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def sd_y(self) -> float:
        """Standard deviation of y."""
        return math.sqrt(self.covariance[1, 1])

    @property
    def correlation(self) -> float:
        """Correlation of x and y."""
        size = self.sd_x * self.sd_y
        return float(self.covariance[0, 1] / size) if size else 0.0

    @property
    def energy_bound(self) -> float | None:
        """Energy I^2/2m of a projectile of `mass` that the impulse I just stops.

        A projectile that rebounds had less energy; one that passes through had more. None if the
        mass is unknown.
        """
        return None if self.mass is None else self.impulse**2 / (2.0 * self.mass)

    @property
    def units(self) -> dict[str, str]:
        """Names of the units of length, force and time; empty if the deck names none."""
        return unit_names(self.deck)

    def unit(self, name: str) -> str:
        """Return the unit of an attribute; empty for a pure number, or if the deck names no units.

        Raises
        ------
        NotStoredError
            If there is no such attribute; a KeyError.
        """
        if name not in DIMENSIONS and not hasattr(self, name):
            raise NotStoredError(f"a location has no {name}")
        return unit_of(DIMENSIONS.get(name, ""), self.units)

    def ellipse(self, level: float = 0.95) -> Floats:
        """Return the confidence region of the place as a closed polygon, (points, 2).

        Parameters
        ----------
        level : float
            Probability, between 0 and 1, that the region contains the place.

        Raises
        ------
        OptionsError
            If `level` is not between 0 and 1.
        """
        if not 0.0 < level < 1.0:
            raise OptionsError(f"level is {level:g}; it must be between 0 and 1")
        squares, axes = np.linalg.eigh(self.covariance)
        # The squared distance in standard deviations has an exponential distribution with mean 2.
        reach = np.sqrt(-2.0 * math.log1p(-level) * np.maximum(squares, 0.0))
        angles = np.linspace(0.0, 2.0 * np.pi, POINTS)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        return np.asarray([self.x, self.y] + (circle * reach) @ axes.T)

    def plot(self, path: str | Path | None = None, *, overwrite: bool = False) -> Axes:
        """Draw the map of the misfit, the force, and measured and fitted strains.

        Parameters
        ----------
        path : str or Path, optional
            Picture to write: ``.png``, ``.svg`` or ``.pdf``.
        overwrite : bool
            Replace an existing file.

        Returns
        -------
        matplotlib.axes.Axes
            The map.

        Raises
        ------
        PlotError
            If the name has another suffix.
        FileExistsError
            If the file exists and may not be replaced.
        ImportError
            If matplotlib is not installed.
        """
        return plot_results("location", {"the impact": self}, path, None, overwrite=overwrite)

    def _write(self, path: Path, *, overwrite: bool) -> None:
        from fecm.results.hdf5_writer import result_writing  # h5py takes 60 ms to import

        attributes = {
            "locate": self._place_attributes(),
            "locate/force": self._known_attributes(*OF_FORCE, *OPTIONAL),
            "locate/strains": self.record._asdict() if self.record.file else {},
        }
        with result_writing(path, schema.Form.LOCATION, overwrite=overwrite) as sink:
            sink.attributes("", self._file_attributes())
            sink.deck(self.deck.to_text())
            for group in schema.FILES[schema.Form.LOCATION].groups:
                sink.attributes(group, attributes.get(group, {}))
            for name, place in PATHS.items():
                values = np.array([self.x, self.y]) if name == "place" else getattr(self, name)
                sink.store(place, values.T if name in BY_TIME else values)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as printed by ``fecm locate --format json``."""
        return {
            **{name: getattr(self, name) for name in IN_JSON},
            "second": None if self.second is None else self.second._asdict(),
            "record": self.record._asdict(),
            "gages": self.gages.tolist(),
            "gains": self.gains.tolist(),
            "sd_gains": self.sd_gains.tolist(),
            "units": self.units,
            "force": {
                "time": self.time.tolist(),
                "value": self.force.tolist(),
                "sd": self.force_sd.tolist(),
                "determined": self.determined.tolist(),
            },
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        return str(summary_of_location(self))

    def __repr__(self) -> str:
        verdict = "accepted" if self.accepted else "not accepted"
        return f"<fecm location at ({self.x:.4g}, {self.y:.4g}): {verdict}>"

    def _repr_html_(self) -> str:
        """Return answer, tables and notes, for notebooks."""
        return html_of(self, summary_of_location(self))

    def _file_attributes(self) -> dict[str, Any]:
        """Return the attributes of the file."""
        units = {f"unit_{name}": unit for name, unit in self.units.items()}
        heading = schema.heading(schema.Form.LOCATION, self.deck.title)
        return {**heading, "notes": list(self.notes), **units}

    def _place_attributes(self) -> dict[str, Any]:
        """Return the attributes of the place's group."""
        second = {} if self.second is None else self.second._asdict()
        return {
            **self._known_attributes(*OF_PLACE),
            **{f"second_{name}": value for name, value in second.items()},
            "noise_given": self.noise_given,
            "accepted": self.accepted,
        }

    def _known_attributes(self, *names: str) -> dict[str, Any]:
        """Return the attributes with these names, except those that are None."""
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}


def summary_of_location(location: Location) -> Summary:
    """Return place and peak force, groups of rows, and notes, in the deck's units."""
    groups = (
        Table(tuple(_place_rows(location)), title="Place"),
        Table(tuple(_force_rows(location)), title="Force"),
        Table(tuple(_record_rows(location)), title="Record"),
    )
    place = ", ".join(f"{axis} {_coordinate(location, axis)}" for axis in ("x", "y"))
    verdict = "" if location.accepted else "; not accepted"
    answer = f"Impact at {place}; peak force {_with_error(location, 'peak_force')}{verdict}"
    return Summary(location.deck.title or "(no title)", answer, groups, location.notes)


def _shown(location: Location, name: str, value: float) -> str:
    return quantity(value, location.unit(name), FITTED_DIGITS)


def _coordinate(location: Location, axis: str) -> str:
    """Format x or y of the place with its standard deviation."""
    value, deviation = getattr(location, axis), getattr(location, f"sd_{axis}")
    return f"{value:.5g} ± {deviation:.2g} {location.unit(axis)}".rstrip()


def _place_rows(location: Location) -> Iterator[Row]:
    """Yield rows about the place, the mesh and other places."""
    for axis in ("x", "y"):
        yield (axis, _coordinate(location, axis))
    yield ("correlation", f"{location.correlation:.2f}")
    yield ("second place", _second_place(location))
    yield ("mesh", _mesh_effect(location))
    yield ("accepted", "yes" if location.accepted else "no")


def _force_rows(location: Location) -> Iterator[Row]:
    """Yield rows about the force, its impulse, and the energy of the projectile."""
    when = _shown(location, "time", location.time_of_peak)
    yield ("peak force", f"{_with_error(location, 'peak_force')} at {when}")
    bias = location.peak_bias
    if bias is not None and bias > BIASED * (location.sd_peak_force or 0.0):
        text = quantity(bias, location.unit("peak_bias"), 2)
        yield ("", f"the largest of noisy values, too high by about {text}")
    until = f"until {_shown(location, 'time', _impulse_end(location))}"
    yield ("impulse", f"{_with_error(location, 'impulse')} {until}")
    yield ("contact", f"{until} at least")
    if location.energy_bound is not None:
        bound = _shown(location, "energy_bound", location.energy_bound)
        least = _shown(location, "energy_bound", 0.25 * location.energy_bound)
        yield (
            "energy bound",
            f"{bound} would be stopped by this impulse; a projectile that rebounds had less (down "
            f"to {least}), one that moves on had more",
        )


def _record_rows(location: Location) -> Iterator[Row]:
    """Yield rows about noise and misfit, and about corrections of the record."""
    noise, misfit = "from the residual", "1, as the noise is taken from the residual"
    if location.noise_given:
        noise, misfit = "as given", f"{location.misfit:.3g} times the noise"
    yield ("noise", f"strain {location.noise:.3g}, {noise}")
    yield ("misfit", misfit)
    yield ("determined until", _shown(location, "time", location.determined_until))
    if location.sd_shift:
        size = f"{location.shift:.4g} ± {location.sd_shift:.2g} {location.unit('shift')}"
        yield ("shift", size)
    if location.sd_gains.any():
        gains = zip(location.gages.tolist(), location.gains, location.sd_gains, strict=True)
        for number, gain, deviation in gains:
            yield (f"gain of gage {number}", f"{gain:.4f} ± {deviation:.2g}")
    if location.record.file:
        yield ("record", str(location.record))


def _mesh_effect(location: Location) -> str:
    """Describe how far a finer mesh moves the place."""
    if location.mesh_error is None:
        return "its error is unknown"
    moved = quantity(location.mesh_error, location.unit("mesh_error"), 2)
    return f"elements half as long move the place by {moved}"


def _with_error(location: Location, name: str) -> str:
    """Format a value with its standard deviation, if this is known."""
    error = getattr(location, f"sd_{name}")
    spread = "" if error is None else f" ± {error:.2g}"
    return f"{getattr(location, name):.5g}{spread} {location.unit(name)}".rstrip()


def _impulse_end(location: Location) -> float:
    """Return the time until which the force is integrated."""
    return location.determined_until if location.contact_end is None else location.contact_end


def _second_place(location: Location) -> str:
    """Describe the second-best place."""
    if location.second is None:
        return "none: the misfit has one minimum"
    x, y, ratio = location.second
    return (
        f"{x:.4g}, {y:.4g} {location.unit('x')}".rstrip() + f", misfit {ratio:.3g} times as large"
    )


def load_location(path: str | Path | AnyFile) -> Location:
    """Read a location written by ``fecm locate -o`` or :meth:`Location.save`.

    Parameters
    ----------
    path : str, Path or file
        HDF5 file, or a file that is open as bytes.

    Raises
    ------
    ResultFileError
        If the file is not a location, or damaged.
    OSError
        If it can't be opened.
    """
    from fecm.results.hdf5_reader import read  # h5py takes 60 ms to import

    return location_of(read(path, schema.Form.LOCATION))


def location_of(contents: FileContents) -> Location:
    """Create a location from the contents of its file.

    Raises ResultFileError if the contents are incomplete.
    """
    try:
        arrays = _arrays(contents)
        place, force = (contents.groups[name] for name in ("locate", "locate/force"))
        strains = contents.groups.get("locate/strains", {})
        names = [f"second_{name}" for name in Candidate._fields]
        second = Candidate(*(_number(place, n) for n in names)) if names[0] in place else None
        notes = contents.attributes.get("notes", ())
        location = Location(
            **{name: values for name, values in arrays.items() if name != "place"},
            x=float(arrays["place"][0]),
            y=float(arrays["place"][1]),
            **{name: _number(force, name) for name in OF_FORCE},
            **_optional(force, OPTIONAL),
            **_optional(place, ("mass", "mesh_error")),
            second=second,
            **{name: _number(place, name) for name in ("noise", "misfit", "shift", "sd_shift")},
            noise_given=bool(place["noise_given"]),
            accepted=bool(place["accepted"]),
            notes=tuple(map(str, notes)) if isinstance(notes, list) else (),
            deck=deck_in(contents.texts.get("deck", "")),
            record=Record(*(str(strains.get(name, "")) for name in Record._fields)),
        )
    except (KeyError, ValueError, TypeError) as error:
        raise ResultFileError(f"{contents.path}: the location is incomplete ({error})") from None
    return location


def _arrays(contents: FileContents) -> dict[str, Any]:
    """Return the arrays of a location, by attribute.

    Raises KeyError if an array is missing, ValueError if it is wrong.
    """
    from fecm.results.hdf5_reader import first_misfit  # h5py takes 60 ms to import

    arrays = {name: contents[path] for name, path in PATHS.items()}
    if misfit := first_misfit(contents, PATHS.values(), ndm=2):
        raise ValueError(misfit.path)
    for name, path in PATHS.items():
        if not arrays[name].size:
            raise ValueError(path)
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{path} is not finite")
    arrays |= {name: arrays[name].T for name in BY_TIME}
    arrays["determined"] = arrays["determined"] != 0
    return arrays


def _optional(attributes: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Return the named attributes as finite floats; None where an attribute is missing."""
    return {name: _number(attributes, name) if name in attributes else None for name in names}


def _number(attributes: Mapping[str, Any], name: str) -> Any:
    """Return an attribute as a float.

    Raises ValueError if it is not finite.
    """
    value = float(attributes[name])
    if not math.isfinite(value):
        raise ValueError(name)
    return value
