"""Groups of a run's result: what each holds, and the macro that stores it."""

from __future__ import annotations

from fecm._dataclasses import frozen


@frozen
class GroupInfo:
    """What is known of a group before any run."""

    description: str
    macro: str = ""  # that stores it; empty if every run does, or a segment asks for it


GROUPS = {
    "mesh": GroupInfo("the finite element mesh"),
    "laminate": GroupInfo("stiffness of the laminate per area"),
    "tape3": GroupInfo("nodal displacements, stored by DISP", "DISP"),
    "tape8": GroupInfo("element strains, stored by RODP", "RODP"),
    "tape9": GroupInfo("contact and the projectile, stored by RODP", "RODP"),
    "history": GroupInfo(
        "contact and the projectile at every step; row n is the state after step n", "RODP"
    ),
    "energy": GroupInfo("energies at every step", "RODP"),
    "gages": GroupInfo("strain gages, read at every step", "RODP or EXCD"),
    "membrane": GroupInfo(
        "stretching of a nonlinear plate, at the rows of tape8; without impact at those of tape3"
    ),
    "stresses": GroupInfo("strains and stress resultants, stored by STRE", "STRE"),
    "patch": GroupInfo("nodal weights of the contact force"),
    "plies": GroupInfo("stresses ply by ply, stored by PLYS", "PLYS"),
    "threshold": GroupInfo(
        "delamination threshold: force of `number` delaminations, first crossing, margin of the "
        "peak; band: forces of one delamination in each of the `interfaces`, and of a single one"
    ),
    "failure": GroupInfo("largest exposures over time, found by FAIL", "FAIL"),
    "exposures": GroupInfo(
        "largest exposures so far outside the load, at every evaluation of FAIL", "FAIL"
    ),
    "reactions": GroupInfo("forces of the supports, stored by REAC", "REAC"),
    "modes": GroupInfo("natural modes, found by EIGE", "EIGE"),
}
STORED_BY = {name: info.macro for name, info in GROUPS.items() if info.macro}
