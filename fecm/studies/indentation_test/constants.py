"""Parameters of the contact law from an indentation test, as text and as an EXPE card."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fecm._errors import StudyError
from fecm._table import aligned
from fecm._typing import Floats
from fecm.authoring.contact import Contact
from fecm.deck.model import Indentation
from fecm.mechanics.contact_law import (
    ACR_POWER,
    LOADING_POWER,
    ContactParameters,
    LinearPermanent,
    YangSunPermanent,
)
from fecm.studies.indentation_test.curves import (
    Critical,
    Curves,
    CurveSolution,
    FittedValue,
    PermanentLine,
    critical,
    fit_curves,
    fit_permanent_line,
    influence,
    r_squared,
    scaled,
)
from fecm.studies.indentation_test.turns import StretchKind, divide

LARGEST = 1e60  # largest number whose powers are finite
# Smallest error of a coordinate relative to the largest indentation, for tests without noise.
ROUNDING = 1e-9


class FreePower(NamedTuple):
    """First loading with a free power, F = k a^n (equation 3-1)."""

    n: FittedValue
    k: FittedValue  # force/length^n
    r_squared: float | None


def free_power(curves: Curves) -> FreePower:
    """Fit the first loading with a free power.

    The coefficient is fitted at the largest indentation, where it is almost independent of the
    power. The coefficient at unit indentation is far from every point and inherits the error of the
    power.
    """
    from scipy.optimize import least_squares  # takes 0.3 s, and most commands do not fit

    rows = curves.division.rows(StretchKind.LOADING)
    all_points = np.maximum(curves.a[rows], 0.0), curves.f[rows]
    a, f = (values[all_points[0] > 0.0] for values in all_points)
    start = [1.0, LOADING_POWER]
    c, n = least_squares(lambda p: f - p[0] * a ** p[1], start, xtol=1e-12, ftol=1e-12).x
    fitted = c * a**n
    _, influences = influence(np.stack([a**n, fitted * np.log(a)], axis=1), f - fitted)
    covariance = influences @ influences.T
    k = c * curves.force / curves.length**n
    derivatives = np.array([k / c, -k * np.log(curves.length)])
    return FreePower(
        FittedValue(float(n), float(covariance[1, 1] ** 0.5)),
        FittedValue(float(k), float((derivatives @ covariance @ derivatives) ** 0.5)),
        r_squared(c * all_points[0] ** n, all_points[1]),
    )


@dataclass(frozen=True)
class Cycle:
    """Unloading and reloading from a point of the first loading curve."""

    alpha_m: FittedValue  # largest indentation (length); the error is 0 for a recorded value
    alpha_m_recorded: float  # smoothed if noisy
    alpha_0: FittedValue  # permanent indentation (length)
    k_1: FittedValue  # reloading rigidity, equation 3-12, force/length^1.5
    # Like `k_1`, from the origin of the first reloading curve. None without reloading, and if the
    # reloading began without contact, because both are then equal.
    k_1_measured: FittedValue | None


@dataclass(frozen=True, eq=False)
class ContactLawFit:
    """Contact law fitted to a test, with its curves."""

    k: FittedValue  # contact coefficient with n = 3/2, force/length^1.5
    free: FreePower
    q: FittedValue | None  # unloading power; None if the test has no unloading
    cycles: tuple[Cycle, ...]
    line: PermanentLine | None  # None if fewer than two cycles leave an indentation
    critical: Critical | None  # if the law of equation 3-7 was requested
    r_squared: dict[str, float | None]  # of loading, unloading, reloading and permanent
    scatter: float  # root mean square of the residuals, relative to the largest force
    solution: CurveSolution

    def relation(self) -> ContactParameters | None:
        """Return the contact law with admissible values; None if alpha_0(alpha_m) is unknown."""
        k = self.k.value
        if self.critical is not None:
            return YangSunPermanent(k, self.critical.alpha_cr.value)
        if self.line is None or self.q is None:
            return None
        s_p = self.line.s_p.value
        if not 0.0 < s_p < 1.0:
            return LinearPermanent(k, 0.0, 0.0, self.q.value)
        return LinearPermanent(k, max(self.line.alpha_p.value, 0.0), s_p, self.q.value)


def fit_contact_law(
    indentation: ArrayLike,
    force: ArrayLike,
    *,
    retreat: float | None = None,
    q: float | None = None,
    acr: bool = False,
) -> ContactLawFit:
    """Fit the contact law to a test.

    Indentation and force, (n,), are positive in compression. They are in the order of measurement,
    from the first contact at zero. A decrease of the indentation by `retreat` (automatic if None)
    counts as a turn. The unloading power `q` is fitted if it is None. With `acr`, q is 5/2, and
    alpha_cr of equation 3-7 is fitted instead of s_p and alpha_p of equation 3-8. Raises StudyError
    if the points are not an indentation test.
    """
    a, f = np.asarray(indentation, dtype=float), np.asarray(force, dtype=float)
    if a.shape != f.shape or a.ndim != 1:
        raise StudyError("indentation and force differ in length")
    if len(a) < 10:
        raise StudyError(f"{len(a)} points are too few for a test")
    for name, values in (("indentations", a), ("forces", f)):
        if not 1.0 / LARGEST < float(np.abs(values).max()) < LARGEST:
            raise StudyError(f"the {name} are not between {1.0 / LARGEST:g} and {LARGEST:g}")
    curves = scaled(divide(a, retreat), a, f)
    solution = fit_curves(curves, ACR_POWER if acr else q)
    layout, division, p = solution.curves.layout, curves.division, solution.values
    peaks = [layout.corners[n] for n in division.peaks]
    places = peaks + layout.permanents
    covariance = solution.covariance[np.ix_(places, places)]
    if places:
        covariance = covariance + np.eye(len(places)) * (ROUNDING * p[peaks].max()) ** 2
    points = p[peaks], p[layout.permanents], covariance
    cycles = tuple(_cycle(solution, n) for n in range(len(peaks)))
    line = fit_permanent_line(*points) if not acr and len(cycles) > 1 else None
    of_curves = {
        kind.value: r_squared(*solution.curves.of(solution.scaled, kind)) for kind in StretchKind
    }
    fitted, measured = solution.curves.of(solution.scaled, *StretchKind)
    return ContactLawFit(
        k=_parameter(solution, layout.K),
        free=free_power(curves),
        q=_parameter(solution, layout.Q) if cycles else None,
        cycles=cycles,
        line=line,
        critical=critical(*points) if acr and cycles else None,
        r_squared={**of_curves, "permanent": _r_squared_of_line(line, *points[:2])},
        scatter=float(np.sqrt(np.mean((fitted - measured) ** 2))),
        solution=solution,
    )


def _r_squared_of_line(
    line: PermanentLine | None, peaks: Floats, permanents: Floats
) -> float | None:
    """Return R² of equation 3-8; None for fewer than three cycles."""
    if line is None or len(peaks) < 3:
        return None
    fitted = np.maximum(line.s_p.value * (peaks - line.alpha_p.value), 0.0)
    return r_squared(fitted, permanents)


def _parameter(solution: CurveSolution, place: int) -> FittedValue:
    """Return a parameter of the solution with its error."""
    error = max(float(solution.covariance[place, place]), 0.0) ** 0.5
    return FittedValue(float(solution.values[place]), error)


def _cycle(solution: CurveSolution, number: int) -> Cycle:
    """Return the values of a cycle and the rigidities derived from them."""
    layout, division = solution.curves.layout, solution.curves.division
    corner = division.peaks[number]
    peak, permanent = layout.corners[corner], layout.permanents[number]

    def rigidity(origin: int) -> FittedValue:
        def k_1(p: Floats) -> float:
            return float(p[layout.K] * (p[peak] / (p[peak] - p[origin])) ** LOADING_POWER)

        return solution.estimate(k_1)

    origins = [
        place for n, place in layout.origins.items() if division.stretches[n].cycle == number
    ]
    measured = rigidity(origins[0]) if origins else None
    recorded = division.corners[corner].indentation
    alpha_m, alpha_0 = _parameter(solution, peak), _parameter(solution, permanent)
    return Cycle(alpha_m, recorded, alpha_0, rigidity(permanent), measured)


DIGITS = 5  # digits on the card
NOT_ZERO = 2.0  # standard errors above which a slope differs from 0
BAD = 0.05  # scatter above which a note reports it


def law(fit: ContactLawFit) -> Contact | None:
    """Return the law, rounded as on a card; None if the test does not determine it."""
    relation = fit.relation()
    if isinstance(relation, YangSunPermanent):
        values, word = (relation.k, relation.alpha_cr, 0.0, relation.q), Indentation.ACR
    elif isinstance(relation, LinearPermanent):
        values, word = (relation.k, relation.alpha_p, relation.s_p, relation.q), ""
    else:
        return None
    k, alpha, s_p, q = (float(f"{value:.{DIGITS}g}") for value in values)
    return Contact(k, alpha, s_p, q, word)


def card(fit: ContactLawFit) -> str:
    """Return the EXPE segment; empty if the test does not determine all parameters."""
    contact = law(fit)
    return contact.text() if contact else ""


def fit_notes(fit: ContactLawFit) -> list[str]:
    """Return notes on the reliability of the fit."""
    notes: list[str] = []
    corners = [fit.solution.curves.division.corners[n] for n in fit.solution.held]
    held_cycles = [corner.cycle + 1 for corner in corners if corner.is_peak]
    if not fit.cycles:
        notes.append("the test has no unloading: it gives only k and n, and no card")
    elif fit.line is None and fit.critical is None:
        notes.append(
            "no card: s_p and alpha_p require two or more peaks with a permanent indentation; "
            "`acr` requires one"
        )
    if fit.solution.at_limit:
        notes.append("a value is at a bound of the fit: the law does not fit this test")
    if fit.scatter > BAD:
        notes.append(f"the points scatter by {100.0 * fit.scatter:.2g} % of the largest force")
    if held_cycles:
        cycle_numbers = ", ".join(map(str, sorted(held_cycles)))
        notes.append(
            f"alpha_m of cycle {cycle_numbers} is the recorded value: "
            "the curves do not determine it"
        )
    line = fit.line
    if line is not None:
        if line.s_p.value < NOT_ZERO * line.s_p.error or line.s_p.value >= 1.0:
            notes.append("s_p does not differ significantly from 0")
        if line.alpha_p.value < 0.0 < line.s_p.value:
            notes.append("alpha_p is negative; the card has 0")
        if line.elastic:
            cycle_numbers = ", ".join(str(n + 1) for n in line.elastic)
            notes.append(f"cycle {cycle_numbers} is below alpha_p and has no permanent indentation")
        if side := _find_side_of_line(fit.cycles, line):
            notes.append(
                f"the line of s_p and alpha_p is {side} all of its points: the test does not "
                "follow the law; compare n with 3/2, and fit single cycles to compare q"
            )
    scatter = line.scatter if line else fit.critical.scatter if fit.critical else 1.0
    if scatter > 1.0:
        notes.append(
            f"the scatter of the permanent indentations is {scatter:.1f} times that expected from "
            "the noise of the forces: the errors of their parameters are multiplied by it"
        )
    return notes


def _find_side_of_line(cycles: tuple[Cycle, ...], line: PermanentLine) -> str:
    """Return ``"above"`` or ``"below"`` if the line is there of all points, else an empty text.

    A line within the error of every point is on neither side.
    """
    slope, start = line.s_p.value, line.alpha_p.value
    points = [cycle for n, cycle in enumerate(cycles) if n not in line.elastic]
    deviations = [c.alpha_0.value - slope * (c.alpha_m.value - start) for c in points]
    errors = [max(c.alpha_0.error, 1e-6 * c.alpha_m.value) for c in points]
    if len(deviations) < 3 or not any(abs(o) > e for o, e in zip(deviations, errors, strict=True)):
        return ""
    return "above" if max(deviations) < 0.0 else "below" if min(deviations) > 0.0 else ""


def _format(estimate: FittedValue | None) -> str:
    """Format a value and its error."""
    if estimate is None:
        return "-"
    error = f" ± {estimate.error:.2g}" if estimate.error else ""
    return f"{estimate.value:.5g}{error}"


def _share(value: float | None) -> str:
    return "" if value is None else f"   R² {value:.5f}"


def fit_lines(fit: ContactLawFit) -> list[str]:
    """Return the fit as lines of text."""
    division = fit.solution.curves.division
    loading, falling, rising = (len(division.rows(kind)) for kind in StretchKind)
    shares = {kind: _share(value) for kind, value in fit.r_squared.items()}
    lines = [
        f"first loading   {loading} points",
        f"  k             {_format(fit.k)} (n = 3/2){shares[StretchKind.LOADING]}",
        f"  n             {_format(fit.free.n)}, with k {_format(fit.free.k)}"
        f"{_share(fit.free.r_squared)}",
    ]
    if fit.q is not None:
        lines.append(f"unloading       {falling} points")
        lines.append(f"  q             {_format(fit.q)}{shares[StretchKind.FALLING]}")
    if rising:
        lines.append(f"reloading       {rising} points{shares[StretchKind.RISING]}")
    if fit.line is not None:
        lines.append(f"permanent       {shares['permanent'].strip()}".rstrip())
        lines.append(f"  s_p           {_format(fit.line.s_p)}")
        lines.append(f"  alpha_p       {_format(fit.line.alpha_p)}")
    if fit.critical is not None:
        lines.append(f"alpha_cr        {_format(fit.critical.alpha_cr)}")
    lines.append(f"scatter         {100.0 * fit.scatter:.2g} % of the largest force")
    return [*lines, "", *_table(fit.cycles), ""] if fit.cycles else lines


def _table(cycles: tuple[Cycle, ...]) -> list[str]:
    rows: list[tuple[str, ...]] = [("cycle", "alpha_m", "alpha_0", "k_1", "k_1 of the reloading")]
    for n, c in enumerate(cycles, start=1):
        rows.append((str(n), *map(_format, (c.alpha_m, c.alpha_0, c.k_1, c.k_1_measured))))
    width = 4 if all(c.k_1_measured is None for c in cycles) else 5
    return aligned([row[:width] for row in rows])


def plain(fit: ContactLawFit) -> dict[str, Any]:
    """Return the fit as plain values for JSON."""
    line = fit.line
    constants = {
        "k": fit.k,
        "n": fit.free.n,
        "k_with_n": fit.free.k,
        "q": fit.q,
        "s_p": line.s_p if line else None,
        "alpha_p": line.alpha_p if line else None,
        "alpha_cr": fit.critical.alpha_cr if fit.critical else None,
    }
    return {
        **{name: asdict(estimate) if estimate else None for name, estimate in constants.items()},
        "r_squared": {**fit.r_squared, "loading_with_n": fit.free.r_squared},
        "scatter": fit.scatter,
        "cycles": [asdict(cycle) for cycle in fit.cycles],
        "notes": fit_notes(fit),
        "card": card(fit) or None,
    }
