"""Schema of a result file: path, shape, dimension and description of every dataset.

Shapes use the sizes of a run: ``rows`` of the group, ``numnp``, ``ndm``, ``ndf``,
``numel``, ``nen``, ``npt`` and ``nps`` (points per element in tape8 and stresses), ``gages``;
of ply stresses ``members`` (elements), ``npp`` (points per element), ``layers`` and :data:`FIXED`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from fecm._errors import FecmError
from fecm._frozen import frozen
from fecm.deck.records import AXES, DOF_NAMES
from fecm.mechanics.failure import CRITERIA


class ExportError(FecmError, ValueError):
    """A result lacks the data for an export, or the request is invalid."""


def printable(text: str) -> str:
    """Escape control characters and lone surrogates, giving one line for any terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: Any, width: int = 60, *, exact: bool = False) -> str:
    """Format a value in one short line; numbers to six digits, or exactly."""
    if isinstance(value, list | tuple):
        text = "[" + ", ".join(shown(item, width, exact=exact) for item in value) + "]"
    elif isinstance(value, float):
        text = repr(value) if exact else f"{value:.6g}"
    else:
        text = printable(str(value))
    return text if len(text) <= width else text[: width - 1] + "…"


def shown_apart(one: Any, other: Any, width: int = 60) -> tuple[str, str]:
    """Format two different values in short lines that show where they differ."""
    short = shown(one, width), shown(other, width)
    if short[0] != short[1]:
        return short
    whole = [shown(value, sys.maxsize, exact=True) for value in (one, other)]
    pairs = zip(*whole, strict=False)
    same = next((n for n, (a, b) in enumerate(pairs) if a != b), min(map(len, whole)))
    begin = max(0, same - width // 2)
    texts = [("…" if begin else "") + text[begin:] for text in whole]
    return shown(texts[0], width), shown(texts[1], width)


def suggestion(asked: str, paths: Iterable[str]) -> str:
    """End of a message about a missing dataset or group: similar names, or the groups."""
    import difflib

    known = sorted({name for path in paths for name in (path, path.rpartition("/")[0])} - {""})
    last_parts = [name.rpartition("/")[2] for name in known]
    close = difflib.get_close_matches(asked, last_parts, n=3) if "/" not in asked else []
    alike = [name for name, last in zip(known, last_parts, strict=True) if last in (asked, *close)]
    if alike := alike or difflib.get_close_matches(asked, known, n=3):
        return f"; did you mean {' or '.join(alike)}?"
    groups = sorted({name.partition("/")[0] for name in known})
    return f"; there are {', '.join(groups)}" if groups else ""


def jsonable(value: Any) -> Any:
    """Convert to a value that :func:`json.dumps` writes as valid JSON."""
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        return "NaN" if math.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    return str(value)


BLOCK = 4_000_000  # bytes of a block of rows


def row_blocks(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """First and last + 1 row of the blocks in which a dataset is read; a number is one row."""
    rows = shape[0] if shape else 1
    step = max(1, BLOCK // (8 * max(1, math.prod(shape[1:]))))
    for start in range(0, rows, step):
        yield start, min(start + step, rows)


FORMAT = "fecm"
SWEEP = "fecm-sweep"  # format of a sweep's result
FORMAT_VERSION = 1


class ResultFileError(FecmError, ValueError):
    """A file is not a readable result."""


class NotStoredError(AttributeError, KeyError, ResultFileError):
    """A result lacks a requested dataset."""

    def __str__(self) -> str:
        return str(self.args[0])


class ResultWriteError(FecmError, OSError):
    """A result can't be written."""


@frozen
class Dataset:
    """One dataset of a result."""

    path: str  # group and name
    shape: tuple[str | int, ...]  # sizes by name, or numbers
    description: str
    dimension: str = ""  # physical dimension; may be empty
    dtype: str = "f8"  # NumPy's name of the type

    @property
    def group(self) -> str:
        """Name of its group."""
        return self.path.rpartition("/")[0]

    @property
    def name(self) -> str:
        """Name in its group."""
        return self.path.rpartition("/")[2]


def _group(
    group: str, rows: tuple[str | int, ...], *columns: tuple[str, str, str]
) -> tuple[Dataset, ...]:
    """Datasets of equal shape: (name, description, dimension)."""
    return tuple(Dataset(f"{group}/{name}", rows, text, dim) for name, text, dim in columns)


def _clock(group: str) -> tuple[Dataset, ...]:
    return (
        Dataset(f"{group}/step", ("rows",), "number of time steps taken", dtype="i8"),
        Dataset(f"{group}/time", ("rows",), "time integrated up to the row's state", "time"),
    )


INTERLAMINAR = "failure/interlaminar"


def _exposures(group: str, shape: tuple[str | int, ...]) -> tuple[Dataset, ...]:
    return (
        Dataset(f"{group}/exposure", shape, "largest exposure over time"),
        Dataset(f"{group}/time", shape, "its time", "time"),
        Dataset(f"{group}/mode", shape, "its mode: index into the attribute modes", dtype="i1"),
    )


_CONTACT = (
    ("force", "contact force, positive in compression", "force"),
    ("indentation", "indentation of the plate by the projectile", "length"),
    ("transducer", "force in the projectile at its transducer", "force"),
    ("displacement", "displacement of the impacted end, positive away from the plate", "length"),
    ("velocity", "velocity of the impacted end, positive away from the plate", "length/time"),
    ("acceleration", "acceleration of the impacted end", "length/time^2"),
)

CONTACT = tuple(name for name, _, _ in _CONTACT)

DATASETS = {
    dataset.path: dataset
    for dataset in (
        Dataset("mesh/coordinates", ("numnp", "ndm"), "nodal coordinates", "length"),
        Dataset(
            "mesh/elements", ("numel", "nen"),
            "node numbers from 1 of every element, 0 where absent", dtype="i4",
        ),
        Dataset(
            "mesh/equations", ("numnp", "ndf"),
            "equation numbers from 1 of every unknown, 0 where restrained", dtype="i4",
        ),
        Dataset("laminate/A", (3, 3), "extensional stiffness, order xx, yy, xy", "force/length"),
        Dataset("laminate/B", (3, 3), "coupling stiffness, order xx, yy, xy", "force"),
        Dataset("laminate/D", (3, 3), "bending stiffness, order xx, yy, xy", "force*length"),
        Dataset(
            "laminate/shear", (2, 2), "transverse shear stiffness, order xz, yz", "force/length"
        ),
        *_clock("tape3"),
        Dataset("tape3/w", ("rows", "numnp"), "transverse displacement of every node", "length"),
        Dataset(
            "tape3/displacement", ("rows", "numnp", "ndf"),
            "u, v, w and the rotations theta_x, theta_y of every node",
            "length (u, v, w), 1 (theta_x, theta_y)",
        ),
        *_clock("tape8"),
        *_group(
            "tape8", ("rows", "numel", "npt"),
            ("kappa_x", "curvature -theta_x,x at every point of every element", "1/length"),
            ("kappa_y", "curvature -theta_y,y", "1/length"),
            ("kappa_xy", "twist -theta_x,y - theta_y,x", "1/length"),
            ("gamma_yz", "transverse shear strain w,y - theta_y", ""),
            ("gamma_xz", "transverse shear strain w,x - theta_x", ""),
        ),
        *_clock("tape9"),
        *_group("tape9", ("rows",), *_CONTACT),
        *_clock("history"),
        *_group(
            "history", ("rows",), *_CONTACT,
            ("plate_w", "displacement of the impact node that the contact law sees", "length"),
        ),
        *_clock("energy"),
        *_group(
            "energy", ("rows",),
            ("plate_kinetic", "kinetic energy of the plate", "force*length"),
            ("plate_strain", "strain energy of the plate", "force*length"),
            ("projectile_kinetic", "kinetic energy of the projectile", "force*length"),
            ("projectile_strain", "strain energy of the projectile", "force*length"),
            ("contact_work", "work of the contact force on the indentation", "force*length"),
            ("external_work", "work of the nodal forces on the plate", "force*length"),
            (
                "balance_error",
                "all energies and the contact work, less the initial energy and external work",
                "force*length",
            ),
            ("damping_work", "energy dissipated by DAMP, only with that card", "force*length"),
        ),
        *_clock("gages"),
        Dataset("gages/number", ("gages",), "number of every gage", dtype="i4"),
        Dataset("gages/strain", ("rows", "gages"), "normal strain of every gage in its direction"),
        *_clock("stresses"),
        Dataset("stresses/x", ("numel", "nps"), "x of every point of every element", "length"),
        Dataset("stresses/y", ("numel", "nps"), "y of every point of every element", "length"),
        *_group(
            "stresses", ("rows", "numel", "nps"),
            ("eps_xx", "midplane strain u,x", ""),
            ("eps_yy", "midplane strain v,y", ""),
            ("gamma_xy", "midplane shear strain u,y + v,x", ""),
            ("kappa_x", "curvature -theta_x,x", "1/length"),
            ("kappa_y", "curvature -theta_y,y", "1/length"),
            ("kappa_xy", "twist -theta_x,y - theta_y,x", "1/length"),
            ("gamma_xz", "transverse shear strain w,x - theta_x", ""),
            ("gamma_yz", "transverse shear strain w,y - theta_y", ""),
            ("N_x", "stress resultant", "force/length"),
            ("N_y", "stress resultant", "force/length"),
            ("N_xy", "shear resultant", "force/length"),
            ("M_x", "stress couple", "force"),
            ("M_y", "stress couple", "force"),
            ("M_xy", "twisting couple", "force"),
            ("Q_x", "transverse shear force", "force/length"),
            ("Q_y", "transverse shear force", "force/length"),
        ),
        Dataset(
            "patch/node", ("patch_nodes",), "node numbers from 1 that share the contact force",
            dtype="i4",
        ),
        Dataset("patch/weight", ("patch_nodes",), "share of every node in the contact force"),
        *_clock("plies"),
        Dataset(
            "plies/element", ("members",), "number of every element with ply stresses", dtype="i4"
        ),
        Dataset(
            "plies/z", ("layers", "levels"), "lower, middle and upper z of every ply", "length"
        ),
        Dataset(
            "plies/under_load", ("members",),
            "1 where plate theory does not hold: within the patch's radius + h/2 of the load",
            dtype="i4",
        ),
        *_group(
            "plies", ("rows", "members", "npp", "layers", "faces"),
            ("sigma_1", "normal stress along the fibres, at both faces", "force/length^2"),
            ("sigma_2", "normal stress across the fibres", "force/length^2"),
            ("tau_12", "shear stress in the axes of the ply", "force/length^2"),
        ),
        *_group(
            "plies", ("rows", "members", "layers", "levels"),
            ("tau_xz", "interlaminar shear stress at the element's centre", "force/length^2"),
            ("tau_yz", "interlaminar shear stress at the element's centre", "force/length^2"),
        ),
        Dataset(
            "plies/residual", ("rows", "members", "directions"),
            "tau_xz and tau_yz of equilibrium at z = h/2, removed linearly in z", "force/length^2",
        ),
        Dataset("failure/x", ("numel", "npp"), "x of every point of every element", "length"),
        Dataset("failure/y", ("numel", "npp"), "y of every point of every element", "length"),
        Dataset(
            "failure/under_load", ("numel", "npp"),
            "1 where plate theory does not hold: nearer than the patch's radius + h/2 to the load",
            dtype="i4",
        ),
        *(
            dataset
            for criterion in CRITERIA
            for dataset in _exposures(f"failure/{criterion}", ("numel", "npp", "layers", "faces"))
        ),
        *_exposures(INTERLAMINAR, ("numel", "interfaces")),
        *_clock("reactions"),
        Dataset(
            "reactions/force", ("rows", "numnp", "ndf"),
            "internal less applied force of every unknown: forces of the supports",
            "force (u, v, w), force*length (theta_x, theta_y)",
        ),
        *_clock("modes"),
        Dataset("modes/number", ("rows",), "number of the mode, from 1", dtype="i8"),
        Dataset("modes/angular_frequency", ("rows",), "natural angular frequency", "1/time"),
        Dataset(
            "modes/shape", ("rows", "numnp", "ndf"), "mode of unit modal mass: every unknown"
        ),
    )
}  # fmt: skip

FIXED = {"faces": 2, "levels": 3, "directions": 2}  # sizes of axes that every result has

# Dimension scales: name and description by size.
SCALES = {
    "numnp": ("node", "number of the node"),
    "numel": ("element", "number of the element"),
    "ndm": ("axis", "name of the coordinate"),
    "nen": ("position", "position of the node in its element, from 1"),
    "npt": ("point", "number of the point in its element"),
    "nps": ("stress_point", "number of the stress point in its element"),
    "ndf": ("unknown", "name of the unknown"),
    "patch_nodes": ("patch_node", "position of the node among those of the patch, from 1"),
    "members": ("member", "position of the element among those with ply stresses, from 1"),
    "npp": ("ply_point", "number of the point in its element"),
    "layers": ("ply", "number of the ply, from z = -h/2"),
    "interfaces": ("interface", "number of the interface, from 1 between plies 1 and 2"),
    "faces": ("face", "face of the ply: 1 at its lower z, 2 at its upper z"),
    "levels": ("level", "level in the ply: 1 at its lower z, 2 at its middle, 3 at its upper z"),
    "directions": ("direction", "1 is xz, 2 is yz"),
    "gages": ("gage", "position of the gage among the gages, from 1"),
    "cases": ("case", "number of the case, from 0"),
    "steps": ("step", "number of time steps taken"),
    "combinations": ("combination", "number of the combination of varied values, from 0"),
    "laws": ("random_name", "name of the random value"),
    "limits": ("limit", "number of the limit, from 1"),
    "statistics": ("statistic", "name of the statistic; percentages are quantiles"),
    "bounds": ("bound", "ends of the 95 % interval"),
}
FROM_0 = ("cases", "combinations")
# Names of the positions of some axes.
AXIS_NAMES: dict[str | int, tuple[str, ...]] = {
    "ndf": DOF_NAMES,
    "ndm": AXES,
    "statistics": ("draws", "mean", "standard_deviation", "1 %", "5 %", "50 %", "95 %", "99 %"),
    "bounds": ("lower", "upper"),
}


def shape_error(shapes: Mapping[str, tuple[int, ...]], kinds: Mapping[str, str]) -> str:
    """Message about the first dataset with a wrong shape or type; empty if there is none.

    Both are by path; kinds are NumPy's letters: ``"f"``, ``"i"``, ``"u"`` or ``"b"``.
    """
    sizes = {name: (size, "every result") for name, size in FIXED.items()}
    for path, shape in shapes.items():
        if (dataset := DATASETS.get(path)) is None:
            continue
        if kinds[path] not in ("f" if dataset.dtype.startswith("f") else "iu"):
            return f"{path} has the wrong type: expected {dataset.dtype}"
        if len(shape) != len(dataset.shape):
            return f"{path} has the shape {shape}, not ({', '.join(map(str, dataset.shape))})"
        for name, size in zip(dataset.shape, shape, strict=True):
            if isinstance(name, int):
                expected, source = name, "every result"
            else:
                key = f"{dataset.group} {name}" if name == "rows" else name
                expected, source = sizes.setdefault(key, (size, path))
            if size != expected:
                return f"{path} has the shape {shape}, but {name} is {expected} in {source}"
    return ""


def declared_units(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Names of the units of length, force and time; empty if the deck names none."""
    names = {n: str(attributes.get(f"unit_{n}", "")) for n in ("length", "force", "time")}
    return names if all(names.values()) else {}


GROUP_DESCRIPTIONS = {
    "mesh": "the finite element mesh",
    "laminate": "stiffness of the laminate per area",
    "tape3": "nodal displacements, stored by DISP",
    "tape8": "element strains, stored by RODP",
    "tape9": "contact and the projectile, stored by RODP",
    "history": "contact and the projectile at every step; row n is the state after step n",
    "energy": "energies at every step",
    "gages": "strain gages, read at every step",
    "stresses": "strains and stress resultants, stored by STRE",
    "patch": "nodal weights of the contact force",
    "plies": "stresses ply by ply, stored by PLYS",
    "threshold": "delamination threshold: force, time of its first crossing, margin of the peak",
    "failure": "largest exposures over time, found by FAIL",
    "reactions": "forces of the supports, stored by REAC",
    "modes": "natural modes, found by EIGE",
}

# Macro that stores each group.
STORED_BY = {
    "tape3": "DISP", "tape8": "RODP", "tape9": "RODP", "history": "RODP", "energy": "RODP",
    "gages": "RODP or EXCD",
    "stresses": "STRE", "plies": "PLYS", "failure": "FAIL", "reactions": "REAC", "modes": "EIGE",
}  # fmt: skip


def remedy(path: str) -> str:
    """End of a message about a missing dataset: what stores it; empty if no macro does."""
    word = STORED_BY.get(path.partition("/")[0])
    return f"; add {word} to the deck's program and run it again" if word else ""
