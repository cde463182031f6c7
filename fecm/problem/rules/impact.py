"""Rules about the ROD segment, and about an impact that the mesh does not resolve."""

from __future__ import annotations

import math

from fecm._typing import Bools
from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.judge.limits import ELEMENTS_PER_WAVE
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import distinct, extent
from fecm.problem.estimates import format_mesh_error, resolution
from fecm.problem.problem import Problem

W_DOF = W + 1  # number of w on the card
LEAST_PER_WAVE = 4  # elements per bending wave below which a mesh is too coarse
WORTH_SAYING = 0.03  # mesh error of the peak that is warned of
# Impact velocity over the wave speed along the fibres.
CREEPING = 1.0e-6
HYPERSONIC = 0.1


@rule("E408", Subject.IMPACT)
def unknown_impact_node(problem: Problem) -> Reports:
    """The impact node does not exist.

    Remedy: 1 to NUMNP.
    """
    impact, control = problem.deck.require(model.Impact), problem.deck.control
    if not 1 <= impact.node <= control.numnp:
        what = f"The impact node {impact.node} does not exist"
        message = f"{what}; the deck has nodes 1 to {control.numnp}."
        yield Report(message, impact.place("impact node"))


@rule("E409", Subject.IMPACT)
def unknown_impact_dof(problem: Problem) -> Reports:
    """The impact dof does not exist, or with PATC is not w.

    Remedy: 3 is w.
    """
    impact, control = problem.deck.require(model.Impact), problem.deck.control
    if not 1 <= impact.dof <= control.ndf:
        message = f"The impact dof is {impact.dof}; it must be 1 to {control.ndf}."
        yield Report(message, impact.place("impact dof"), "3 is w")


@rule("E410", Subject.IMPACT)
def restrained_impact_dof(problem: Problem) -> Reports:
    """The impact dof is restrained.

    Remedy: Another node, or no support there.
    """
    impact = problem.deck.require(model.Impact)
    exists = 1 <= impact.node <= problem.deck.control.numnp
    if exists and problem.mesh.equations[impact.node - 1, impact.dof - 1] == 0:
        message = f"Dof {impact.dof} of the impact node {impact.node} is restrained."
        yield Report(message, impact.place("impact node"), "a BOUN card restrains it")


@rule("E413", Subject.IMPACT)
def impact_on_rotation(problem: Problem) -> Reports:
    """The impact dof is a rotation.

    Remedy: 3 is w.
    """
    impact = problem.deck.require(model.Impact)
    if impact.dof > W_DOF:
        message = f"The impact dof {impact.dof} is a rotation: a projectile pushes a displacement."
        yield Report(message, impact.place("impact dof"), "3 is w")


@rule("W413", Subject.IMPACT)
def impact_in_plane(problem: Problem) -> Reports:
    """The impact dof is in the plane of the plate.

    Remedy: 3 is w.
    """
    impact = problem.deck.require(model.Impact)
    if impact.dof < W_DOF:
        message = f"The impact dof is {impact.dof}, not 3: the projectile does not push w."
        yield Report(message, impact.place("impact dof"))


@rule("E411", Subject.IMPACT)
def negative_velocity(problem: Problem) -> Reports:
    """The impact velocity is negative.

    Remedy: An approach is positive.
    """
    impact = problem.deck.require(model.Impact)
    if impact.velocity < 0.0:
        message = f"The impact velocity is {impact.velocity:g}; it must be positive."
        hint = "an approach is positive on this card"
        yield Report(message, impact.place("impact velocity"), hint)


@rule("W411", Subject.IMPACT)
def projectile_at_rest(problem: Problem) -> Reports:
    """The impact velocity is 0.

    The projectile rests on the plate.

    Remedy: A velocity, or loads of FORC.
    """
    impact = problem.deck.require(model.Impact)
    if impact.velocity == 0.0:
        why = "the projectile rests on the plate, which only FORC's loads can move"
        yield Report(f"The impact velocity is 0: {why}.", impact.place("impact velocity"))


@rule("W441", Subject.IMPACT)
def held_around_impact(problem: Problem) -> Reports:
    """All neighbours of the impact node are restrained.

    Remedy: Restrain the supports only.
    """
    mesh, impact = problem.mesh, problem.deck.require(model.Impact)
    touching = mesh.elements[(mesh.elements == impact.node).any(axis=1)]
    around = distinct(touching[(touching > 0) & (touching != impact.node)]) - 1
    low, high = extent(mesh.coordinates)
    places = mesh.coordinates[around]
    inner: Bools = ((places > low) & (places < high)).all(axis=1)
    if inner.any() and (mesh.equations[around, impact.dof - 1] == 0).all():
        where = f"the impact node {impact.node} is restrained in dof {impact.dof}"
        message = f"Every other node of the elements at {where}."
        yield Report(message, impact.place("impact node"), "restrain the supports only")


@rule("W440", Subject.IMPACT)
def doubtful_velocity(problem: Problem) -> Reports:
    """The velocity does not suit the wave speed along the fibres.

    Their ratio is outside 10⁻⁶ to 0.1.

    Remedy: Velocity in the deck's units.
    """
    impact, ply = problem.deck.require(model.Impact), problem.deck.require(model.Material).ply
    along_fibres = math.sqrt(ply.e1 / ply.density)
    share = abs(impact.velocity) / along_fibres
    if share and not CREEPING <= share <= HYPERSONIC:
        wave = f"the wave speed along the fibres, (E1/density)^(1/2) = {along_fibres:.3g}"
        message = f"The impact velocity {impact.velocity:g} is {share:.2g} of {wave}."
        hint = "velocity is in the deck's units of length and time"
        yield Report(message, impact.place("impact velocity"), hint)


@rule("W415", Subject.IMPACT)
def coarse_mesh(problem: Problem) -> Reports:
    """There are too few elements per bending wave at the impact node.

    Remedy: A finer mesh there: see [checking a deck](checking.md).
    """
    waves = resolution(problem)
    if waves is None or waves.elements >= ELEMENTS_PER_WAVE.value:
        return
    coarse = waves.elements < LEAST_PER_WAVE
    if not coarse and (waves.error is None or waves.error < WORTH_SAYING):
        return
    about = "" if waves.error is None else f": {format_mesh_error(waves.error)}"
    what = f"The mesh is {'too coarse' if coarse else 'coarse'} at the impact node"
    sides = f"{waves.elements:.1f} elements of side {waves.side:.3g}"
    wave = f"bending wave of the contact's duration, which is {waves.wave:.3g} long"
    enough = ELEMENTS_PER_WAVE.value
    hint = f"use {enough:g} elements per wave: sides up to {waves.wave / enough:.2g}"
    place = problem.deck.require(model.Impact).place("impact node")
    yield Report(f"{what}: {sides} per {wave}{about}.", place, hint)


@rule("W556", Subject.IMPACT)
def impact_outside_supports(problem: Problem) -> Reports:
    """The impact point lies outside the supports.

    A closed line of supports, such as the edges of a window, holds the plate, and the plate is hit
    on the free rim around it. A fixture is solid there: the rim can't move.

    Remedy: A point inside the window. The origin is a corner of the plate.
    """
    if not problem.outside_supports[problem.distances.argmin()]:
        return
    impact = problem.deck.require(model.Impact)
    x, y = problem.load_place or problem.mesh.coordinates[impact.node - 1]
    message = (
        f"The impact point ({x:g}, {y:g}) lies outside the supports, on the free rim of the plate."
    )
    hint = "hit the plate inside its window; a fixture is solid below the rim"
    yield Report(message, impact.place("impact node"), hint)


OF_NODE = (unknown_impact_node,)
# One of these is enough.
OF_DOF = (unknown_impact_dof, restrained_impact_dof, impact_on_rotation, impact_in_plane)
OF_VELOCITY = (negative_velocity, projectile_at_rest)
NEIGHBOURS = (held_around_impact,)
VALUES = (doubtful_velocity, impact_outside_supports)
OF_MESH = (coarse_mesh,)
