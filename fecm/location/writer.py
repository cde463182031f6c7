"""Writes locations into HDF5 files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fecm._files import ARGUMENT, check_outputs
from fecm._typing import Array
from fecm._version import __version__
from fecm.results import schema
from fecm.results.schema import Dataset

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


def save(
    path: Path,
    arrays: Mapping[str, Array],
    attributes: Mapping[str, Mapping[str, Any]],
    deck_text: str,
    *,
    overwrite: bool,
) -> None:
    """Write the arrays of a location, by its attributes, and the attributes of groups.

    Those of the file itself are under ``""``.
    """
    from fecm.results.hdf5_writer import writing  # h5py takes 60 ms to import

    check_outputs([path], overwrite, allowed_by=ARGUMENT)
    about = {
        "format": schema.Form.LOCATION.value,
        "format_version": schema.FORMAT_VERSION,
        "fecm_version": __version__,
    }
    with writing(path, overwrite=overwrite) as sink:
        sink.attributes("", about | dict(attributes[""]))
        sink.text("deck", deck_text, "the cards of the deck of the plate")
        for group, text in GROUPS.items():
            sink.attributes(group, {"description": text, **attributes.get(group, {})})
        for name, dataset in DATASETS.items():
            values = arrays[name].T if name in BY_TIME else arrays[name]
            sink.create(dataset, values.shape)
            sink.write(dataset.path, 0, values)
