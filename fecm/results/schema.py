"""Schema of result files: groups, and type, shape, description and dimension of every dataset.

:data:`FILES` describes each :class:`Form` of file: a run, a sweep, or a location. A dataset that is
not in it can't be written.

Shapes of a run use the sizes of a run: ``rows`` of the group, ``numnp``, ``ndm``, ``ndf``,
``numel``, ``nen``, ``npt`` and ``nps`` (points per element in tape8 and stresses), ``gages``.
Shapes of ply stresses use ``members`` (elements), ``npp`` (points per element), ``layers`` and
:data:`FIXED`. The annotations of a group serve type checkers, editors and :data:`DATASETS`. Shapes
of a sweep use ``cases``, ``steps``, ``combinations`` (of varied values), ``laws`` (random values),
``limits`` and ``trials`` (of the reduced model).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm._version import __version__
from fecm.deck.mesh_cards import AXES, DOF_NAMES
from fecm.judge.criteria import ALL_CRITERIA
from fecm.results.groups import GROUPS, ResultGroup
from fecm.results.metrics import COLUMNS, RATIO, STATUS, VALIDITY, described

Ints = NDArray[np.int64]
Int32s = NDArray[np.int32]
Int8s = NDArray[np.int8]
DTYPES: dict[object, str] = {
    Floats: "f8",
    Ints: "i8",
    Int32s: "i4",
    Int8s: "i1",
}

FORMAT_VERSION = 1


class Form(StrEnum):
    """Content of a file: its attribute ``format``."""

    RUN = "fecm"
    SWEEP = "fecm-sweep"
    LOCATION = "fecm-location"


class Kinematics(StrEnum):
    """Strains of the plate: the attribute :data:`KINEMATICS` of nonlinear plates."""

    LINEAR = "linear"
    VON_KARMAN = "von Karman"


KINEMATICS = "kinematics"
COMMENTS = "comments"  # attribute of a run: comment lines above the title of its deck


def heading(form: Form, title: str) -> dict[str, Any]:
    """Return the attributes that every file has."""
    return {
        "format": form.value,
        "format_version": FORMAT_VERSION,
        "fecm_version": __version__,
        "title": title,
    }


# Attribute of a dataset with columns of several units: the unit of each, instead of ``units``.
COLUMN_UNITS = "column_units"

ANY = "any"  # integers, numbers or texts: the type of the values
NUMBERS = "numbers"  # integers or numbers
TEXTS = "texts"


FIELD_AXES = {"numnp", "numel", "members"}


@dataclass(frozen=True)
class Dataset:
    """Dataset of a result."""

    path: str  # group and name; ``*`` stands for any name
    shape: tuple[str | int, ...]  # sizes by name, or numbers
    description: str  # may contain {name}, {text} and {label}, see `_named`
    dimension: str = ""  # physical dimension; may be empty, or OF_QUANTITY
    dtype: str = "f8"  # NumPy's name of the type, ANY, NUMBERS or TEXTS
    outer: str = ""  # axis in front of the others, which only some results have

    @property
    def group(self) -> str:
        """Name of its group."""
        return self.path.rpartition("/")[0]

    @property
    def name(self) -> str:
        """Name in its group."""
        return self.path.rpartition("/")[2]

    def with_outer(self) -> "Dataset":
        """Return the dataset of a result that has the outer axis."""
        return replace(self, shape=(self.outer, *self.shape))

    @property
    def is_field(self) -> bool:
        """Whether it has rows of numbers of nodes or elements, which COMP rounds."""
        return self.dtype == "f8" and "rows" in self.shape and bool(FIELD_AXES & {*self.shape})


EVERY_STEP = ("energy", "history", "gages")  # groups with a row for every step
# Groups: each column has its type, sizes, description and, if it has one, dimension.
_Energy = Annotated[Floats, "rows"]
_Strain = Annotated[Floats, "rows numel npt"]
_Stress = Annotated[Floats, "rows numel nps"]
_InPlane = Annotated[Floats, "rows members npp layers faces"]
_Interlaminar = Annotated[
    Floats,
    "rows members layers levels",
    "interlaminar shear stress at the element's centre",
    "force/length^2",
]


class Rows(ResultGroup):
    """Rows with the number of steps taken, and the time."""

    step: Annotated[Ints, "rows", "number of time steps taken"]
    time: Annotated[Floats, "rows", "time integrated up to the row's state", "time"]


class ContactRows:
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


CONTACT = tuple(ContactRows.__annotations__)


class MeshGroup(ResultGroup, group="mesh", about="the finite element mesh"):
    """The finite element mesh."""

    coordinates: Annotated[Floats, "numnp ndm", "nodal coordinates", "length"]
    elements: Annotated[Int32s, "numel nen", "node numbers from 1 of every element, 0 where absent"]
    equations: Annotated[
        Int32s, "numnp ndf", "equation numbers from 1 of every unknown, 0 where restrained"
    ]
    laminate: Annotated[
        Int32s, "numel", "number of the laminate of every element, only with several"
    ]
    z: Annotated[
        Floats, "numnp", "height of every node at rest above the centre, only if curved", "length"
    ]


class LaminateStiffness(ResultGroup, group="laminate", about="stiffness of the laminate per area"):
    """Stiffness of the laminate per area. Several laminates have a group each, by number."""

    A: Annotated[Floats, "3 3", "extensional stiffness, order xx, yy, xy", "force/length"]
    B: Annotated[Floats, "3 3", "coupling stiffness, order xx, yy, xy", "force"]
    D: Annotated[Floats, "3 3", "bending stiffness, order xx, yy, xy", "force*length"]
    shear: Annotated[Floats, "2 2", "transverse shear stiffness, order xz, yz", "force/length"]


class Tape3(
    Rows, group="tape3", about="nodal displacements, stored by DISP", macro="DISP", by_pass=True
):
    """Displacements of the nodes, stored by DISP."""

    w: Annotated[Floats, "rows numnp", "transverse displacement of every node", "length"]
    displacement: Annotated[
        Floats,
        "rows numnp ndf",
        "u, v, w and the rotations theta_x, theta_y of every node",
        "length (u, v, w), 1 (theta_x, theta_y)",
    ]


class Tape8(Rows, group="tape8", about="element strains, stored by RODP", macro="RODP"):
    """Strains of the elements, stored by RODP."""

    kappa_x: Annotated[_Strain, "curvature -theta_x,x at every point of every element", "1/length"]
    kappa_y: Annotated[_Strain, "curvature -theta_y,y", "1/length"]
    kappa_xy: Annotated[_Strain, "twist -theta_x,y - theta_y,x", "1/length"]
    gamma_yz: Annotated[_Strain, "transverse shear strain w,y - theta_y"]
    gamma_xz: Annotated[_Strain, "transverse shear strain w,x - theta_x"]


class Tape9(
    ContactRows,
    Rows,
    group="tape9",
    about="contact and the projectile, stored by RODP",
    macro="RODP",
):
    """Contact and projectile, stored by RODP."""


class HistoryRows(
    ContactRows,
    Rows,
    group="history",
    about="contact and the projectile at every step; row n is the state after step n",
    macro="RODP",
):
    """Contact and projectile at every step."""

    plate_w: Annotated[
        Floats, "rows", "displacement of the impact node that the contact law sees", "length"
    ]


class Energy(Rows, group="energy", about="energies at every step", macro="RODP"):
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


class GageGroup(
    Rows, group="gages", about="strain gages, read at every step", macro="RODP or EXCD"
):
    """Strain gages, read at every step."""

    number: Annotated[Int32s, "gages", "number of every gage"]
    strain: Annotated[Floats, "rows gages", "normal strain of every gage in its direction"]


class MembraneRows(
    Rows,
    group="membrane",
    about="stretching of a nonlinear plate, at the rows of tape8, or of tape3 without impact",
):
    """Stretching of a nonlinear plate, at the rows of tape8, or of tape3 without impact."""

    energy: Annotated[
        _Energy, "membrane energy, 1/2 n A^-1 n of n = A eps + B kappa", "force*length"
    ]
    strain_energy: Annotated[_Energy, "strain energy of the plate", "force*length"]
    preload_energy: Annotated[
        _Energy, "energy 1/2 N0_ij w,i w,j of the preload, only with PREL", "force*length"
    ]
    largest_slope: Annotated[Floats, "rows", "largest slope |grad w|"]
    largest_strain: Annotated[
        Floats, "rows", "largest principal strain of both faces, in size, away from the load"
    ]
    largest_force: Annotated[
        Floats, "rows", "largest principal membrane force, tension positive", "force/length"
    ]
    force_at_load: Annotated[
        Floats, "rows", "principal membrane force at the load, the largest in size", "force/length"
    ]
    moment_at_load: Annotated[
        Floats, "rows", "principal moment at the load, the largest in size", "force"
    ]


class SupportRows(
    Rows,
    group="supports",
    about="springs and one-sided supports at the nodes, and their forces at the rows of tape3",
    macro="DISP",
):
    """Springs and one-sided supports at the nodes, and their forces at the rows of tape3."""

    node: Annotated[Int32s, "supports", "number of the node of every support"]
    dof: Annotated[Int32s, "supports", "its unknown, from 1: u, v, w, theta_x, theta_y"]
    side: Annotated[
        Int32s, "supports", "1 under the plate or -1 on the struck face; 0 for a spring"
    ]
    stiffness: Annotated[
        Floats,
        "supports",
        "stiffness of every support",
        "force/length (u, v, w), force*length (theta_x, theta_y)",
    ]
    gap: Annotated[Floats, "supports", "gap of every one-sided support", "length"]
    push: Annotated[Floats, "rows", "sum of the forces on w against the push", "force"]
    pull: Annotated[Floats, "rows", "sum of the forces on w along the push", "force"]
    closed: Annotated[Ints, "rows", "number of one-sided supports that touch the plate"]
    lift: Annotated[
        Floats, "rows", "largest distance of the plate from a one-sided support", "length"
    ]
    energy: Annotated[
        Floats, "rows", "energy of the supports, part of the strain energy", "force*length"
    ]


class Stresses(
    Rows,
    group="stresses",
    about="strains and stress resultants, stored by STRE",
    macro="STRE",
    by_pass=True,
):
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


class PatchGroup(ResultGroup, group="patch", about="nodal weights of the contact force"):
    """Nodal weights of the contact force."""

    node: Annotated[Int32s, "patch_nodes", "numbers of the nodes that share the contact force"]
    weight: Annotated[Floats, "patch_nodes", "share of every node in the contact force"]


class PlyRows(
    Rows, group="plies", about="stresses ply by ply, stored by PLYS", macro="PLYS", by_pass=True
):
    """Stresses ply by ply, stored by PLYS."""

    element: Annotated[Int32s, "members", "number of every element with ply stresses"]
    z: Annotated[Floats, "layers levels", "lower, middle and upper z of every ply", "length"]
    material: Annotated[
        Int32s, "layers", "number of the material of every ply, only with several; 0 where none is"
    ]
    under_load: Annotated[
        Int32s,
        "members",
        "1 where plate theory does not hold: within the patch's radius + h/2 of the load",
    ]
    sigma_1: Annotated[_InPlane, "normal stress along the fibres, at both faces", "force/length^2"]
    sigma_2: Annotated[_InPlane, "normal stress across the fibres", "force/length^2"]
    tau_12: Annotated[_InPlane, "shear stress in the axes of the ply", "force/length^2"]
    tau_xz: _Interlaminar
    tau_yz: _Interlaminar
    residual: Annotated[
        Floats,
        "rows members directions",
        "tau_xz and tau_yz of equilibrium at z = h/2, removed linearly in z",
        "force/length^2",
    ]
    cure_stress: Annotated[
        Floats,
        "layers faces components",
        "residual stress of CURE in the axes of the ply; the other stresses do not contain it",
        "force/length^2",
    ]


class Exposure(ResultGroup):
    """Largest exposures, times and modes of a criterion; `FailureGroup` names the sizes."""

    exposure: Annotated[Floats, "", "largest exposure over time"]
    time: Annotated[Floats, "", "its time", "time"]
    mode: Annotated[Int8s, "", "its mode: index into the attribute modes"]


_PlyExposure = Annotated[Exposure, "numel npp layers faces"]


class CircleExposures(ResultGroup):
    """Largest exposures on the circle of the patch's radius + h/2 around the load."""

    exposure: Annotated[Floats, "", "largest exposure on the circle over time"]
    time: Annotated[Floats, "", "its time", "time"]
    mode: Annotated[Int8s, "", "its mode: index into the attribute modes of failure"]
    ply: Annotated[Int32s, "", "its ply, from 1 at z = -h/2; of an interface the one above it"]
    x: Annotated[Floats, "", "x of its place", "length"]
    y: Annotated[Floats, "", "y of its place", "length"]
    points: Annotated[Int32s, "", "number of points on the circle with this exposure"]


class ThresholdGroup(
    ResultGroup,
    group="threshold",
    about="delamination threshold: force of `number` delaminations, first crossing, margin of "
    "the peak; band: forces of one delamination in each of the `interfaces`, and of a single one",
):
    """Delamination threshold of DELA: attributes, without datasets."""


class FailureGroup(
    ResultGroup, group="failure", about="largest exposures over time, found by FAIL", macro="FAIL"
):
    """Largest exposures over time, found by FAIL."""

    x: Annotated[Floats, "numel npp", "x of every point of every element", "length"]
    y: Annotated[Floats, "numel npp", "y of every point of every element", "length"]
    under_load: Annotated[
        Int32s,
        "numel npp",
        "1 where plate theory does not hold: nearer than the patch's radius + h/2 to the load, or "
        "than h/2 to a corner of supports inside the plate",
    ]
    max_stress: _PlyExposure
    tsai_wu: _PlyExposure
    hashin: _PlyExposure
    puck: _PlyExposure
    interlaminar: Annotated[Exposure, "numel interfaces"]
    centre_under_load: Annotated[
        Int32s, "numel", "1 where plate theory does not hold at the centre of the element"
    ]
    circle: Annotated[CircleExposures, "criteria"]


class ExposureRows(
    Rows,
    group="exposures",
    about="largest exposures so far outside the load, at every evaluation of FAIL",
    macro="FAIL",
):
    """Largest exposure so far of each criterion outside the load, at every evaluation of FAIL."""

    exposure: Annotated[Floats, "rows criteria", "largest exposure so far, outside the load"]
    mode: Annotated[Int8s, "rows criteria", "its mode: index into the attribute modes of failure"]
    ply: Annotated[
        Int32s, "rows criteria", "its ply, from 1 at z = -h/2; of an interface the one above it"
    ]
    x: Annotated[Floats, "rows criteria", "x of its place", "length"]
    y: Annotated[Floats, "rows criteria", "y of its place", "length"]


class Reactions(
    Rows,
    group="reactions",
    about="forces of the supports, stored by REAC",
    macro="REAC",
    by_pass=True,
):
    """Forces of the supports, stored by REAC."""

    force: Annotated[
        Floats,
        "rows numnp ndf",
        "internal less applied force of every unknown: forces of the supports",
        "force (u, v, w), force*length (theta_x, theta_y)",
    ]


class ModeRows(
    Rows, group="modes", about="natural modes, found by EIGE", macro="EIGE", by_pass=True
):
    """Natural modes, found by EIGE."""

    number: Annotated[Ints, "rows", "number of the mode, from 1"]
    angular_frequency: Annotated[Floats, "rows", "natural angular frequency", "1/time"]
    shape: Annotated[Floats, "rows numnp ndf", "mode of unit modal mass: every unknown"]


CURE_STRESS = "plies/cure_stress"  # residual stresses of CURE, of the entire plate
# Datasets that have one axis more in front if there are several laminates; NaN at plies that a
# laminate lacks.
BY_LAMINATE = ("plies/z", "plies/material", CURE_STRESS)


def _datasets(group: str, kind: type[ResultGroup], sizes_of_all: str = "") -> Iterator[Dataset]:
    """Return the datasets of a group, with these sizes unless they have their own."""
    for base in reversed(kind.__mro__):
        for name, column in getattr(base, "__annotations__", {}).items():
            path = f"{group}/{name}"
            sizes, *about = column.__metadata__
            if column.__origin__ in (Exposure, CircleExposures):
                yield from _datasets(path, column.__origin__, sizes)
            else:
                shape = tuple(int(n) if n.isdigit() else n for n in (sizes or sizes_of_all).split())
                description, dimension = (*about, "")[:2]
                outer = "laminates" if path in BY_LAMINATE else ""
                kind_of = DTYPES[column.__origin__]
                yield Dataset(path, shape, description, dimension, kind_of, outer)


DATASETS = {d.path: d for name, info in GROUPS.items() for d in _datasets(name, info.kind)}


def values_per_row(group: str, sizes: Mapping[str, int]) -> int:
    """Return the number of values in a row of a group, without its columns of single numbers."""
    axes = {**sizes, **FIXED}
    return sum(
        math.prod(axes[size] if isinstance(size, str) else size for size in dataset.shape[1:])
        for dataset in DATASETS.values()
        if dataset.group == group and dataset.shape[0] == "rows" and len(dataset.shape) > 1
    )


# Datasets of numbered laminates, and of users' criteria of the plies.
_NAMED_DATASETS = {
    f"{group}/*/{dataset.name}": dataset
    for group, example in (("laminate", "laminate"), ("failure", "failure/puck"))
    for dataset in DATASETS.values()
    if dataset.group == example
}


def criterion_datasets(name: str) -> list[Dataset]:
    """Return the datasets of a user's criterion of the plies."""
    return [
        replace(dataset, path=pattern.replace("*", name))
        for pattern, dataset in _NAMED_DATASETS.items()
        if pattern.startswith("failure/")
    ]


OF_QUANTITY = "of the quantity"  # dimension of a dataset with the name of a quantity


def _by_path(*datasets: Dataset) -> dict[str, Dataset]:
    return {dataset.path: dataset for dataset in datasets}


_CASES, _LIMITS, _TRIALS, _OUTER = ("cases",), ("limits",), ("trials",), "combinations"
# fmt: off
SWEEP_DATASETS = _by_path(
    Dataset("cases/*", _CASES, "{name} of every case", "", ANY),  # the writer gives the dimension
    Dataset(f"summary/{STATUS}", _CASES, "ok, still in contact, or why the case failed", "", TEXTS),
    Dataset(f"summary/{VALIDITY}", _CASES, "ok, reasons to doubt the case, or failed", "", TEXTS),
    Dataset("summary/*", _CASES, "{text}", OF_QUANTITY, NUMBERS),
    Dataset("measured/*", _CASES, "{name} of the table of cases", "", ANY),
    Dataset("history/dt", _CASES, "time step of every case", "time"),
    Dataset("history/steps", _CASES, "number of steps of every case", "", "i8"),
    Dataset("history/unsettled_steps", _CASES,
            "steps whose contact iteration did not converge", "", "i8"),
    Dataset("history/force", ("cases", "steps"), "contact force after every step", "force"),
    Dataset("statistics/*", ("statistics",),
            "draws with a value, and their statistics: {label}", OF_QUANTITY, outer=_OUTER),
    Dataset("sensitivity/*/first", ("laws",),
            "first-order Sobol' index of every random value", outer=_OUTER),
    Dataset("sensitivity/*/total", ("laws",),
            "total Sobol' index of every random value", outer=_OUTER),
    Dataset("sensitivity/*/first_interval", ("laws", "bounds"), "its 95 % interval", outer=_OUTER),
    Dataset("sensitivity/*/total_interval", ("laws", "bounds"), "its 95 % interval", outer=_OUTER),
    Dataset("exceedance/quantity", _LIMITS, "name of the quantity", "", TEXTS),
    Dataset("exceedance/limit", _LIMITS,
            "limit, in the unit of the quantity; NaN: the threshold of each case"),
    Dataset("exceedance/probability", _LIMITS,
            "probability that the quantity exceeds the limit", outer=_OUTER),
    Dataset("exceedance/lower", _LIMITS,
            "lower end of its 95 % interval, whatever the open draws are", outer=_OUTER),
    Dataset("exceedance/upper", _LIMITS,
            "upper end of its 95 % interval, whatever the open draws are", outer=_OUTER),
    Dataset("exceedance/draws", _LIMITS, "number of draws that have a value", "", "i8", _OUTER),
    Dataset("exceedance/open", _LIMITS,
            "number of draws that ended before they had a value", "", "i8", _OUTER),
    Dataset("reduced/case", _TRIALS, "number of the case that was also run in full", "", "i8"),
    Dataset("reduced/peak_force", _TRIALS, "largest contact force of the reduced model", "force"),
    Dataset("reduced/full_peak_force", _TRIALS, "largest contact force of the full run", "force"),
    Dataset(f"reduced/{RATIO}", _TRIALS,
            "largest displacement under the load over the thickness, of the reduced model"),
    Dataset(f"reduced/full_{RATIO}", _TRIALS,
            "largest displacement under the load over the thickness, of the full run"),
    Dataset("reduced/exposure", _TRIALS, "exposure that differs most, of the reduced model"),
    Dataset("reduced/full_exposure", _TRIALS, "the same exposure of the full run"),
    Dataset("reduced/gage_strain", _TRIALS,
            "largest strain of a gage, with the largest difference of a gage"),
    Dataset("reduced/full_gage_strain", _TRIALS, "largest strain of a gage of the full run"),
)
LOCATION_DATASETS = _by_path(
    Dataset("locate/place", ("ndm",), "place of the impact", "length"),
    Dataset("locate/covariance", (2, 2), "covariance of the place", "length^2"),
    Dataset("locate/candidates", ("candidates", "ndm"), "places that were tried first", "length"),
    Dataset("locate/misfit", ("candidates",), "misfit there over the misfit of the located place"),
    Dataset("locate/force/time", ("rows",), "time", "time"),
    Dataset("locate/force/value", ("rows",), "fitted contact force", "force"),
    Dataset("locate/force/sd", ("rows",), "its standard deviation", "force"),
    Dataset("locate/force/determined", ("rows",),
            "1 if the strains determine the force", "", "i1"),
    Dataset("locate/gages/number", ("gages",), "number of every gage", "", "i4"),
    Dataset("locate/gages/place", ("gages", "ndm"), "its place", "length"),
    Dataset("locate/gages/gain", ("gages",), "its gain; 1 if it was not fitted"),
    Dataset("locate/gages/gain_sd", ("gages",), "standard deviation of the gain"),
    Dataset("locate/strains/time", ("rows",), "measured time", "time"),
    Dataset("locate/strains/measured", ("rows", "gages"), "measured strain"),
    Dataset("locate/strains/fitted", ("rows", "gages"), "fitted strain"),
)
# fmt: on


class FileSchema(NamedTuple):
    """Groups and datasets of a form of file."""

    deck: str  # description of the text ``deck``
    groups: Mapping[str, str]  # descriptions by path
    datasets: Mapping[str, Dataset]  # by path, in which ``*`` stands for any name


FILES = {
    Form.RUN: FileSchema(
        "the cards of the problem",
        {name: info.description for name, info in GROUPS.items()},
        DATASETS | _NAMED_DATASETS,
    ),
    Form.SWEEP: FileSchema(
        "the cards of the deck that was varied",
        {
            "cases": "values of what varies",
            "summary": "what came out of every case",
            "measured": "other columns of the table of cases, and their units as attributes",
            "history": "time steps of every case, and its contact force if asked for",
            "random": "laws of the random values",
            "design": "design that the random values were drawn from",
            "statistics": "statistics of every quantity over the draws",
            "sensitivity": "Sobol' indices of every quantity",
            "exceedance": "probabilities that quantities exceed limits",
            "reduced": "full runs beside the reduced model",
        },
        SWEEP_DATASETS,
    ),
    Form.LOCATION: FileSchema(
        "the cards of the deck of the plate",
        {
            "locate": "place of the impact",
            "locate/force": "fitted force at the peaks of its hats",
            "locate/gages": "gages whose strains were fitted",
            "locate/strains": "measured and fitted strains",
        },
        LOCATION_DATASETS,
    ),
}


def dataset_of(path: str, rank: int, form: Form = Form.RUN) -> Dataset | None:
    """Return the dataset of a path with this number of axes; None if the schema lacks it."""
    datasets, parts = FILES[form].datasets, path.split("/")
    dataset = datasets.get(path)
    if dataset is None and len(parts) > 1:
        pattern = datasets.get("/".join([parts[0], "*", *parts[2:]]))
        dataset = pattern and _named(pattern, path)
    if dataset is None:
        return None
    return dataset.with_outer() if dataset.outer and rank > len(dataset.shape) else dataset


def required_dataset(path: str, rank: int, form: Form = Form.RUN) -> Dataset:
    """Return the dataset of a path that is written; ValueError if the schema lacks it."""
    if (dataset := dataset_of(path, rank, form)) is None:
        raise ValueError(f"{path} is not in the schema of {form}")
    return dataset


def _named(dataset: Dataset, path: str) -> Dataset:
    """Return the dataset of a name in the place of ``*``.

    Its description has the name (``{label}``), or the description of the quantity of this name
    (``{text}``).
    """
    name = path.split("/")[1]
    quantity = COLUMNS.get(name)
    label = name if quantity is None else quantity.description
    dimension = dataset.dimension
    if dimension == OF_QUANTITY:
        dimension = "" if quantity is None else quantity.dimension
    description = dataset.description.format(name=name, text=described(name), label=label)
    return replace(dataset, path=path, description=description, dimension=dimension)


# Sizes of axes that every result has.
FIXED = {
    "faces": 2,
    "levels": 3,
    "directions": 2,
    "components": 3,
}
# Dimension scales: name and description by size.
SCALES = {
    "numnp": ("node", "number of the node"),
    "numel": ("element", "number of the element"),
    "ndm": ("axis", "name of the coordinate"),
    "nen": ("position", "position of the node in its element, from 1"),
    "npt": ("point", "number of the point in its element"),
    "nps": ("stress_point", "number of the stress point in its element"),
    "ndf": ("unknown", "name of the unknown"),
    "patch_nodes": ("patch_node", "position of the node among the nodes of the patch, from 1"),
    "members": ("member", "position of the element among the elements with ply stresses, from 1"),
    "npp": ("ply_point", "number of the point in its element"),
    "layers": ("ply", "number of the ply, from z = -h/2"),
    "interfaces": ("interface", "number of the interface, from 1 between plies 1 and 2"),
    "faces": ("face", "face of the ply: 1 at its lower z, 2 at its upper z"),
    "levels": ("level", "level in the ply: 1 at its lower z, 2 at its middle, 3 at its upper z"),
    "directions": ("direction", "1 is xz, 2 is yz"),
    "components": ("component", "name of the stress in the axes of the ply"),
    "criteria": ("criterion", "name of the failure criterion"),
    "laminates": ("laminate_position", "position of the laminate among the laminates, from 1"),
    "gages": ("gage", "position of the gage among the gages, from 1"),
    "cases": ("case", "number of the case, from 0"),
    "steps": ("step", "number of time steps taken"),
    "combinations": ("combination", "number of the combination of varied values, from 0"),
    "laws": ("random_name", "name of the random value"),
    "limits": ("limit_number", "number of the limit, from 1"),
    "statistics": ("statistic", "name of the statistic; percentages are quantiles"),
    "bounds": ("bound", "ends of the 95 % interval"),
    "candidates": ("candidate", "number of the candidate place"),
}
FROM_0 = ("cases", "combinations")
# Names of the positions of some axes.
AXIS_NAMES: dict[str | int, tuple[str, ...]] = {
    "ndf": DOF_NAMES,
    "ndm": AXES,
    "criteria": ALL_CRITERIA,
    "components": ("sigma_1", "sigma_2", "tau_12"),
    "statistics": ("draws", "mean", "standard_deviation", "1 %", "5 %", "50 %", "95 %", "99 %"),
    "bounds": ("lower", "upper"),
}
