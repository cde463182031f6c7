"""Fits of an indentation test as text, as plain values and as an EXPE card."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fecm._tables import aligned
from fecm.authoring.contact import Contact
from fecm.deck.model import Indentation
from fecm.mechanics.contact_law import LinearPermanent, YangSunPermanent
from fecm.studies.indentation_test.constants import Cycle, Fit
from fecm.studies.indentation_test.curves import Estimate
from fecm.studies.indentation_test.permanent import Line
from fecm.studies.indentation_test.turns import Kind

DIGITS = 5  # digits on the card
NOT_ZERO = 2.0  # standard errors within which a slope does not differ from 0
BAD = 0.05  # scatter that triggers a note


def law(fit: Fit) -> Contact | None:
    """Return the law in the digits of a card; None if the test does not determine it."""
    relation = fit.relation()
    if isinstance(relation, YangSunPermanent):
        values, word = (relation.k, relation.alpha_cr, 0.0, relation.q), Indentation.ACR
    elif isinstance(relation, LinearPermanent):
        values, word = (relation.k, relation.alpha_p, relation.s_p, relation.q), ""
    else:
        return None
    k, alpha, s_p, q = (float(f"{value:.{DIGITS}g}") for value in values)
    return Contact(k, alpha, s_p, q, word)


def card(fit: Fit) -> str:
    """Return the EXPE segment; empty if the test does not determine all parameters."""
    found = law(fit)
    return found.text() if found else ""


def notes(fit: Fit) -> list[str]:
    """Return notes on the reliability of the fit."""
    found: list[str] = []
    corners = [fit.solution.curves.division.corners[n] for n in fit.solution.held]
    held = [corner.cycle + 1 for corner in corners if corner.is_peak]
    if not fit.cycles:
        found.append("the test has no unloading: it gives only k and n, and no card")
    elif fit.line is None and fit.critical is None:
        found.append(
            "no card: s_p and alpha_p require two or more peaks with a permanent indentation; "
            "`acr` requires one"
        )
    if fit.solution.at_limit:
        found.append("a value is at a bound of the fit: the law does not fit this test")
    if fit.scatter > BAD:
        found.append(f"the points scatter by {100.0 * fit.scatter:.2g} % of the largest force")
    if held:
        which = ", ".join(map(str, sorted(held)))
        found.append(
            f"alpha_m of cycle {which} is the recorded value: the curves do not determine it"
        )
    straight = fit.line
    if straight is not None:
        if straight.s_p.value < NOT_ZERO * straight.s_p.error or straight.s_p.value >= 1.0:
            found.append("s_p does not differ significantly from 0")
        if straight.alpha_p.value < 0.0 < straight.s_p.value:
            found.append("alpha_p is negative; the card has 0")
        if straight.elastic:
            which = ", ".join(str(n + 1) for n in straight.elastic)
            found.append(f"cycle {which} is below alpha_p and has no permanent indentation")
        if side := _one_side(fit.cycles, straight):
            found.append(
                f"the line of s_p and alpha_p is {side} all of its points: the test does not "
                "follow the law; compare n with 3/2, and fit single cycles to compare q"
            )
    scatter = straight.scatter if straight else fit.critical.scatter if fit.critical else 1.0
    if scatter > 1.0:
        found.append(
            f"the scatter of the permanent indentations is {scatter:.1f} times that expected from "
            "the noise of the forces: the errors of their parameters are multiplied by it"
        )
    return found


def _one_side(cycles: tuple[Cycle, ...], straight: Line) -> str:
    """Return whether the line is ``"above"`` or ``"below"`` all points by more than an error."""
    slope, start = straight.s_p.value, straight.alpha_p.value
    points = [cycle for n, cycle in enumerate(cycles) if n not in straight.elastic]
    off = [c.alpha_0.value - slope * (c.alpha_m.value - start) for c in points]
    least = [max(c.alpha_0.error, 1e-6 * c.alpha_m.value) for c in points]
    if len(off) < 3 or not any(abs(o) > e for o, e in zip(off, least, strict=True)):
        return ""
    return "above" if max(off) < 0.0 else "below" if min(off) > 0.0 else ""


def _format(estimate: Estimate | None) -> str:
    """Format a value and its error."""
    if estimate is None:
        return "-"
    error = f" ± {estimate.error:.2g}" if estimate.error else ""
    return f"{estimate.value:.5g}{error}"


def _share(value: float | None) -> str:
    return "" if value is None else f"   R² {value:.5f}"


def lines(fit: Fit) -> list[str]:
    """Return the fit as lines of text."""
    division = fit.solution.curves.division
    loading, falling, rising = (len(division.rows(kind)) for kind in Kind)
    shares = {kind: _share(value) for kind, value in fit.r_squared.items()}
    found = [
        f"first loading   {loading} points",
        f"  k             {_format(fit.k)} (n = 3/2){shares[Kind.LOADING]}",
        f"  n             {_format(fit.free.n)}, with k {_format(fit.free.k)}"
        f"{_share(fit.free.r_squared)}",
    ]
    if fit.q is not None:
        found.append(f"unloading       {falling} points")
        found.append(f"  q             {_format(fit.q)}{shares[Kind.FALLING]}")
    if rising:
        found.append(f"reloading       {rising} points{shares[Kind.RISING]}")
    if fit.line is not None:
        found.append(f"permanent       {shares['permanent'].strip()}".rstrip())
        found.append(f"  s_p           {_format(fit.line.s_p)}")
        found.append(f"  alpha_p       {_format(fit.line.alpha_p)}")
    if fit.critical is not None:
        found.append(f"alpha_cr        {_format(fit.critical.alpha_cr)}")
    found.append(f"scatter         {100.0 * fit.scatter:.2g} % of the largest force")
    return [*found, "", *_table(fit.cycles), ""] if fit.cycles else found


def _table(cycles: tuple[Cycle, ...]) -> list[str]:
    rows: list[tuple[str, ...]] = [("cycle", "alpha_m", "alpha_0", "k_1", "k_1 of the reloading")]
    for n, c in enumerate(cycles, start=1):
        rows.append((str(n), *map(_format, (c.alpha_m, c.alpha_0, c.k_1, c.k_1_measured))))
    width = 4 if all(c.k_1_measured is None for c in cycles) else 5
    return aligned([row[:width] for row in rows])


def plain(fit: Fit) -> dict[str, Any]:
    """Return the fit as plain values for JSON."""
    straight = fit.line
    constants = {
        "k": fit.k,
        "n": fit.free.n,
        "k_with_n": fit.free.k,
        "q": fit.q,
        "s_p": straight.s_p if straight else None,
        "alpha_p": straight.alpha_p if straight else None,
        "alpha_cr": fit.critical.alpha_cr if fit.critical else None,
    }
    return {
        **{name: asdict(estimate) if estimate else None for name, estimate in constants.items()},
        "r_squared": {**fit.r_squared, "loading_with_n": fit.free.r_squared},
        "scatter": fit.scatter,
        "cycles": [asdict(cycle) for cycle in fit.cycles],
        "notes": notes(fit),
        "card": card(fit) or None,
    }
