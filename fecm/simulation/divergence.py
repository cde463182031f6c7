"""Why a run diverges, as far as its time step tells."""

from __future__ import annotations

from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import name_of
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import ImpactModel
from fecm.problem.contact_estimates import contact_step
from fecm.problem.problem import Problem


def likely_cause(problem: Problem, model: ImpactModel, dt: float, law: Law | None = None) -> str:
    """Explain a divergence, as far as the time step does; `law` is a user's instead of EXPE's."""
    plate = model.motion.plate
    try:
        critical = critical_time_step(plate)
        contact = None
        if law is None:
            contact = contact_step(problem.deck, plate, problem.contact, dt, critical)
    except UnsoundPlateError as error:
        return str(error)
    side = "above" if dt > critical else "below"
    cause = f"DT = {dt:.4g} is {side} the plate's critical time step {critical:.4g}"
    if dt > critical:
        return cause
    if contact is not None and dt >= contact.limit:
        return (
            f"{cause}, but not below {contact.limit:.4g}, the stable step with the contact's "
            f"stiffness k_t of about {contact.stiffness:.3g} (the contact needs DT < "
            f"2 (m/k_t)^(1/2), m = {contact.mass:.3g})"
        )
    if len({macro.value for macro in problem.deck.macros if macro.word == "DT"}) > 1:
        return f"{cause}, but DT changes: steps that alternate diverge below the critical one"
    if law is not None:
        return (
            f"{cause}, but it may be too large for the stiffness of the contact law {name_of(law)}"
        )
    return cause
