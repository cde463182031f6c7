"""Values that can vary: the table of their names, their texts, and their application to a deck.

The table determines the checks of names, the help of the command and docs/sweep-names.md.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from enum import Enum, IntEnum, auto
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from fecm._errors import did_you_mean
from fecm.authoring import plate_values as plate
from fecm.authoring import strike_values as strike
from fecm.authoring import support_values as supports
from fecm.authoring.case import (
    PAIRS,
    Case,
    CasesError,
    Value,
    number_of_text,
    pair_of_text,
    parts_of_pair,
)
from fecm.authoring.parameters import ObjectError, parameter_in_units
from fecm.authoring.plate_values import PlateSetter, check_free_in_plane, free_in_plane
from fecm.authoring.strike_values import Strike, StrikeSetter, strike_of
from fecm.authoring.time_values import stable_time_step, with_time_step
from fecm.deck.grid import SUPPORTS
from fecm.deck.model import Deck
from fecm.deck.quantities import EXAMPLES, NUMBER, text_of
from fecm.deck.units import TOUGHNESS
from fecm.problem.parts import is_coupled, is_curved
from fecm.results.metrics import COLUMNS, VERDICTS

if TYPE_CHECKING:
    from fecm.authoring.changes import Parts

_Setter = TypeVar("_Setter", PlateSetter, StrikeSetter, None)


class ValueKind(Enum):
    """Kind of a value."""

    NUMBER = auto()
    INTEGER = auto()
    TEXT = auto()


class Changes(IntEnum):
    """Part of the deck that a value changes.

    The values of a case are applied in this order. Cases that differ only in values of FAILURE and
    STRIKE share a run of the plate. All other values need a run for each case.
    """

    FAILURE = auto()  # exposures or the threshold; they do not affect the motion
    LAMINATE = auto()
    PLATE = auto()  # mesh and supports
    PLACE = auto()  # impact point and patch
    STRIKE = auto()  # velocity, contact law and projectile
    TIME = auto()  # time step and duration


@dataclass(frozen=True)
class SweepValue(Generic[_Setter]):
    """Value that can vary."""

    name: str
    changes: Changes
    dimension: str  # dimension of its unit; empty for a pure number or a text
    setter: _Setter
    kind: ValueKind = ValueKind.NUMBER
    meaning: str = ""  # Markdown of docs/sweep-names.md


_MASS = "force*time^2/length"
_DENSITY = "force*time^2/length^4"
_STRESS = "force/length^2"
_SPEED = "length/time"

STRENGTHS = {
    "xt": "tensile strength along the fibres",
    "xc": "compressive strength along the fibres, positive,",
    "yt": "tensile strength across the fibres",
    "yc": "compressive strength across the fibres, positive,",
    "s12": "in-plane shear strength",
    "s13": "interlaminar shear strength along the fibres",
    "s23": "interlaminar shear strength across the fibres",
}

# fmt: off
STRIKE_VALUES: tuple[SweepValue[StrikeSetter], ...] = (
    SweepValue("velocity", Changes.STRIKE, _SPEED, strike.set_velocity,
             meaning="approach velocity of `ROD`"),
    SweepValue("energy", Changes.STRIKE, "force*length", strike.set_energy,
             meaning="½ m v² of the projectile, instead of `velocity`; with the mass of the case. "
                     "Of [half or a quarter of a plate]"
                     "(making.md#half-or-a-quarter-of-a-plate) the energy of the whole impact"),
    SweepValue("k", Changes.STRIKE, "force/length^1.5", strike.constant("k"),
             meaning="contact coefficient of `EXPE`"),
    SweepValue("radius", Changes.STRIKE, "length", strike.set_radius,
             meaning="radius of a steel sphere, instead of `k`: [its k](#radius-of-the-sphere) on "
                     "the laminate of the case"),
    SweepValue("alpha_p", Changes.STRIKE, "length", strike.constant("alpha_p"),
             meaning="critical indentation of `EXPE`"),
    SweepValue("s_p", Changes.STRIKE, "", strike.constant("s_p"),
             meaning="constant of `EXPE`"),
    SweepValue("q", Changes.STRIKE, "", strike.constant("q"),
             meaning="unloading power of `EXPE`"),
    SweepValue("mass", Changes.STRIKE, _MASS, strike.set_mass,
             meaning="mass of the projectile; changes the density of a rod"),
    SweepValue("rod_mass", Changes.STRIKE, _MASS, strike.set_mass,
             meaning="the same as `mass`"),
    SweepValue("rod_length", Changes.STRIKE, "length", strike.projectile_value("rod_length"),
             meaning="length of the rod (`PROJ`, or the rod of the report)"),
    SweepValue("rod_modulus", Changes.STRIKE, _STRESS,
             strike.projectile_value("rod_modulus"),
             meaning="Young's modulus of the rod"),
    SweepValue("rod_density", Changes.STRIKE, _DENSITY,
             strike.projectile_value("rod_density"),
             meaning="density of the rod"),
    SweepValue("giic", Changes.FAILURE, TOUGHNESS, strike.set_toughness,
             meaning="toughness G_IIc of `DELA`; only the delamination threshold depends on it"),
)
PLATE_VALUES: tuple[SweepValue[PlateSetter], ...] = (
    SweepValue("at", Changes.PLACE, "", plate.set_place, ValueKind.TEXT,
             meaning="[impact point](#impact-point) `(x,y)`"),
    SweepValue("impact_node", Changes.PLACE, "", plate.set_impact_node, ValueKind.INTEGER,
             meaning="node of `ROD`"),
    SweepValue("patch", Changes.PLACE, "length", plate.patch_field("radius"),
             meaning="radius of the patch (`PATC`; a deck without one gets a disc at the impact "
                     "node)"),
    SweepValue("x0", Changes.PLACE, "length", plate.patch_field("x"),
             meaning="centre of the patch; with `y0`, unless the deck gives that"),
    SweepValue("y0", Changes.PLACE, "length", plate.patch_field("y"),
             meaning="centre of the patch; with `x0`, unless the deck gives that"),
    SweepValue("laminate_thickness", Changes.LAMINATE, "length", plate.set_thickness,
             meaning="thickness of the laminate; every ply is scaled"),
    SweepValue("ply_thickness", Changes.LAMINATE, "length", plate.set_ply_thickness,
             meaning="thickness of every ply; all plies have the same"),
    SweepValue("thickness", Changes.LAMINATE, "length", plate.set_thickness,
             meaning="the same as `laminate_thickness`"),
    SweepValue("density", Changes.LAMINATE, _DENSITY, plate.ply_property("density"),
             meaning="density of the ply of `MATE`"),
    SweepValue("nu12", Changes.LAMINATE, "", plate.ply_property("nu12"),
             meaning="Poisson's ratio of the ply"),
    SweepValue("e1", Changes.LAMINATE, _STRESS, plate.ply_property("e1"),
             meaning="Young's modulus of the ply along the fibres"),
    SweepValue("e2", Changes.LAMINATE, _STRESS, plate.ply_property("e2"),
             meaning="Young's modulus of the ply across the fibres"),
    SweepValue("g12", Changes.LAMINATE, _STRESS, plate.ply_property("g12"),
             meaning="shear modulus in the plane of the ply"),
    SweepValue("g13", Changes.LAMINATE, _STRESS, plate.ply_property("g13"),
             meaning="transverse shear modulus along the fibres"),
    SweepValue("g23", Changes.LAMINATE, _STRESS, plate.ply_property("g23"),
             meaning="transverse shear modulus across the fibres"),
    SweepValue("layup", Changes.LAMINATE, "", plate.set_layup, ValueKind.TEXT,
             meaning="[layup](layups.md#layups), with the ply thickness of the deck"),
    SweepValue("layer_materials", Changes.LAMINATE, "", plate.set_layer_materials, ValueKind.TEXT,
             meaning="numbers of the materials of the layers, written as a layup's angles: "
                     "`[1/2]s`; `layup` keeps each layer's"),
    SweepValue("angle", Changes.LAMINATE, "", plate.add_angle,
             meaning="degrees added to the angle of every ply"),
    SweepValue("preload_x", Changes.LAMINATE, "force/length", plate.preload_force("n_x"),
             meaning="membrane force N0x of `PREL`, tension positive; a deck without `PREL` gets "
                     "one"),
    SweepValue("preload_y", Changes.LAMINATE, "force/length", plate.preload_force("n_y"),
             meaning="the same for N0y"),
    SweepValue("preload_xy", Changes.LAMINATE, "force/length", plate.preload_force("n_xy"),
             meaning="the same for N0xy"),
    SweepValue("radius_x", Changes.LAMINATE, "length", plate.curvature_radius("radius_x"),
             meaning="radius of a [curved panel](curved.md) (`CURV`), 0 is flat; the deck leaves u "
                     "and v free"),
    SweepValue("radius_y", Changes.LAMINATE, "length", plate.curvature_radius("radius_y"),
             meaning="the same for Ry"),
    *(SweepValue(name, Changes.FAILURE, _STRESS, plate.strength(name),
               meaning=f"{text} of the ply of `MATE` (`ALLO`); only exposures depend on it")
      for name, text in STRENGTHS.items()),
    SweepValue("cure_dT", Changes.FAILURE, "", plate.set_cure,
             meaning="change of temperature of `CURE`, K; only exposures depend on it"),
    SweepValue("size", Changes.PLATE, "", plate.set_size, ValueKind.TEXT,
             meaning="`AxB`: sides of the plate; coordinates are scaled along x and y, and with "
                     "them the centre of the patch and the gages"),
    SweepValue("support", Changes.PLATE, "", plate.set_support, ValueKind.TEXT,
             meaning="`free`, `soft`, `simple`, `pinned` or `clamped`: "
                     "[support](supports.md#sweeps-over-supports) of the outline"),
    SweepValue("edge_kr", Changes.PLATE, "", supports.set_edge_rotation,
             meaning="factor of the stiffness of the rotations on all `SPRI LINE` "
                     "([elastic edges](supports.md#elastic-edges))"),
    SweepValue("edge_kw", Changes.PLATE, "", supports.set_edge_w,
             meaning="factor of the stiffness of w on all `SPRI LINE`"),
    SweepValue("clamp_k", Changes.PLATE, "force/length", supports.set_clamp,
             meaning="stiffness of w of the `SPRI` at nodes, as the clamps of a fixture"),
    SweepValue("window_k", Changes.PLATE, _STRESS, supports.set_window,
             meaning="stiffness per length of `UNIL LINE`, as the window that pushes; 0 is the "
                     "default"),
    SweepValue("gap", Changes.PLATE, "length", supports.set_gap,
             meaning="gap of all one-sided supports (`UNIL`)"),
)
TIME_VALUES: tuple[SweepValue[None], ...] = (  # set together, after all other values
    SweepValue("dt", Changes.TIME, "time", None,
             meaning="[time step](#time-step-and-duration), or `auto`; the duration is kept"),
    SweepValue("duration", Changes.TIME, "time", None,
             meaning="simulated time, rounded up to a step"),
)
# fmt: on
REFINEMENT = SweepValue("refine", Changes.PLATE, "", plate.refine)  # only for refinement studies
REFINE = REFINEMENT.name
VARIABLES: dict[str, SweepValue[PlateSetter] | SweepValue[StrikeSetter] | SweepValue[None]] = {
    **{variable.name: variable for variable in STRIKE_VALUES},
    **{variable.name: variable for variable in PLATE_VALUES},
    **{variable.name: variable for variable in TIME_VALUES},
}
NAMES = tuple(VARIABLES)
EXCLUDING = (  # groups of names; only one name of a group can vary
    ("velocity", "energy"),
    ("k", "radius"),
    ("mass", "rod_mass", "rod_density"),
    ("at", "impact_node"),
    ("at", "x0"),
    ("at", "y0"),
    ("laminate_thickness", "ply_thickness", "thickness"),
)
# Names of results. They can't be names of values or of measured columns.
RESERVED = ("case", "step", "steps", "force", "unsettled_steps", *VERDICTS, *COLUMNS)


def names_of(*changes: Changes) -> tuple[str, ...]:
    """Return the names of the values that change one of some parts."""
    return tuple(name for name, variable in VARIABLES.items() if variable.changes in changes)


PLATE_NAMES = names_of(Changes.PLACE, Changes.LAMINATE, Changes.PLATE, Changes.TIME)
FAILURE_NAMES = names_of(Changes.FAILURE)
EXPOSURE_NAMES = ("cure_dT", *STRENGTHS)  # values that change only exposures
LAW_VALUES = ("k", "radius", "alpha_p", "s_p", "q")  # values of EXPE
OF_PLATE = frozenset((*PLATE_NAMES, REFINE))  # values that need another run of the plate


def kind_of(name: str) -> ValueKind:
    """Return the kind of a value."""
    return VARIABLES[name].kind


def dimension_of(name: str) -> str:
    """Return the dimension of a value; empty if the name is not in the table."""
    return VARIABLES[name].dimension if name in VARIABLES else ""


def check_names(names: Collection[str]) -> None:
    """Raise CasesError if two of the names exclude each other."""
    for group in EXCLUDING:
        if len(present := [name for name in group if name in names]) > 1:
            raise CasesError(f"{present[0]} and {present[1]} exclude each other; vary one of them")


def check_known(name: str, where: str, names: Collection[str] = NAMES) -> None:
    """Raise CasesError if a name is not one of `names`."""
    if name not in names:
        alternatives = did_you_mean(str(name), names) or f"; the names are {', '.join(names)}"
        raise CasesError(f"{where}: `{name}` cannot be varied{alternatives}")


def check_free(name: object, where: str) -> None:
    """Raise CasesError if a name chosen by the caller can't be the name of a column."""
    if fault := name_fault(name):
        raise CasesError(f"{where}: {fault}")


def name_fault(name: object) -> str:
    """Explain why a name can't be the name of a column; empty if it can."""
    if not (isinstance(name, str) and name.isidentifier()):
        return f"`{name}` is not a name such as width"
    return f"`{name}` is a name of the results; choose another" if name in RESERVED else ""


def without_unit(name: str, text: str, system: str | None) -> str:
    """Convert a number with a unit, such as ``10J``, to a system of units, and drop the unit.

    Other texts stay as they are. Raises CasesError if the unit does not have the dimension of the
    value, or the deck has no system of units.
    """
    match = re.fullmatch(rf"\s*{NUMBER}\s*(\S.*)?", text)
    if match is None or match[1] is None:
        return text
    dimension = "length" if name in PAIRS else dimension_of(name)
    if dimension not in EXAMPLES:
        raise CasesError(f"{name} must be a finite number, not `{text.strip()}`")
    if system is None:
        raise CasesError(
            f"{name}: `{text.strip()}` has a unit, but the deck names no units; add UNIT to it, or "
            "leave out the unit"
        )
    try:
        return repr(parameter_in_units(name, text, dimension, system))
    except ObjectError:
        raise CasesError(
            f"{name} must be a finite number, or one with a unit as in {EXAMPLES[dimension]}, not "
            f"`{text.strip()}`"
        ) from None


def _normal_pair(name: str, text: str, system: str | None) -> str:
    """Return a text of two lengths in its usual form, in a system of units."""
    parts = (without_unit(name, part, system) for part in parts_of_pair(name, text))
    form, _ = PAIRS[name]
    return form.format(*(repr(number_of_text(name, n)).removesuffix(".0") for n in parts))


def parse_value(name: str, text: str, system: str | None = None) -> Value:
    """Parse the value of a name; raise CasesError if it is invalid.

    A value with a unit is converted to the given system of units.
    """
    if name in PAIRS:
        return _normal_pair(name, text, system)
    if name == "support" and text.strip() not in SUPPORTS:
        raise CasesError(f"support must be {', '.join(SUPPORTS)}, not `{text.strip()}`")
    if kind_of(name) is ValueKind.TEXT:
        return text.strip()
    is_auto = name == "dt" and text.strip() == "auto"
    value = 0.0 if is_auto else number_of_text(name, without_unit(name, text, system))
    if kind_of(name) is ValueKind.NUMBER:
        return value
    if not value.is_integer():
        raise CasesError(f"{name} must be an integer, not {value:g}")
    return int(value)


def value_of(name: str, value: object, where: str, system: str | None = None) -> Value:
    """Convert a Python object to the value of a name; raise CasesError if it is invalid.

    A text with a unit, or a quantity, is converted to the given system of units.
    """
    value = text_of(value)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        raise CasesError(f"{where}: {name} can't be {value}")
    if (
        kind_of(name) is ValueKind.TEXT
        and isinstance(value, Iterable)
        and not isinstance(value, str)
    ):
        separator = {"at": ",", "size": "x"}.get(name, "/")
        value = separator.join(str(text_of(item)).replace(" ", "") for item in value)
    try:
        # float() raises for other objects than numbers
        text = value if isinstance(value, str) else repr(float(value))  # type: ignore[arg-type]
        return parse_value(name, text, system)
    except (TypeError, ValueError) as error:
        text = str(error) if isinstance(error, CasesError) else f"{name} can't be {value!r}"
        if isinstance(value, Iterable) and not isinstance(value, str):
            text = (
                f"{name} is one value, not a {type(value).__name__} of values; fecm.sweep runs a "
                f'deck with several: fecm.sweep(deck, {{"{name}": values}})'
            )
        raise CasesError(f"{where}: {text}") from None


def free_value_of(name: str, value: object, where: str) -> Value:
    """Return the value of a name chosen by the caller: a finite number or a text."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, str) or (isinstance(value, float | int) and math.isfinite(value)):
        return value
    raise CasesError(f"{where}: {name} is {value!r}, not a finite number or a text")


# Application --------------------------------------------------------------------------------------

_AppliedSetter = TypeVar("_AppliedSetter", PlateSetter, StrikeSetter)
# Values are applied in the order of the parts that they change, and then of the table. Exceptions:
# a layup takes the ply thickness of the deck, the centre of a patch needs the patch, and a mass or
# an energy needs the rest of the projectile.
_EARLY = ("layup", "angle")
_LATE = ("at", "mass", "rod_mass", "energy")


def _ordered_setters(
    variables: Iterable[SweepValue[_AppliedSetter]],
) -> dict[str, _AppliedSetter]:
    def rank(variable: SweepValue[_AppliedSetter]) -> tuple[int, bool, int]:
        late = _LATE.index(variable.name) if variable.name in _LATE else -1
        return variable.changes, variable.name not in _EARLY, late

    return {variable.name: variable.setter for variable in sorted(variables, key=rank)}


_PLATE_SETTERS = _ordered_setters((REFINEMENT, *PLATE_VALUES))
_STRIKE_SETTERS = _ordered_setters(STRIKE_VALUES)


def apply_case(deck: Deck, case: Case, objects: Parts | None = None) -> Deck:
    """Return a deck with new parts, `objects`, and then with the values of a case.

    A layup takes the ply thickness of the deck, so more plies give a thicker plate. The thickness
    of the laminate scales all layers. A mass scales the density of a rod. A time step changes the
    number of steps, and the duration stays. The time step 0 is 0.9 of the critical time step of the
    case. A deck without a patch gets a disc.

    A deck with B = 0 may restrain u and v at every node, because they are zero anyway. If the case
    has B != 0, only nodes that restrain w restrain them, as in a deck of ``fecm new``.

    Raises CasesError if a value is invalid for this deck.
    """
    check_names(case)
    changed = deck
    if objects is not None:
        point = pair_of_text("at", str(case["at"])) if "at" in case else None
        changed = objects.with_plate(deck, point)
        if objects.plate is not None:  # the new plate has this impact point already
            case = {name: value for name, value in case.items() if name != "at"}
    for name, setter in _PLATE_SETTERS.items():
        if name in case:
            changed = setter(changed, case[name])
    if objects is not None:
        changed = objects.with_strike(changed)
    if not case.keys().isdisjoint(_STRIKE_SETTERS):
        changed = strike_of_case(changed, case).deck()
    if not is_coupled(deck) and is_coupled(changed):
        changed = free_in_plane(changed)
    if is_curved(changed) and not is_curved(deck):
        check_free_in_plane(changed)
    return replace(_apply_times(deck, changed, case), text="")


def with_exposure_values(plate: Deck, case: Case) -> Deck:
    """Return the deck of a plate with the strengths and the residual stresses of a case."""
    for name in EXPOSURE_NAMES:
        if name in case:
            plate = _PLATE_SETTERS[name](plate, case[name])
    return plate


def strike_of_case(plate: Deck, case: Case) -> Strike:
    """Return the strike of a plate with the values of a case; ignore other values of the plate."""
    strike = strike_of(with_exposure_values(plate, case))
    for name, setter in _STRIKE_SETTERS.items():
        if name in case:
            strike = setter(strike, case[name])
    return strike


def _apply_times(deck: Deck, changed: Deck, case: Case) -> Deck:
    """Apply the time step and the duration of a case to a deck that has its other values."""
    dt, duration = (float(case[n]) if n in case else None for n in ("dt", "duration"))
    if duration is not None and not duration > 0.0:
        raise CasesError(f"duration must be positive, not {duration:g}")
    if dt == 0.0:
        dt = stable_time_step(changed)
    if dt is None and duration is None:
        return changed
    is_fixed = all(macro.value for macro in deck.macros if macro.word == "DT")
    return with_time_step(changed, dt, 0.0 if is_fixed else stable_time_step(deck), duration)
