"""Slips: differences between the report's printed program and its text or evident intent.

Modes, single slips of a run and the errata page all come from this table;
:mod:`fecm.problem.build` turns slips into parameters.
"""

from __future__ import annotations

from collections.abc import Iterable

from fecm._frozen import frozen

REPORT = "report"
LISTING = "listing"
MODES = (REPORT, LISTING)


@frozen
class Slip:
    """One difference between the printed program and the report."""

    name: str  # its name on the command line
    listing: str  # behaviour of the printed program
    report: str  # what the report says or means


SLIPS = (
    Slip(
        "target",
        "The impact node's equation number is looked up before equations are numbered, so the "
        "contact law sees a plate at rest, although the force acts on the plate.",
        "The indentation is the projectile's approach less the plate's own displacement.",
    ),
    Slip(
        "density",
        "The rod's mass density is 0.0003225, its mass 8.49e-5 lb s²/in.",
        "The rod's mass density is 0.0006875, its mass 1.8096e-4, the .000181 of page 81.",
    ),
    Slip(
        "rod-start",
        "The rod's strain dofs start at the impact velocity too, which causes a spurious force of "
        "109 lb in the transducer.",
        "The rod starts as a rigid body: its strain dofs start at zero.",
    ),
    Slip(
        "reload",
        "The first fall of the force, however small, ends loading permanently, and the first rise "
        "after it starts reloading permanently.",
        "Loading, unloading and reloading may follow each other any number of times; the force "
        "is continuous at every turn.",
    ),
    Slip(
        "jacobian",
        "The inverse Jacobian is used transposed: harmless where element sides are parallel to "
        "the axes, wrong on nearly every other element.",
        "Derivatives are taken with the inverse Jacobian.",
    ),
    Slip(
        "station",
        "The transducer is E A du/dx at the rod's node 12 (x = 0.55 in), negative in compression.",
        "The transducer is the force at the rod's midpoint, positive in compression.",
    ),
    Slip(
        "tapes",
        "Contact goes to tape8 at every step; strains go to tape9, at Gauss points of order L1, "
        "one step old, and with γxz before γyz.",
        "Strains go to tape8 at the points that K names, γyz before γxz; contact goes to tape9; "
        "both every N steps and of the same instant.",
    ),
    Slip(
        "g12",
        "Where E1 = E2 the card's G12 is replaced by E1/2(1+ν12), as if the ply were isotropic.",
        "The card's G12 holds, as a woven ply needs it.",
    ),
    Slip(
        "shear-order",
        "L2 is read and not used; transverse shear is integrated with order L1.",
        "Bending is integrated with order L1, transverse shear with L2.",
    ),
    Slip(
        "time",
        "The macro TIME is skipped, so the clock of PROP and STRE stays at 0.",
        "TIME advances the clock by DT.",
    ),
    Slip(
        "prop",
        "The proportional load is evaluated at t = 0 only, and reading its table returns none.",
        "The proportional load is evaluated at the clock's time.",
    ),
    Slip(
        "force-scale",
        "Every FORC value is scaled by the contact force, prescribed displacements too.",
        "FORC has its proportional load; the contact force acts on the impact dof alone.",
    ),
    Slip(
        "rod-force",
        "ROD writes the contact force's unit load into FORC's array: it replaces FORC's value of "
        "the impact dof, and a FORC segment after ROD replaces it. The contact force on the "
        "plate is scaled by the value left there.",
        "The contact force and FORC's value both act on the plate, in any order of the segments.",
    ),
    Slip(
        "prop-contact",
        "PROP and the contact force share one variable: a PROP between two impact steps replaces "
        "the contact force on the plate in the next step.",
        "PROP scales FORC's values; the contact force is not scaled.",
    ),
    Slip(
        "counter",
        "RODP counts the steps since the last output, and compares them with the N on its "
        "card: where N changes, different rows are stored, or none.",
        "RODP stores at every N-th impact step since the problem began.",
    ),
    Slip(
        "small-stiffness",
        "Every entry of A, B and D below 1e-6 is set to 0, whatever the units are.",
        "A, B and D are those of the layers.",
    ),
    Slip(
        "rod-dt",
        "The rod's integration always uses the constants of the first DT.",
        "The rod's integration follows DT.",
    ),
    Slip(
        "check-end",
        "The macro CHEC ends the macro program.",
        "CHEC reports and the program goes on.",
    ),
)
NAMES = tuple(slip.name for slip in SLIPS)


# Statements that the computation does not confirm and no slip explains: section of the report, what
# it says, and the result of the computation.
CLAIMS = (
    (
        "section 4.4",
        "The present mesh of 14 x 10 elements yielded converged solutions.",
        "With 2, 4 and 8 times as many elements along each side the peak force of the first "
        "contact is 76.6, 75.9 and 75.5 lb instead of 78.7 lb, that of the second 83.5, 82.9 and "
        "82.2 lb instead of 86.2 lb. The lowest frequency of the plate is 0.5 % too high. "
        "The largest values of the curvatures κx and κy are up to 11 % off beside the impact "
        "node, and at an instant they differ by up to 35 %. At the impact node nothing converges: "
        "under the point force deflection and curvature grow with the logarithm of the "
        "refinement, transverse shear with the refinement itself. See "
        "[how far to trust a peak](trust.md).",
    ),
    (
        "section 4.4",
        "The time between two peaks of the ringing is about the time that a longitudinal wave "
        "takes from one end of the projectile to the other.",
        "The ringing has a period of 8.35 µs; a wave takes 4.79 µs from end to end, and 9.57 µs "
        "there and back. The period is shorter than the way there and back, as the rod is thinner "
        "at its struck end.",
    ),
)


def active_slips(mode: str = REPORT, single: Iterable[str] = ()) -> frozenset[str]:
    """Names of the slips that are on: single ones in report mode, all of them in listing mode.

    Raises ValueError if the mode or a slip is unknown, or single slips are given in listing mode.
    """
    names = frozenset(single)
    if mode not in MODES:
        raise ValueError(f"unknown mode {mode!r}; known are {', '.join(MODES)}")
    if unknown := sorted(names - set(NAMES)):
        raise ValueError(f"unknown slip {unknown[0]!r}; known are {', '.join(NAMES)}")
    if mode == LISTING:
        if names:
            raise ValueError("listing mode has every slip; single slips go with report mode")
        return frozenset(NAMES)
    return names


def mode_of(slips: frozenset[str]) -> str:
    """Mode of a result with these slips."""
    return LISTING if slips == frozenset(NAMES) else REPORT


def errata() -> str:
    """Write the errata page, in Markdown."""
    lines = [
        "# Errata: the report's program against the report",
        "",
        "`fecm run` follows the report's text (`--mode report`) or its printed program",
        "(`--mode listing`). They differ in the slips below. `--slip NAME`, which may be repeated,",
        "adds single ones to report mode, to show the effect of each.",
        "",
        "| slip | the printed program | the report |",
        "|---|---|---|",
        *(f"| `{slip.name}` | {slip.listing} | {slip.report} |" for slip in SLIPS),
        "",
        "## Statements that the computation does not confirm",
        "",
        "Text and program agree here, and both modes give the same.",
        "",
        "| where | the report | the computation |",
        "|---|---|---|",
        *(f"| {place} | {report} | {found} |" for place, report, found in CLAIMS),
        "",
    ]
    return "\n".join(lines)
