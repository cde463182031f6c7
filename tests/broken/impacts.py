"""Contact laws, impacts and their quick models broken on purpose."""

from __future__ import annotations

import fecm
from fecm.judge import end
from fecm.mechanics import impact as impacts
from fecm.mechanics import laminate as laminates
from fecm.mechanics import points, quick_models, strains
from fecm.mechanics.contact_law import (
    UNLOADING,
    VIRGIN,
    HystereticLaw,
    LinearPermanent,
    YangSunPermanent,
)
from fecm.mechanics.impact import ImpactSystem
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.projectile import RigidMass
from fecm.problem import parts
from fecm.results import metrics
from tests.breaks import (
    Breaks,
    changed,
    doubled,
    halved,
    in_numpy,
    instead,
    other_power,
    standing_plate,
    started_at_zero,
    turned,
    value,
    without_nodal_forces,
    work_of_the_new_force,
)

BREAKS: Breaks = {
    "k a^1.4": (
        value(fecm.mechanics.contact_law, "LOADING_POWER", 1.4),
        {
            "indentation": ("F(α_p)", "F at the peak", "F halfway down", "F back", "F halfway up",
                            "work", "ACR: F at the peak"),
            "rigid-target": ("deepest", "largest", "contact", "ACR"), "supported-plate": ("",),
            "curved-impact": ("peak", "time"), "small-mass": ("largest force of",),
        },
    ),
    "a quarter taken as the whole plate": (
        value(metrics, "SHARED", ()),
        {"supported-plate": ("largest force",)},
    ),
    "a peak passes at 0.8 of the force": (
        value(end, "FALLEN", 0.8),
        {"end-of-contact": ("plate half as fast", "share that decides a deflection which falls")},
    ),
    "a projectile leaves clearly at half of the plate's velocity": (
        value(end, "CLEAR", 0.5), {"end-of-contact": ("plate twice as fast",)},
    ),
    "a value that is largest at the last step is decided": (
        instead(end, "decided", lambda right, most, last, state: right(most, last - 1.0, state)),
        {"end-of-contact": ("share that decides a deflection which still",)},
    ),
    "permanent indentation halved": (
        changed(LinearPermanent, "permanent", halved),
        {"indentation": ("F halfway down", "F at α₀", "work"), "permanent-indentation": ("slope",)},
    ),
    "permanent indentation from the first touch on": (
        instead(LinearPermanent, "permanent", lambda right, law, peak: law.s_p * peak),
        {"permanent-indentation": ("largest value",)},
    ),
    "permanent indentation of ACR halved": (
        in_numpy(changed(YangSunPermanent, "permanent", halved)),
        {"indentation": ("ACR: F halfway", "ACR: F at α₀"),
         "rigid-target": ("ACR: contact", "ACR: velocity")},
    ),
    "the unloading power of ACR 2 for 5/2": (
        instead(YangSunPermanent, "__init__", other_power), {"indentation": ("ACR: F halfway",)},
    ),
    "unloading from nine tenths of the force": (
        turned(lambda before, after: bool(before.branch == VIRGIN), f=0.9),
        {"indentation": ("jump of F where unloading", "F halfway down", "work"),
         "rigid-target": ("velocity",)},
    ),
    "reloading always from the permanent indentation": (
        instead(HystereticLaw, "_reloading",
                lambda right, law, m, last: right(law, m, last._replace(force=0.0))),
        {"indentation": ("jump of F where reloading",)},
    ),
    "reloading to nine tenths of the peak": (
        changed(HystereticLaw, "_reloading", lambda curve: curve._replace(f=0.9 * curve.f)),
        {"indentation": ("F halfway up",)},
    ),
    "the first curve goes on at nine tenths": (
        turned(lambda before, after: bool(after.branch == VIRGIN), f=0.9),
        {"indentation": ("F back",)},
    ),
    "a steeper unloading": (
        turned(lambda before, after: bool(after.branch == UNLOADING), p=1.05),
        {"indentation": ("F halfway down", "work"), "rigid-target": ("velocity", "contact")},
    ),
    "a plate that does not move": (
        instead(ImpactSystem, "__init__", standing_plate),
        {"infinite-plate": ("",), "supported-plate": ("largest force",),
         "report-impact": ("worst",)},
    ),
    "half of the mass of a rigid projectile": (
        changed(RigidMass, "mass", halved),
        {"rigid-target": ("deepest", "largest", "contact"), "webassembly": ("",)},
    ),
    "a projectile that starts at w = 0": (
        in_numpy(instead(ImpactSystem, "advance", started_at_zero)),
        {"static-load": ("difference of the force", "difference of the indentation",
                         "difference of the velocity")},
    ),
    "nodal forces that the impact leaves out": (
        instead(PlateMotion, "advance", without_nodal_forces),
        {"static-load": ("difference",)},
    ),
    "action without equal reaction": (
        in_numpy(changed(ImpactSystem, "applied", lambda p: p._replace(force=1.01 * p.force))),
        {"report-impact": ("worst",)},
    ),
    "work of the new force alone": (
        in_numpy(instead(impacts, "couple_step", work_of_the_new_force)),
        {"report-impact": ("worst",)},
    ),
    "a patch of half the radius": (
        instead(points, "patch_weights",
                lambda right, mesh, shape, c, *place: right(mesh, shape, c / 2.0, *place)),
        {"patch-compliance": ("W",), "patch-impact": ("largest", "its time")},
    ),
    "Hertz's pressure taken for a uniform one": (
        instead(points, "patch_weights",
                lambda right, mesh, shape, *circle: right(mesh, points.DISC, *circle)),
        {"patch-compliance": ("W, Hertz",)},
    ),
    "MITC ignored": (
        changed(parts, "has_assumed_shear", lambda found: False), {"assumed-shear": ("w",)},
    ),
    "tying points on the sides of the element": (
        value(strains, "TYING", {9: (strains.TYING[9][0], (-1.0, 0.0, 1.0), 3)}),
        {"assumed-shear": ("γ_yz",)},
    ),
    "half of DAMP": (
        instead(PlateMotion, "__init__", lambda right, *a: right(*a[:-1], a[-1] / 2.0)),
        {"free-plate": ("",)},
    ),
    "D for 12 D in the delamination threshold": (
        changed(laminates, "threshold_force", lambda force: force / 12.0**0.5),
        {"threshold": ("",)},
    ),
    "Olsson's D* in the delamination threshold": (
        instead(laminates, "_agm", lambda right, a, b: (a * b) ** 0.5),
        {"threshold": ("the report", "the same")},
    ),
    "a tenth of the plate's inertia missing in Zener's parameter": (
        instead(quick_models, "infinite_plate", lambda right, *a: right(*a[:-1], a[-1] / 0.9**0.5)),
        {"small-mass": ("F T", "t_peak")},
    ),
    "4 for 8 in Zener's parameter": (
        changed(quick_models, "inelasticity", doubled),
        {"small-mass": ("λ", "largest force on")},
    ),
    "nine tenths of the plate's stiffness": (
        instead(quick_models, "static_peak", lambda right, *a: right(*a[:-1], 0.9 * a[-1])),
        {"large-mass": ("largest",)},
    ),
}  # fmt: skip
