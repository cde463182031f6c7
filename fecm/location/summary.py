"""Summary of a location: in a few lines, and as values for JSON."""

from __future__ import annotations

from typing import Any

from fecm._table import Row, label_lines
from fecm.deck.units import quantity
from fecm.location.location import Location

DIGITS = 5
BIASED = 0.1  # bias of a peak over its standard deviation, from which on it is shown


def location_lines(found: Location) -> list[str]:
    """Lines about a location, in the deck's units."""

    def shown(name: str, value: float) -> str:
        return quantity(value, found.unit(name), DIGITS)

    length = found.unit("x")
    rows: list[Row] = [
        ("x", f"{found.x:.5g} ± {found.sd_x:.2g} {length}".rstrip()),
        ("y", f"{found.y:.5g} ± {found.sd_y:.2g} {length}".rstrip()),
        ("correlation", f"{found.correlation:.2f}"),
        (
            "peak force",
            f"{_with_error(found, 'peak_force')} at {shown('time', found.time_of_peak)}",
        ),
    ]
    if found.peak_bias is not None and found.peak_bias > BIASED * (found.sd_peak_force or 0.0):
        bias = quantity(found.peak_bias, found.unit("peak_bias"), 2)
        rows.append(("", f"the largest of noisy values, too high by about {bias}"))
    rows += [
        ("impulse", f"{_with_error(found, 'impulse')} until {shown('time', _end(found))}"),
        ("contact", f"until {shown('time', _end(found))} at least"),
    ]
    if found.energy_bound is not None:
        bound = shown("energy_bound", found.energy_bound)
        least = shown("energy_bound", 0.25 * found.energy_bound)
        rows += [
            ("energy bound", f"{bound} would be stopped by this impulse; a projectile that"),
            ("", f"rebounds had less (down to {least}), one that moves on had more"),
        ]
    noise, misfit = "from the residual", "1, as the noise is that of the residual"
    if found.noise_given:
        noise, misfit = "as given", f"{found.misfit:.3g} times the noise"
    rows += [
        ("noise", f"strain {found.noise:.3g}, {noise}"),
        ("misfit", misfit),
        ("second place", _rival(found)),
        ("mesh", _mesh(found)),
        ("determined until", shown("time", found.determined_until)),
    ]
    if found.sd_shift:
        rows.append(("shift", f"{found.shift:.4g} ± {found.sd_shift:.2g} {found.unit('shift')}"))
    if found.sd_gains.any():
        gains = zip(found.gages.tolist(), found.gains, found.sd_gains, strict=True)
        rows += [(f"gain of gage {n}", f"{gain:.4f} ± {sd:.2g}") for n, gain, sd in gains]
    rows.append(("accepted", "yes" if found.accepted else "no"))
    return label_lines(rows)


def _mesh(found: Location) -> str:
    """How far a finer mesh moves the place."""
    if found.mesh_error is None:
        return "its error is unknown"
    moved = quantity(found.mesh_error, found.unit("mesh_error"), 2)
    return f"elements half as long move the place by {moved}"


def _with_error(found: Location, name: str) -> str:
    """A value with its standard deviation, if that is known."""
    error = getattr(found, f"sd_{name}")
    spread = "" if error is None else f" ± {error:.2g}"
    return f"{getattr(found, name):.5g}{spread} {found.unit(name)}".rstrip()


def _end(found: Location) -> float:
    """Time until which the impulse is taken."""
    return found.determined_until if found.contact_end is None else found.contact_end


def _rival(found: Location) -> str:
    if found.second is None:
        return "none: the misfit has one minimum"
    x, y, ratio = found.second
    return f"{x:.4g}, {y:.4g} {found.unit('x')}".rstrip() + f", misfit {ratio:.3g} times as large"


def values(found: Location) -> dict[str, Any]:
    """Values of a location under the names of its attributes, without its notes."""
    names = (
        *("x", "y", "sd_x", "sd_y", "correlation", "peak_force", "time_of_peak", "contact_end"),
        *("sd_peak_force", "peak_bias", "impulse", "sd_impulse", "mesh_error", "mass"),
        *("energy_bound", "determined_until", "noise", "noise_given", "misfit"),
        *("shift", "sd_shift", "accepted"),
    )
    second = found.second
    return {
        **{name: getattr(found, name) for name in names},
        "second": None if second is None else second._asdict(),
        "gages": found.gages.tolist(),
        "gains": found.gains.tolist(),
        "sd_gains": found.sd_gains.tolist(),
    }
