"""Reads locations from HDF5 files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._typing import AnyFile, Array
from fecm.location.location import OF_FORCE, OPTIONAL, Candidate, Location
from fecm.location.writer import BY_TIME, DATASETS
from fecm.results import schema
from fecm.results.errors import ResultFileError
from fecm.results.stored import deck_in

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents


def load(path: str | Path | AnyFile) -> Location:
    """Read a location that ``fecm locate -o`` or :meth:`Location.save` wrote.

    Parameters
    ----------
    path : str, Path or file
        HDF5 file, or one that is open as bytes.

    Raises
    ------
    ResultFileError
        If the file is not a location, or damaged.
    OSError
        If it can't be opened.
    """
    from fecm.results.hdf5_reader import read  # h5py takes 60 ms to import

    return location_of(read(path, schema.Form.LOCATION))


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
            **{name: _number(force, name) for name in OF_FORCE},
            **_optional(force, OPTIONAL),
            **_optional(place, ("mass", "mesh_error")),
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


def _optional(attributes: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Finite floats among attributes by name, None for those that are missing."""
    return {name: _number(attributes, name) if name in attributes else None for name in names}


def _number(attributes: Mapping[str, Any], name: str) -> Any:
    """A finite float among attributes; ValueError if it is none."""
    value = float(attributes[name])
    if not math.isfinite(value):
        raise ValueError(name)
    return value
