"""Ways of breaking physics on purpose, for a test alone."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from fecm.deck.model import Shear
from fecm.mechanics import element_matrices, failure, strains
from fecm.mechanics import laminate as laminates
from fecm.mechanics.contact_law import HystereticLaw
from fecm.mechanics.strains import StrainField

Break = Callable[[pytest.MonkeyPatch], None]
# What is broken; how; and the rows that have to see it: a case, and the beginnings of quantities.
Breaks = dict[str, tuple[Break, dict[str, tuple[str, ...]]]]


def instead(owner: Any, name: str, broken: Callable[..., Any]) -> Break:
    """Make a function compute something else: `broken` gets the right function and its arguments.

    A function of a module is replaced wherever it was imported.
    """

    def apply(monkeypatch: pytest.MonkeyPatch) -> None:
        actual = inspect.getattr_static(owner, name)
        right = actual.fget if isinstance(actual, property) else actual

        def wrapper(*args: Any, **kwargs: Any) -> Any:
            return broken(right, *args, **kwargs)

        if isinstance(owner, type):
            monkeypatch.setattr(
                owner, name, property(wrapper) if isinstance(actual, property) else wrapper
            )
            return
        for module in [m for n, m in sys.modules.items() if n.partition(".")[0] == "fecm"]:
            for own, kept in list(vars(module).items()):
                if kept is right:
                    monkeypatch.setattr(module, own, wrapper)

    return apply


def changed(owner: Any, name: str, change: Callable[[Any], Any]) -> Break:
    """Make a function give another result: `change` of the right one."""
    return instead(owner, name, lambda right, *args, **kwargs: change(right(*args, **kwargs)))


def in_numpy(broken: Break) -> Break:
    """Run without the compiled kernels: they have a copy of their own of what is broken."""

    def apply(monkeypatch: pytest.MonkeyPatch) -> None:
        import_module("fecm.mechanics.kernels.failure")  # it would keep that there is no library
        monkeypatch.setattr("fecm.mechanics.kernels.LIBRARY", None)
        broken(monkeypatch)

    return apply


def value(owner: Any, name: str, new: object) -> Break:
    """Make a constant another one."""
    return lambda monkeypatch: monkeypatch.setattr(owner, name, new)


def entry(rows: Any, columns: Any, factor: float) -> Callable[[Any], Any]:
    """Multiply an entry of a symmetric matrix."""

    def change(matrix: Any) -> Any:
        other = matrix.copy()
        other[..., rows, columns] *= factor
        if rows != columns:
            other[..., columns, rows] *= factor
        return other

    return change


def in_laminate(**changes: Callable[[Any], Any]) -> Break:
    """Change parts of every laminate."""
    return changed(
        laminates,
        "laminate",
        lambda built: replace(built, **{n: new(getattr(built, n)) for n, new in changes.items()}),
    )


def in_stiffness(**changes: Callable[[Any], Any]) -> Break:
    """Change parts of the laminate that the elements' stiffness is made of, and nothing else."""

    def broken(right: Any, family: Any, laminate: Any, *others: Any) -> Any:
        other = {name: change(getattr(laminate, name)) for name, change in changes.items()}
        return right(family, replace(laminate, **other), *others)

    return instead(element_matrices, "stiffness", broken)


def in_strains(component: int, unknown: int) -> Break:
    """Change the sign of what an unknown adds to a component of the strains."""

    def broken(right: Any, self: Any, displacement: Any) -> Any:
        strains, other = right(self, displacement), displacement.copy()
        other[..., unknown] *= -1.0
        strains[component] = right(self, other)[component]
        return strains

    return instead(StrainField, "evaluate", broken)


def of_one_material(right: Any, layers: Any, plies: Any, *others: Any, **kwargs: Any) -> Any:
    return right(layers, dict.fromkeys(plies, plies[1]), *others, **kwargs)


def without_shea(right: Any, deck: Any, *others: Any) -> Any:
    kept = tuple(segment for segment in deck.segments if not isinstance(segment, Shear))
    return right(replace(deck, segments=kept), *others)


def without_coupling(names: str) -> Break:
    """Forget B in some of the stress resultants."""

    def broken(right: Any, strains: Any, laminates: Any, *others: Any) -> Any:
        uncoupled = [(replace(laminate, B=0.0 * laminate.B), rows) for laminate, rows in laminates]
        poor = right(strains, uncoupled, *others)
        rich = right(strains, laminates, *others)
        return rich | {name: actual for name, actual in poor.items() if name[0] == names}

    return instead(strains, "strains_and_resultants", broken)


def without_preload(
    right: Any, strains: Any, laminate: Any, field: Any, preload: Any, *others: Any
) -> Any:
    return right(strains, laminate, field, (0.0, 0.0, 0.0), *others)


def exchanged_forces(right: Any, family: Any, preload: Any, rules: Any) -> Any:
    n_x, n_y, n_xy = preload
    return right(family, (n_y, n_x, n_xy), rules)


def of_q16(right: Any, q: Any, angle: float) -> Any:
    m, n = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    built, second = right(q, angle), (q[0, 1] - q[1, 1] + 2.0 * q[2, 2]) * m * n**3
    built[0, 2] -= 2.0 * second
    built[2, 0] -= 2.0 * second
    return built


def plane_stress_of_strain(right: Any, ply: Any) -> Any:
    built = right(ply)
    built[:2, :2] *= 1.0 - ply.nu12**2 * ply.e2 / ply.e1
    return built


def moved_midplane(built: Any) -> Any:
    d = built.thickness / 6.0
    return replace(built, B=built.B + d * built.A, D=built.D + 2.0 * d * built.B + d**2 * built.A)


def equal_shares(right: Any, *args: Any) -> Any:
    lumped = right(*args)
    return np.broadcast_to(lumped.mean(axis=1, keepdims=True), lumped.shape)


def rotary_for_mass(right: Any, family: Any, *args: Any) -> Any:
    ne, nn = family.nodes.shape
    M = right(family, *args).reshape(ne, nn, 5, nn, 5)
    M[:, :, 2, :, 2] = M[:, :, 3, :, 3]
    return M.reshape(ne, 5 * nn, 5 * nn)


def rotations_reversed(B: Any) -> Any:
    parts = B.reshape(*B.shape[:-1], B.shape[-1] // 5, 5)
    parts[..., 3:] *= -1.0
    return parts.reshape(B.shape)


def ray_without_slope(right: Any, fronts: Any) -> Any:
    return right(replace(fronts, slope=0.0 * fronts.slope))


def quarter_of_mass(masses: Any) -> Any:
    return masses * np.where(np.arange(len(masses)) % 2, 1.0, 0.5)


def lighter_begin(right: Any, rod: Any) -> Any:
    M = right(rod)
    for element, area in enumerate(rod.areas):
        M[2 * element, 2 * element] -= rod.density * area * rod.length / rod.elements * 16.0 / 420.0
    return M


def turned(of: Callable[[Any, Any], bool], **factors: float) -> Break:
    """Multiply parts of the curve that the law turns to, given the memories before and after."""

    def broken(right: Any, law: Any, before: Any, *args: Any) -> Any:
        after = right(law, before, *args)
        if after is before or not of(before, after):
            return after
        return after._replace(**{n: times * getattr(after, n) for n, times in factors.items()})

    return in_numpy(instead(HystereticLaw, "_leave_branch", broken))


def standing_plate(
    right: Any, impact: Any, motion: Any, rod: Any, law: Any, contact: Any, *args: Any
) -> None:
    right(impact, motion, rod, law, replace(contact, plate_moves=False), *args)


def started_at_zero(right: Any, impact: Any, state: Any, *args: Any) -> None:
    state.start_w = 0.0
    right(impact, state, *args)


def without_nodal_forces(
    right: Any, motion: Any, state: Any, dt: Any, factor: Any, applied: Any = None, **kwargs: Any
) -> None:
    right(motion, state, dt, 0.0, applied, **kwargs)


def work_of_the_new_force(right: Any, step: Any, law: Any, state: Any, w: Any) -> None:
    last = state.contact
    right(step, law, state, w)
    force, indentation = state.contact
    state.contact_work += (force - last.force) / 2.0 * (indentation - last.indentation)


def partly_given(right: Any, convolution: Any, values: Any) -> None:
    right(convolution, (1.0 - 1e-6) * values)


def exchanged_on_tape8(
    right: Any, recorder: Any, group: str, steps: Any, times: Any, columns: Any
) -> None:
    if group == "tape8":
        other = ("kappa_y", "kappa_x", "kappa_xy", "gamma_xz", "gamma_yz")
        columns = dict(zip(other, columns.values(), strict=True))
    right(recorder, group, steps, times, columns)


def other_power(right: Any, constants: Any, *args: Any) -> None:
    right(constants, *args)
    object.__setattr__(constants, "q", 2.0)


def resultants(**factors: float) -> Callable[[Any], Any]:
    """Multiply some stress resultants."""
    return lambda actual: actual | {name: times * actual[name] for name, times in factors.items()}


def in_plate_axes(right: Any, laminate: Any) -> Any:
    return right(
        replace(laminate, plies=replace(laminate.plies, angles=0.0 * laminate.plies.angles))
    )


def bent_with_stretching_held(right: Any, laminate: Any) -> Any:
    coupled = laminate.B @ np.linalg.solve(laminate.A, laminate.B)
    return right(replace(laminate, D=laminate.D + coupled))


def without_q26(moments: Any) -> Any:
    moments[..., 2, 1] = 0.0
    return moments


def mirrored(right: Any, monitor: Any, stresses: Any, strengths: Any, *rest: Any) -> None:
    (zone,) = stresses.zones
    plies = replace(zone.laminate.plies, angles=-zone.laminate.plies.angles)
    stresses.zones = [replace(zone, laminate=replace(zone.laminate, plies=plies))]
    right(monitor, stresses, strengths, *rest)


def of_the_first(exposures: Any) -> Any:
    return np.broadcast_to(exposures[..., :1], exposures.shape)


def unturned(plate: laminates.LaminateSection) -> laminates.LaminateSection:
    """A laminate whose plies seem to lie along x."""
    return replace(plate, plies=replace(plate.plies, angles=0.0 * plate.plies.angles))


def of_the_last(exposures: Any) -> Any:
    return np.broadcast_to(exposures[..., -1:], exposures.shape)


def without_shear_stress(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, right in list(failure.CRITERIA.items()):

        def broken(ply: Any, s1: Any, s2: Any, tau: Any, right: Any = right) -> Any:
            return right(ply, s1, s2, 0.0 * tau)

        monkeypatch.setitem(failure.CRITERIA, name, broken)


def exchanged_matrices(right: Any, design: Any) -> Any:
    if not design.sensitivity:
        return right(design)
    a, b, *mixed = np.split(right(design), len(design.laws) + 2)
    return np.concatenate([b, a, *mixed])


def halved(number: float) -> float:
    return number / 2.0


def doubled(number: Any) -> Any:
    return 2.0 * number


def negative(matrix: Any) -> Any:
    return -matrix


def nothing(matrix: Any) -> Any:
    return 0.0 * matrix
