"""Parameters fitted to a measured force, and their tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fecm._measured_tables import IN_MEMORY, Record
from fecm._table import Row, ShownNumber, Summary, Table, html_of
from fecm._text import FITTED_DIGITS
from fecm._typing import Floats
from fecm.authoring.values import dimension_of
from fecm.deck.model import Deck, Impact, Indentation, Projectile
from fecm.deck.units import quantity, readable, unit_names, unit_of
from fecm.identification.confirmation import FullRun
from fecm.identification.fitting import OF_RECORD
from fecm.judge.fits import Verdict, verdict_of
from fecm.results.groups import NotStoredError
from fecm.results.written import Reported

CARDS: dict[str, type[Impact | Indentation | Projectile]] = {
    **dict.fromkeys(("velocity", "energy"), Impact),
    **dict.fromkeys(("k", "alpha_p", "s_p", "q"), Indentation),
    **dict.fromkeys(("mass", "rod_length", "rod_modulus", "rod_density"), Projectile),
}
PLATE_ERRORS = "Change of the values with 1 % more of a property of the plate in the deck"


@dataclass(frozen=True, eq=False)
class Identification(Reported):
    """Parameters of an impact, fitted to a measured force.

    Attributes
    ----------
    values, errors : dict of str to float
        Fitted values and their standard errors, by name.
    start : dict of str to float
        Values before the fit.
    correlation : ndarray (names, names)
        Correlation matrix of the values, in their order.
    time, force, model : ndarray (points,)
        Measured times and forces that were fitted, and the fitted force at these times.
    converged : bool
        Whether the fit has converged.
    accepted : bool
        Whether the fit has converged, the model describes the data, and no delay or offset is
        missing among the parameters.
    plate_errors : dict of str to dict
        Changes of the fitted values with 1 % more ``"thickness"`` and 1 % more ``"e1"`` of the
        plate in the deck, linearised.
    deck : Deck
        The deck with the fitted values, rounded to five digits.
    notes : tuple of str
        Reasons to doubt the values, and remarks.
    doubts : tuple of str
        The notes that are reasons to doubt the values.
    law : str
        Name of the contact law that replaced EXPE; empty if none did. The deck has EXPE all the
        same.
    record : Record
        Name and SHA-256 (`file`, `sha256`) of the file of the measurement; empty texts for arrays.
    full_run : FullRun or None
        Full run of the fitted deck beside the fitted force, where the reduced model computed the
        trial forces (NONL).
    """

    values: dict[str, float]
    errors: dict[str, float]
    start: dict[str, float]
    correlation: Floats
    time: Floats
    force: Floats
    model: Floats
    converged: bool
    accepted: bool
    plate_errors: dict[str, dict[str, float]]
    deck: Deck
    notes: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    law: str = ""
    record: Record = IN_MEMORY
    full_run: FullRun | None = None

    @property
    def verdict(self) -> Verdict:
        """Whether the values are accepted: yes, with doubts (see `doubts`), or no."""
        return verdict_of(self.doubts, accepted=self.accepted)

    @property
    def residual(self) -> Floats:
        """Measured minus fitted force, (points,)."""
        return self.force - self.model

    @property
    def dof(self) -> int:
        """Degrees of freedom: points minus parameters."""
        return len(self.time) - len(self.values)

    @property
    def rms(self) -> float:
        """Standard deviation of the residual, with `dof` in its denominator (force)."""
        return float(np.sqrt(self.residual @ self.residual / self.dof))

    @property
    def share(self) -> float:
        """`rms` over the measured peak force."""
        return self.rms / float(self.force.max())

    @property
    def units(self) -> dict[str, str]:
        """Names of the units of length, force and time; empty if the deck names none."""
        return unit_names(self.deck)

    def unit(self, name: str) -> str:
        """Return the unit of a fitted value; empty for a pure number, or without named units.

        Raises
        ------
        NotStoredError
            If no such value was fitted; a KeyError.
        """
        if name not in self.values:
            raise NotStoredError(f"{name} was not fitted; there are {', '.join(self.values)}")
        return unit_of(OF_RECORD.get(name) or dimension_of(name), self.units)

    @property
    def _name(self) -> str:
        return "the measurement"

    def cards(self) -> str:
        """Return the cards of the deck with fitted values."""
        kinds = dict.fromkeys(CARDS[name] for name in self.values if name in CARDS)
        segments = (self.deck.require(kind) for kind in kinds)
        return "\n".join(
            line for segment in segments for line in segment.cards(self.deck.control)
        ).rstrip()

    def to_dict(self) -> dict[str, object]:
        """Return plain values, as printed by ``fecm identify --format json``."""
        return {
            **({"law": self.law} if self.law else {}),
            "record": self.record._asdict(),
            "values": {
                name: {"value": value, "error": self.errors[name], "start": self.start[name]}
                for name, value in self.values.items()
            },
            "correlation": self.correlation.tolist(),
            "points": len(self.time),
            "dof": self.dof,
            "rms": self.rms,
            "share": self.share,
            "converged": self.converged,
            "accepted": self.accepted,
            "verdict": self.verdict,
            "plate_errors": self.plate_errors,
            **({} if self.full_run is None else {"full_run": self.full_run._asdict()}),
            "notes": list(self.notes),
            "cards": self.cards(),
        }

    def __str__(self) -> str:
        return f"{summary_of_fit(self)}\n\n{self.cards()}"

    def __repr__(self) -> str:
        return f"<fecm identification of {', '.join(self.values)}: accepted {self.verdict}>"

    def _repr_html_(self) -> str:
        """Return answer, tables and notes, for notebooks."""
        return html_of(self, summary_of_fit(self))


def summary_of_fit(fit: Identification) -> Summary:
    """Return the fitted values in one line, the tables of the fit, and its notes."""
    values = ", ".join(f"{name} {_with_error(fit, name)}" for name in fit.values)
    verdicts = {"yes": "accepted", "no": "not accepted"}
    answer = f"{values}; {verdicts.get(fit.verdict, f'accepted {fit.verdict}')}"
    groups = tuple(identification_tables(fit))
    return Summary(fit.deck.title or "(no title)", answer, groups, fit.notes)


def _with_error(fit: Identification, name: str) -> str:
    """Format a fitted value with its standard error."""
    power, unit = readable(fit.values[name], fit.unit(name), FITTED_DIGITS)
    value, error = (number / 10.0**power for number in (fit.values[name], fit.errors[name]))
    return f"{value:.{FITTED_DIGITS}g} ± {error:.2g} {unit}".rstrip()


def identification_tables(fit: Identification) -> Iterator[Table]:
    """Yield tables: quality of the fit, its values, their correlations, effect of the plate."""
    yield _quality(fit)
    values = tuple(_value_row(fit, name) for name in fit.values)
    yield Table(values, ("parameter", "value", "standard error", "start"), "Fitted values")
    if len(fit.values) > 1:
        rows: list[Row] = [
            (name, *(ShownNumber(value, f"{value:.3f}") for value in row))
            for name, row in zip(fit.values, fit.correlation.tolist(), strict=True)
        ]
        yield Table(tuple(rows), ("correlation", *fit.values), "Correlations")
    if fit.plate_errors:
        rows = [_plate_error_row(fit, name) for name in fit.values]
        yield Table(tuple(rows), ("1 % more in the deck", *fit.plate_errors), PLATE_ERRORS)


def _quality(fit: Identification) -> Table:
    """Return the number of points, the residual, and whether the fit is accepted."""
    rms = quantity(fit.rms, unit_of("force", fit.units))
    rows: list[Row] = [
        ("points", f"{len(fit.time)}, {fit.dof} degrees of freedom"),
        ("residual", f"{rms} rms, {100.0 * fit.share:.2g} % of the peak"),
        ("converged", "yes" if fit.converged else "no"),
        ("accepted", fit.verdict),
    ]
    if fit.law:
        rows.append(("law", f"{fit.law}, instead of EXPE"))
    if fit.full_run is not None:
        rows += _full_run_rows(fit.full_run)
    if fit.record.file:
        rows.append(("record", str(fit.record)))
    return Table(tuple(rows), title="Fit")


def _full_run_rows(run: FullRun) -> Iterator[Row]:
    """Yield how the fitted force differs from the full run of the fitted deck."""
    difference = f"peak {run.peak:+.2%}, rms {run.misfit:.2%} of the peak"
    yield ("full run", f"difference of the fitted force: {difference}")
    alone = f"without full runs its peak differs by {run.alone:+.1%}"
    yield ("reduced model", f"{run.modes} modes of bending; {alone}")


def _value_row(fit: Identification, name: str) -> Row:
    """Return a parameter with its value, standard error and start."""
    power, unit = readable(fit.values[name], fit.unit(name), FITTED_DIGITS)

    def cell(value: float, digits: int = FITTED_DIGITS) -> ShownNumber:
        return ShownNumber(value, f"{value / 10.0**power:.{digits}g} {unit}".rstrip())

    return name, cell(fit.values[name]), cell(fit.errors[name], 2), cell(fit.start[name])


def _plate_error_row(fit: Identification, name: str) -> Row:
    """Return the changes of a parameter, relative to its value if the deck has it."""
    value = fit.values[name]
    changes = [errors[name] for errors in fit.plate_errors.values()]
    if name in CARDS and value:
        return (name, *(ShownNumber(c / value, f"{c / value:+.2%}") for c in changes))
    return (name, *(ShownNumber(c, f"{c:+.2g}") for c in changes))
