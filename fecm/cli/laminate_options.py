"""A laminate without a plate: layup, ply thickness and constants, as ``fecm new`` takes them."""

from __future__ import annotations

import math

from fecm.cli.new import OptionError, ply_of_options
from fecm.deck.catalogue import SYSTEMS
from fecm.deck.findings import Findings
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.model import Material
from fecm.deck.records import Integration, Layer
from fecm.mechanics.laminate import Laminate
from fecm.problem.build import laminate_of
from fecm.problem.check_material import check_material


def laminate_of_options(
    layup: str,
    ply_thickness: float | None,
    ply: str | None,
    material: str | None,
    units: str | None,
) -> tuple[Laminate, dict[str, str]]:
    """Laminate of the options of ``fecm new``, checked as a deck's is.

    Parameters
    ----------
    layup : str
        For example ``"[0/45/0/-45/0]2s"``.
    ply_thickness : float or None
        Length.
    ply, material, units : str or None
        As :func:`fecm.cli.new.ply_of_options` takes them.

    Returns
    -------
    tuple
        The laminate, and the names of its units as :func:`fecm.deck.units.unit_names` gives them.

    Raises
    ------
    OptionError
        If an option is missing or invalid; the message names it.
    """
    try:
        angles = parse_layup(layup)
    except LayupError as error:
        raise OptionError(str(error)) from None
    if ply_thickness is None or not 0.0 < ply_thickness < math.inf:
        given = "" if ply_thickness is None else f", not {ply_thickness:g}"
        raise OptionError(f"--layup needs a positive --ply-thickness{given}")
    constants, system = ply_of_options(ply, material, units)
    layers = tuple(Layer(n, angle, ply_thickness) for n, angle in enumerate(angles, start=1))
    total = ply_thickness * len(layers)
    segment = Material(Integration(3, 3, -3, total), constants, layers)
    findings = Findings()
    check_material(segment, findings)
    if findings.errors:
        raise OptionError(findings.errors[0].message.rstrip("."))
    names = () if system is None else SYSTEMS[system][0]
    return laminate_of(segment), dict(zip(("length", "force", "time"), names, strict=False))
