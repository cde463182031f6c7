"""Locations in HDF5 files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._files import ARGUMENT, check_outputs
from fecm._typing import Array
from fecm._version import __version__
from fecm.location.location import Candidate, Location
from fecm.results import schema
from fecm.results.errors import ResultFileError
from fecm.results.schema import Dataset
from fecm.results.stored import deck_in

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents

GROUPS = {
    "locate": "place of the impact",
    "locate/force": "fitted force at the peaks of its hats",
    "locate/gages": "gages whose strains were fitted",
    "locate/strains": "measured and fitted strains",
}
# Datasets by the attribute of a location.
DATASETS = {
    "place": Dataset("locate/place", ("ndm",), "place of the impact", "length"),
    "covariance": Dataset("locate/covariance", (2, 2), "covariance of the place", "length^2"),
    "candidates": Dataset(
        "locate/candidates", ("candidates", "ndm"), "places that were tried first", "length"
    ),
    "candidate_misfit": Dataset(
        "locate/misfit", ("candidates",), "misfit there over that of the place found"
    ),
    "time": Dataset("locate/force/time", ("rows",), "time", "time"),
    "force": Dataset("locate/force/value", ("rows",), "fitted contact force", "force"),
    "force_sd": Dataset("locate/force/sd", ("rows",), "its standard deviation", "force"),
    "determined": Dataset(
        "locate/force/determined", ("rows",), "1 if the strains determine the force", "", "i1"
    ),
    "gages": Dataset("locate/gages/number", ("gages",), "number of every gage", "", "i4"),
    "gage_places": Dataset("locate/gages/place", ("gages", "ndm"), "its place", "length"),
    "gains": Dataset("locate/gages/gain", ("gages",), "its gain; 1 if it was not fitted"),
    "sd_gains": Dataset("locate/gages/gain_sd", ("gages",), "standard deviation of the gain"),
    "strain_time": Dataset("locate/strains/time", ("rows",), "measured time", "time"),
    "strains": Dataset("locate/strains/measured", ("rows", "gages"), "measured strain"),
    "fitted": Dataset("locate/strains/fitted", ("rows", "gages"), "fitted strain"),
}
BY_TIME = ("strains", "fitted")  # arrays with the gages first
# Numbers that are attributes of the group of the force, or of the place.
OF_FORCE = ("determined_until", "peak_force", "time_of_peak", "contact_end", "impulse")
OF_PLACE = ("x", "y", "sd_x", "sd_y", "correlation", "noise", "misfit", "shift", "sd_shift")


def save(found: Location, path: Path, *, overwrite: bool, allowed_by: str = ARGUMENT) -> None:
    """Write a location; see :meth:`Location.save`."""
    from fecm.results.hdf5_writer import writing  # h5py takes 60 ms to import

    check_outputs([path], overwrite, allowed_by=allowed_by)
    about = {
        "format": schema.Form.LOCATION.value,
        "format_version": schema.FORMAT_VERSION,
        "fecm_version": __version__,
        "title": found.deck.title,
        "notes": list(found.notes),
    }
    units = {f"unit_{name}": unit for name, unit in found.units.items()}
    with writing(path, overwrite=overwrite) as sink:
        sink.attributes("", about | units)
        sink.text("deck", found.deck.to_text(), "the cards of the deck of the plate")
        for group, text in GROUPS.items():
            sink.attributes(group, {"description": text})
        sink.attributes("locate", _about_place(found))
        sink.attributes("locate/force", _present(found, OF_FORCE))
        for name, dataset in DATASETS.items():
            values = np.array([found.x, found.y]) if name == "place" else getattr(found, name)
            values = values.T if name in BY_TIME else values
            sink.create(dataset, values.shape)
            sink.write(dataset.path, 0, values)


def _about_place(found: Location) -> dict[str, Any]:
    """Attributes of the group of the place."""
    second = found.second
    rival = {} if second is None else {f"second_{n}": v for n, v in second._asdict().items()}
    verdict = {"noise_given": found.noise_given, "accepted": found.accepted}
    return {**_present(found, (*OF_PLACE, "mass", "energy_bound")), **rival, **verdict}


def _present(found: Location, names: tuple[str, ...]) -> dict[str, Any]:
    """Attributes of a location that it has."""
    values = {name: getattr(found, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def load(path: str | Path) -> Location:
    """Read a location that ``fecm locate -o`` or :meth:`Location.save` wrote.

    Parameters
    ----------
    path : str or Path
        HDF5 file.

    Raises
    ------
    ResultFileError
        If the file is not a location, or damaged.
    OSError
        If it can't be opened.
    """
    from fecm.results.hdf5_reader import read  # h5py takes 60 ms to import

    return location_of(read(Path(path), schema.Form.LOCATION))


def location_of(contents: Contents) -> Location:
    """Create a location from the contents of its file; ResultFileError if it is incomplete."""
    try:
        arrays = _arrays(contents)
        place, force = (contents.groups[name] for name in ("locate", "locate/force"))
        names = [f"second_{name}" for name in Candidate._fields]
        second = Candidate(*(_number(place, n) for n in names)) if names[0] in place else None
        notes = contents.attributes.get("notes", ())
        made = Location(
            **{name: values for name, values in arrays.items() if name != "place"},
            x=float(arrays["place"][0]),
            y=float(arrays["place"][1]),
            **{name: _number(force, name) for name in OF_FORCE if name != "contact_end"},
            contact_end=_number(force, "contact_end") if "contact_end" in force else None,
            mass=_number(place, "mass") if "mass" in place else None,
            second=second,
            **{name: _number(place, name) for name in ("noise", "misfit", "shift", "sd_shift")},
            noise_given=bool(place["noise_given"]),
            accepted=bool(place["accepted"]),
            notes=tuple(map(str, notes)) if isinstance(notes, list) else (),
            deck=deck_in(contents.texts.get("deck", "")),
        )
    except (KeyError, ValueError, TypeError) as error:
        raise ResultFileError(f"{contents.path}: the location is incomplete ({error})") from None
    return made


def _arrays(contents: Contents) -> dict[str, Any]:
    """Arrays by the attribute of a location; KeyError or ValueError if one is missing or wrong."""
    sizes: dict[object, int] = {"ndm": 2, 2: 2}
    arrays: dict[str, Any] = {}
    for name, dataset in DATASETS.items():
        values: Array = contents[dataset.path]
        kinds = "iu" if dataset.dtype.startswith("i") else "f"
        axes = [(dataset.group, axis) if axis == "rows" else axis for axis in dataset.shape]
        fits = values.ndim == len(axes) and all(
            sizes.setdefault(axis, size) == size
            for axis, size in zip(axes, values.shape, strict=False)
        )
        if not fits or not values.size or values.dtype.kind not in kinds:
            raise ValueError(dataset.path)
        if not np.isfinite(values).all():
            raise ValueError(f"{dataset.path} is not finite")
        arrays[name] = values.T if name in BY_TIME else values
    arrays["determined"] = arrays["determined"] != 0
    return arrays


def _number(attributes: Mapping[str, Any], name: str) -> Any:
    """A finite float among attributes; ValueError if it is none."""
    value = float(attributes[name])
    if not math.isfinite(value):
        raise ValueError(name)
    return value
