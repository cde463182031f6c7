"""Schema of a result file: groups, and type, shape, description and dimension of every dataset.

Shapes use the sizes of a run: ``rows`` of the group, ``numnp``, ``ndm``, ``ndf``,
``numel``, ``nen``, ``npt`` and ``nps`` (points per element in tape8 and stresses), ``gages``;
of ply stresses ``members`` (elements), ``npp`` (points per element), ``layers`` and :data:`FIXED`.
The annotations of a group serve type checkers, editors and :data:`DATASETS`.
"""

import math
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._frozen import frozen
from fecm._tables import html_table
from fecm._typing import Array, Floats
from fecm.deck.records import AXES, DOF_NAMES
from fecm.mechanics.failure import CRITERIA

Ints = NDArray[np.int64]
Int32s = NDArray[np.int32]
Int8s = NDArray[np.int8]
DTYPES: dict[object, str] = {Floats: "f8", Ints: "i8", Int32s: "i4", Int8s: "i1"}


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


def not_stored(asked: str, paths: Collection[str]) -> str:
    """Message about a path that is no dataset of a result: what is, or what stores it."""
    if members := sorted(path for path in paths if path.startswith(f"{asked}/")):
        return f"{asked} is a group, not a dataset; its datasets are {', '.join(members)}"
    group = asked.partition("/")[0]
    known = any(path.startswith(f"{group}/") for path in paths)
    more = suggestion(asked, paths) if known else remedy(asked) or suggestion(asked, paths)
    return f"there is no {asked} in this result{more}"


def jsonable(value: Any) -> Any:
    """Convert to a value that :func:`json.dumps` writes as valid JSON."""
    import json

    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return json.dumps(value)
    return value if value is None or isinstance(value, bool | int | float) else str(value)


BLOCK = 4_000_000  # bytes of a block of rows


def row_blocks(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """First and last + 1 row of the blocks in which a dataset is read; a number is one row."""
    rows = shape[0] if shape else 1
    step = max(1, BLOCK // (8 * max(1, math.prod(shape[1:]))))
    for start in range(0, rows, step):
        yield start, min(start + step, rows)


FORMAT, SWEEP = "fecm", "fecm-sweep"  # formats of a run's and of a sweep's result
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


# Groups: each column has its type, sizes, description and, if it has one, dimension.
_Energy = Annotated[Floats, "rows"]
_Strain = Annotated[Floats, "rows numel npt"]
_Stress = Annotated[Floats, "rows numel nps"]
_InPlane = Annotated[Floats, "rows members npp layers faces"]
_Interlaminar = Annotated[
    Floats, "rows members layers levels", "interlaminar shear stress at the element's centre",
    "force/length^2",
]  # fmt: skip


class Group:
    """The datasets of one group as attributes: ``result.tape3.w``."""

    def __init__(
        self, name: str, arrays: Mapping[str, Array], attributes: Mapping[str, Mapping[str, Any]]
    ) -> None:
        self._name = name
        self._arrays = arrays
        self._attributes = attributes

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the group."""
        return dict(self._attributes.get(self._name, {}))

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if not name.startswith("_"):
                path = f"{self._name}/{name}"
                if path in self._arrays:
                    return self._arrays[path]
                if any(other.startswith(f"{path}/") for other in self._arrays):
                    return group(path, self._arrays, self._attributes)
            raise NotStoredError(not_stored(f"{self._name}/{name}", self._arrays))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *{name.partition("/")[0] for name in self._shapes()}]

    def _shapes(self) -> dict[str, str]:
        """Shapes of the datasets by their names."""
        head = f"{self._name}/"
        own = [path for path in self._arrays if path.startswith(head)]
        return {path.removeprefix(head): str(self._arrays[path].shape) for path in own}

    def __repr__(self) -> str:
        shapes = ", ".join(f"{name} {shape}" for name, shape in self._shapes().items())
        return f"<{self._name}: {shapes}>"

    def _repr_html_(self) -> str:
        """Table of the datasets, for notebooks."""
        return html_table(self._name, self._shapes().items())


class Rows(Group):
    """Rows with the number of steps taken, and the time."""

    step: Annotated[Ints, "rows", "number of time steps taken"]
    time: Annotated[Floats, "rows", "time integrated up to the row's state", "time"]


class Contact:
    """Contact and projectile, a value per row."""

    force: Annotated[Floats, "rows", "contact force, positive in compression", "force"]
    indentation: Annotated[Floats, "rows", "indentation of the plate by the projectile", "length"]
    transducer: Annotated[Floats, "rows", "force in the projectile at its transducer", "force"]
    displacement: Annotated[
        Floats, "rows", "displacement of the impacted end, positive away from the plate", "length"
    ]
    velocity: Annotated[
        Floats, "rows", "velocity of the impacted end, positive away from the plate", "length/time"
    ]
    acceleration: Annotated[Floats, "rows", "acceleration of the impacted end", "length/time^2"]


CONTACT = tuple(Contact.__annotations__)


class Mesh(Group):
    """The finite element mesh."""

    coordinates: Annotated[Floats, "numnp ndm", "nodal coordinates", "length"]
    elements: Annotated[Int32s, "numel nen", "node numbers from 1 of every element, 0 where absent"]
    equations: Annotated[
        Int32s, "numnp ndf", "equation numbers from 1 of every unknown, 0 where restrained"
    ]


class LaminateStiffness(Group):
    """Stiffness of the laminate per area."""

    A: Annotated[Floats, "3 3", "extensional stiffness, order xx, yy, xy", "force/length"]
    B: Annotated[Floats, "3 3", "coupling stiffness, order xx, yy, xy", "force"]
    D: Annotated[Floats, "3 3", "bending stiffness, order xx, yy, xy", "force*length"]
    shear: Annotated[Floats, "2 2", "transverse shear stiffness, order xz, yz", "force/length"]


class Tape3(Rows):
    """Displacements of the nodes, stored by DISP."""

    w: Annotated[Floats, "rows numnp", "transverse displacement of every node", "length"]
    displacement: Annotated[
        Floats, "rows numnp ndf", "u, v, w and the rotations theta_x, theta_y of every node",
        "length (u, v, w), 1 (theta_x, theta_y)",
    ]  # fmt: skip


class Tape8(Rows):
    """Strains of the elements, stored by RODP."""

    kappa_x: Annotated[_Strain, "curvature -theta_x,x at every point of every element", "1/length"]
    kappa_y: Annotated[_Strain, "curvature -theta_y,y", "1/length"]
    kappa_xy: Annotated[_Strain, "twist -theta_x,y - theta_y,x", "1/length"]
    gamma_yz: Annotated[_Strain, "transverse shear strain w,y - theta_y"]
    gamma_xz: Annotated[_Strain, "transverse shear strain w,x - theta_x"]


class Tape9(Contact, Rows):
    """Contact and projectile, stored by RODP."""


class History(Contact, Rows):
    """Contact and projectile at every step."""

    plate_w: Annotated[
        Floats, "rows", "displacement of the impact node that the contact law sees", "length"
    ]


class Energy(Rows):
    """Energies at every step."""

    plate_kinetic: Annotated[_Energy, "kinetic energy of the plate", "force*length"]
    plate_strain: Annotated[_Energy, "strain energy of the plate", "force*length"]
    projectile_kinetic: Annotated[_Energy, "kinetic energy of the projectile", "force*length"]
    projectile_strain: Annotated[_Energy, "strain energy of the projectile", "force*length"]
    contact_work: Annotated[_Energy, "work of the contact force on the indentation", "force*length"]
    external_work: Annotated[_Energy, "work of the nodal forces on the plate", "force*length"]
    balance_error: Annotated[
        _Energy,
        "all energies and the contact work, less the initial energy and external work",
        "force*length",
    ]
    damping_work: Annotated[
        _Energy, "energy dissipated by DAMP, only with that card", "force*length"
    ]


class GageGroup(Rows):
    """Strain gages, read at every step."""

    number: Annotated[Int32s, "gages", "number of every gage"]
    strain: Annotated[Floats, "rows gages", "normal strain of every gage in its direction"]


class Stresses(Rows):
    """Strains and stress resultants, stored by STRE."""

    x: Annotated[Floats, "numel nps", "x of every point of every element", "length"]
    y: Annotated[Floats, "numel nps", "y of every point of every element", "length"]
    eps_xx: Annotated[_Stress, "midplane strain u,x"]
    eps_yy: Annotated[_Stress, "midplane strain v,y"]
    gamma_xy: Annotated[_Stress, "midplane shear strain u,y + v,x"]
    kappa_x: Annotated[_Stress, "curvature -theta_x,x", "1/length"]
    kappa_y: Annotated[_Stress, "curvature -theta_y,y", "1/length"]
    kappa_xy: Annotated[_Stress, "twist -theta_x,y - theta_y,x", "1/length"]
    gamma_xz: Annotated[_Stress, "transverse shear strain w,x - theta_x"]
    gamma_yz: Annotated[_Stress, "transverse shear strain w,y - theta_y"]
    N_x: Annotated[_Stress, "stress resultant", "force/length"]
    N_y: Annotated[_Stress, "stress resultant", "force/length"]
    N_xy: Annotated[_Stress, "shear resultant", "force/length"]
    M_x: Annotated[_Stress, "stress couple", "force"]
    M_y: Annotated[_Stress, "stress couple", "force"]
    M_xy: Annotated[_Stress, "twisting couple", "force"]
    Q_x: Annotated[_Stress, "transverse shear force", "force/length"]
    Q_y: Annotated[_Stress, "transverse shear force", "force/length"]


class PatchGroup(Group):
    """Nodal weights of the contact force."""

    node: Annotated[Int32s, "patch_nodes", "node numbers from 1 that share the contact force"]
    weight: Annotated[Floats, "patch_nodes", "share of every node in the contact force"]


class PlyRows(Rows):
    """Stresses ply by ply, stored by PLYS."""

    element: Annotated[Int32s, "members", "number of every element with ply stresses"]
    z: Annotated[Floats, "layers levels", "lower, middle and upper z of every ply", "length"]
    under_load: Annotated[
        Int32s, "members",
        "1 where plate theory does not hold: within the patch's radius + h/2 of the load",
    ]  # fmt: skip
    sigma_1: Annotated[_InPlane, "normal stress along the fibres, at both faces", "force/length^2"]
    sigma_2: Annotated[_InPlane, "normal stress across the fibres", "force/length^2"]
    tau_12: Annotated[_InPlane, "shear stress in the axes of the ply", "force/length^2"]
    tau_xz: _Interlaminar
    tau_yz: _Interlaminar
    residual: Annotated[
        Floats, "rows members directions",
        "tau_xz and tau_yz of equilibrium at z = h/2, removed linearly in z", "force/length^2",
    ]  # fmt: skip


class Exposure(Group):
    """Largest exposures of a criterion, with their times and modes; `Failure` names the sizes."""

    exposure: Annotated[Floats, "", "largest exposure over time"]
    time: Annotated[Floats, "", "its time", "time"]
    mode: Annotated[Int8s, "", "its mode: index into the attribute modes"]


_PlyExposure = Annotated[Exposure, "numel npp layers faces"]


class Failure(Group):
    """Largest exposures over time, found by FAIL."""

    x: Annotated[Floats, "numel npp", "x of every point of every element", "length"]
    y: Annotated[Floats, "numel npp", "y of every point of every element", "length"]
    under_load: Annotated[
        Int32s, "numel npp",
        "1 where plate theory does not hold: nearer than the patch's radius + h/2 to the load",
    ]  # fmt: skip
    max_stress: _PlyExposure
    tsai_wu: _PlyExposure
    hashin: _PlyExposure
    puck: _PlyExposure
    interlaminar: Annotated[Exposure, "numel interfaces"]


INTERLAMINAR = "failure/interlaminar"


class Exposures(Rows):
    """Largest exposure so far of each criterion outside the load, at every evaluation of FAIL."""

    exposure: Annotated[Floats, "rows criteria", "largest exposure so far, outside the load"]
    mode: Annotated[Int8s, "rows criteria", "its mode: index into the attribute modes of failure"]
    ply: Annotated[
        Int32s, "rows criteria", "its ply, from 1 at z = -h/2; of an interface the one above it"
    ]
    x: Annotated[Floats, "rows criteria", "x of its place", "length"]
    y: Annotated[Floats, "rows criteria", "y of its place", "length"]


class Reactions(Rows):
    """Forces of the supports, stored by REAC."""

    force: Annotated[
        Floats, "rows numnp ndf",
        "internal less applied force of every unknown: forces of the supports",
        "force (u, v, w), force*length (theta_x, theta_y)",
    ]  # fmt: skip


class Modes(Rows):
    """Natural modes, found by EIGE."""

    number: Annotated[Ints, "rows", "number of the mode, from 1"]
    angular_frequency: Annotated[Floats, "rows", "natural angular frequency", "1/time"]
    shape: Annotated[Floats, "rows numnp ndf", "mode of unit modal mass: every unknown"]


# Class, description and, if it is one, the macro that stores each group.
GROUPS: dict[str, tuple[type[Group], str, str]] = {
    "mesh": (Mesh, "the finite element mesh", ""),
    "laminate": (LaminateStiffness, "stiffness of the laminate per area", ""),
    "tape3": (Tape3, "nodal displacements, stored by DISP", "DISP"),
    "tape8": (Tape8, "element strains, stored by RODP", "RODP"),
    "tape9": (Tape9, "contact and the projectile, stored by RODP", "RODP"),
    "history": (
        History, "contact and the projectile at every step; row n is the state after step n", "RODP"
    ),
    "energy": (Energy, "energies at every step", "RODP"),
    "gages": (GageGroup, "strain gages, read at every step", "RODP or EXCD"),
    "stresses": (Stresses, "strains and stress resultants, stored by STRE", "STRE"),
    "patch": (PatchGroup, "nodal weights of the contact force", ""),
    "plies": (PlyRows, "stresses ply by ply, stored by PLYS", "PLYS"),
    "threshold": (
        Group,
        "delamination threshold: force of `number` delaminations, first crossing, margin of the "
        "peak; band: forces of one delamination in each of the `interfaces`, and of a single one",
        "",
    ),
    "failure": (Failure, "largest exposures over time, found by FAIL", "FAIL"),
    "exposures": (
        Exposures, "largest exposures so far outside the load, at every evaluation of FAIL", "FAIL"
    ),
    "reactions": (Reactions, "forces of the supports, stored by REAC", "REAC"),
    "modes": (Modes, "natural modes, found by EIGE", "EIGE"),
}  # fmt: skip
STORED_BY = {name: word for name, (_, _, word) in GROUPS.items() if word}


def group(
    name: str, arrays: Mapping[str, Array], attributes: Mapping[str, Mapping[str, Any]]
) -> Group:
    """Return a group of a result by its path."""
    own = Exposure if name.startswith("failure/") else Group
    kind = GROUPS[name][0] if name in GROUPS else own
    return kind(name, arrays, attributes)


def _datasets(group: str, kind: type[Group], outer: str = "") -> Iterator[Dataset]:
    """Datasets of a group, of these sizes unless they have their own."""
    for base in reversed(kind.__mro__):
        for name, column in getattr(base, "__annotations__", {}).items():
            path, (sizes, *about) = f"{group}/{name}", column.__metadata__
            if column.__origin__ is Exposure:
                yield from _datasets(path, Exposure, sizes)
            else:
                shape = tuple(int(n) if n.isdigit() else n for n in (sizes or outer).split())
                description, dimension = (*about, "")[:2]
                yield Dataset(path, shape, description, dimension, DTYPES[column.__origin__])


DATASETS = {d.path: d for name, (kind, _, _) in GROUPS.items() for d in _datasets(name, kind)}

# Sizes of axes that every result has.
FIXED = {"faces": 2, "levels": 3, "directions": 2, "criteria": len(CRITERIA) + 1}
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
    "criteria": ("criterion", "name of the failure criterion"),
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
    "criteria": (*CRITERIA, "interlaminar"),
    "statistics": ("draws", "mean", "standard_deviation", "1 %", "5 %", "50 %", "95 %", "99 %"),
    "bounds": ("lower", "upper"),
}


def shape_error(shapes: Mapping[str, tuple[int, ...]], kinds: Mapping[str, str]) -> str:
    """Message about the first dataset with a wrong shape or type; empty if there is none.

    Both are by path; kinds are NumPy's letters: ``"f"``, ``"i"``, ``"u"`` or ``"b"``.
    """
    sizes: dict[str | int, tuple[int, str]] = {n: (s, "every result") for n, s in FIXED.items()}
    for path, shape in shapes.items():
        if (dataset := DATASETS.get(path)) is None:
            continue
        if kinds[path] not in ("f" if dataset.dtype.startswith("f") else "iu"):
            return f"{path} has the wrong type: expected {dataset.dtype}"
        if len(shape) != len(dataset.shape):
            return f"{path} has the shape {shape}, not ({', '.join(map(str, dataset.shape))})"
        for name, size in zip(dataset.shape, shape, strict=True):
            known = (name, "every result") if isinstance(name, int) else (size, path)
            key = f"{dataset.group} {name}" if name == "rows" else name
            expected, source = sizes.setdefault(key, known)
            if size != expected:
                return f"{path} has the shape {shape}, but {name} is {expected} in {source}"
    return ""


# Attributes that are numbers, and lists of texts, by group.  Without those of history and energy
# a result only lacks its summary.
NUMBERS = {
    "threshold": ("force", "time", "margin"),
    "patch": ("x", "y", "radius"),
}
TEXTS = {"failure": ("modes",)}
COMPLETE = ("threshold",)  # groups that have all of these attributes


def attribute_error(groups: Mapping[str, Mapping[str, Any]]) -> str:
    """Message about the first attribute of a wrong type or missing; empty if there is none.

    Attributes are by group and name.
    """
    for table, fits, what in ((NUMBERS, _is_number, "a number"), (TEXTS, _is_texts, "texts")):
        for group, names in table.items():
            found = groups.get(group, {})
            missing = [name for name in names if name not in found]
            if group in groups and group in COMPLETE and missing:
                return f"{group} has no attribute {missing[0]}"
            for name in names:
                if name in found and not fits(found[name]):
                    return f"the attribute {name} of {group} is {shown(found[name])}, not {what}"
    return ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


def declared_units(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Names of the units of length, force and time; empty if the deck names none."""
    names = {n: str(attributes.get(f"unit_{n}", "")) for n in ("length", "force", "time")}
    return names if all(names.values()) else {}


def remedy(path: str) -> str:
    """End of a message about a missing dataset: what stores it; empty if no macro does."""
    word = STORED_BY.get(path.partition("/")[0])
    return f"; add {word} to the deck's program and run it again" if word else ""
