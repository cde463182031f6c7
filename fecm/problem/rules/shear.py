"""Rules about the SHEA segment."""

from __future__ import annotations

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule

FIELD = "shear correction factor"


@rule(
    "E427",
    Subject.POINTS,
    "The shear correction factor is not positive.",
    remedy="1 as in the report, or π²/12.",
)
def invalid_factor(segment: model.Shear) -> Reports:
    """Find a factor that removes the shear stiffness."""
    if not segment.factor > 0.0:
        message = f"The shear correction factor is {segment.factor:g}; it must be positive."
        hint = "1 as in the report, or pi^2/12 = 0.822467"
        yield Report(message, segment.place(FIELD), hint)


@rule(
    "W428",
    Subject.POINTS,
    "The shear correction factor is more than 1.",
    remedy="At most 1.",
)
def large_factor(segment: model.Shear) -> Reports:
    """Find a factor that makes the plate stiffer than its laminate."""
    if segment.factor > 1.0:
        message = f"The shear correction factor is {segment.factor:g}, more than 1."
        yield Report(message, segment.place(FIELD))


@rule(
    "W481",
    Subject.POINTS,
    "SHEA EQUI has a factor other than 1.",
    cause="The stiffness is reduced twice.",
    remedy="Leave out the factor.",
)
def factor_with_equilibrium(segment: model.Shear) -> Reports:
    """Find a factor beside the stiffness from equilibrium."""
    if segment.equilibrium and segment.factor != 1.0:
        message = (
            f"SHEA has EQUI and the factor {segment.factor:g}: the stiffness from equilibrium is "
            "reduced once more."
        )
        hint = "leave out the factor's card; a factor is for the sum of the plies' stiffnesses"
        yield Report(message, segment.place(FIELD), hint)


OF_SHEAR = (invalid_factor, large_factor, factor_with_equilibrium)
