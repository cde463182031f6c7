"""Deck of a plate without an impact, for static solutions and natural modes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

from fecm._errors import warn
from fecm.authoring.changes import with_cards
from fecm.authoring.impact import ImpactParameters, Request, assemble, title_of, with_supports
from fecm.authoring.laminate import Laminate, Layup, deck_plies, strengths_of, system_asked
from fecm.authoring.mesh import InPlane, Placed, place_impact
from fecm.authoring.numerics import AUTO, Numerics, Quadrature, with_kinematics
from fecm.authoring.parameters import ObjectError, in_units, is_finite
from fecm.authoring.plate import Plate
from fecm.authoring.zones import laminates_of as laminates_of_zones
from fecm.authoring.zones import placed_zones
from fecm.deck import model
from fecm.deck.catalogue import STANDARD
from fecm.deck.findings import DeckError
from fecm.problem.loading import load_deck


def plate_deck(
    plate: Plate,
    laminate: Laminate,
    program: str,
    *,
    force: float | str | None = None,
    at: tuple[float, float] | None = None,
    patch: str | model.Patch | None = AUTO,
    units: str | None = None,
    kinematics: Literal["linear", "von-karman"] = "linear",
    in_plane: InPlane | None = None,
    radius_x: float | str | None = None,
    radius_y: float | str | None = None,
    shear: Quadrature = "mitc",
    shear_factor: float | Literal["equi"] | None = None,
    preload: Sequence[float | str] | None = None,
    gages: Iterable[tuple[float, float, float, float]] = (),
    failure: bool = False,
    cure: float | str | None = None,
    title: str | None = None,
    zones: Sequence[tuple[str | Sequence[float], Layup | Laminate]] = (),
) -> model.Deck:
    r"""Return the deck of a plate that no projectile hits, for statics and natural modes.

    The plate is linear unless `kinematics` says otherwise. A flat, linear plate with an uncoupled
    laminate has all in-plane dofs restrained, so that its modes are those of bending.

    Parameters
    ----------
    plate : Plate
        Mesh and supports.
    laminate : Laminate
        Layup and ply.
    program : str
        Cards of the macro program, between MACR and END: ``"LMAS\nEIGE,,3"`` for the three lowest
        modes, ``"TANG\nFORM\nSOLV\nDISP"`` for the static deflection.
    force : float or str, optional
        Static transverse force, positive along w. A text may have a unit, ``"1kN"``. PROP scales
        the force.
    at : tuple of float, optional
        Place of the force; the middle of the plate by default.
    patch : str or Patch or None
        Area of the force, as in :func:`fecm.impact`. None is a force on the nearest node.
    units : str, optional
        As in :func:`fecm.impact`.
    kinematics : str
        ``"linear"``, or ``"von-karman"`` for a plate that stretches as it bends (NONL). Its static
        solution is a loop with TANG, FORM, SOLV and CONV.
    in_plane, radius_x, radius_y, shear, shear_factor, preload, gages : optional
        As in :func:`fecm.impact`.
    failure : bool
        Add the strengths of named plies, for FAIL and PLYS in the program.
    cure, title, zones : optional
        As in :func:`fecm.impact`.

    Returns
    -------
    Deck
        Deck without errors.

    Raises
    ------
    ValueError
        If an argument is missing or implausible.
    DeckError
        If the deck has errors.

    Examples
    --------
    >>> import fecm
    >>> plate = fecm.Plate.rectangle((100, 80), (10, 8), support="simple")
    >>> laminate = fecm.Laminate("[0/90]2s", "T300/5208", 0.25)
    >>> deck = fecm.plate_deck(plate, laminate, "TANG\nFORM\nSOLV\nDISP", force=10, units="mm-N-s")
    >>> round(float(fecm.run_one(deck).tape3.w.max()), 4)
    0.0259
    """
    numerics = Numerics(patch, shear, shear_factor)
    request = Request(
        plate,
        laminate,
        ImpactParameters(at=at),
        numerics,
        units=units,
        in_plane=in_plane,
        radius_x=radius_x,
        radius_y=radius_y,
        kinematics=kinematics,
        preload=preload,
        gages=gages,
        cure=cure,
        title=title,
        zones=tuple(zones),
    )
    request.check()
    if kinematics not in ("linear", "von-karman"):
        raise ObjectError(f"`kinematics` is {kinematics!r}, none of linear, von-karman")
    if not isinstance(program, str):
        raise ObjectError(f"`program` is {program!r}, not the cards of a macro program")
    if force is None and at is not None:
        raise ObjectError("`at` is the place of `force`: give both, or none")
    doubts: list[str] = []
    laminates = laminates_of_zones(laminate, request.zones)
    system = STANDARD if request.test else system_asked(units)
    plies, in_zones = deck_plies(laminate, laminates, system, [])
    size = in_units("force", force, "force", plies.system)
    if size is not None and not is_finite(size):
        raise ObjectError(f"`force` is {force!r}; it must be a finite number")
    area = None if size is None else numerics.contact_patch(prescribed=request.test is not None)
    placed = place_impact(plate, plies, at, area, [] if size is None else doubts, "force")
    load = None if size is None else _static_load(placed, size)
    laminates_of_elements = placed_zones(request.zones, in_zones, placed.mesh, placed.node, doubts)
    strengths = [strengths_of(plies)] if failure else []
    plain = assemble(request, plies, placed.mesh, laminates_of_elements, [load], strengths)
    plain = replace(plain, title=title_of(plate, laminate, plies) if title is None else title)
    structure = with_kinematics(
        kinematics,
        lambda nonlinear: with_supports(request, plain, placed.mesh, plies, nonlinear=nonlinear),
    )
    for doubt in doubts:
        warn(doubt)
    loaded = load_deck(with_cards(structure.deck, program))
    if errors := loaded.errors():
        raise DeckError(errors, "<deck>")
    return replace(loaded.problems[0].deck, text="")


def _static_load(placed: Placed, force: float) -> model.Segment:
    """Return the segment of a static force on a patch or a node."""
    if placed.patch is None:
        values = (0.0, 0.0, force, 0.0, 0.0)
        return model.Forces((model.NodeValues(placed.node, 0, values),))
    return replace(placed.patch.centred(placed.point), load=force)
