"""Ply stresses and strains of a result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fecm._errors import ResultFileError
from fecm._typing import Array, Bools, Floats, Indices
from fecm.deck.model import Deck, Layer, Material, Ply
from fecm.listing.variant import PlateVariant, variant_of
from fecm.mechanics.elements import HIGHEST_ORDER, Quadrature, gauss, nodal
from fecm.mechanics.interpolation import local_shape_functions
from fecm.mechanics.mesh import element_blocks
from fecm.results.groups import NotStoredError, remedy
from fecm.results.schema import CURE_STRESS, PlyRows
from fecm.results.stored import Stored

IN_PLANE = ("sigma_1", "sigma_2", "tau_12")
INTERLAMINAR = ("tau_xz", "tau_yz")


@dataclass(frozen=True, eq=False)
class PlyResults:
    """Stresses and strains of plies, in the deck's units.

    In-plane values are in the axes of the ply, at the points of each element and both faces of each
    ply, (rows, elements, points, plies, 2). Interlaminar stresses are in the axes of the plate,
    from equilibrium, at the centre of each element and three levels of each ply, (rows, elements,
    plies, 3). sigma_z is not computed. For a plate of several laminates, the first axis of `z` and
    `angles` is the element, (elements, plies, ...). They and the stresses are NaN at plies that an
    element lacks.

    Attributes
    ----------
    step, time : ndarray (rows,)
        Steps and times of the rows.
    element : ndarray (elements,)
        Numbers of the elements.
    x, y : ndarray (elements, points)
        Places of the points, length.
    z : ndarray (plies, 3)
        Lower, middle and upper z, from the struck face at -h/2, length.
    angles : ndarray (plies,)
        Fibre angles, degrees.
    under_load : ndarray of bool (elements,)
        Elements so near to the load that plate theory fails.
    sigma_1, sigma_2, tau_12 : ndarray (rows, elements, points, plies, 2)
        Stresses along and across the fibres, and in shear.
    eps_1, eps_2, gamma_12 : ndarray (rows, elements, points, plies, 2)
        Strains by the compliance of the ply.
    tau_xz, tau_yz : ndarray (rows, elements, plies, 3)
        Interlaminar stresses; NaN in elements without nine nodes.
    residual : ndarray (rows, elements, 2)
        tau_xz and tau_yz of equilibrium at z = h/2, removed linearly in z.
    """

    step: Array
    time: Floats
    element: Array
    x: Floats
    y: Floats
    z: Floats
    angles: Floats
    under_load: Bools
    sigma_1: Floats
    sigma_2: Floats
    tau_12: Floats
    eps_1: Floats
    eps_2: Floats
    gamma_12: Floats
    tau_xz: Floats
    tau_yz: Floats
    residual: Floats


class PlyGroup(PlyRows):
    """Datasets of ``plies``. Calling the group returns stresses and strains of plies."""

    def __init__(self, stored: Stored) -> None:
        super().__init__("plies", stored)
        self._stored = stored

    def __call__(
        self,
        time: float | str | Sequence[float | str] | None = None,
        elements: int | Sequence[int] | None = None,
    ) -> PlyResults:
        """Return stresses and strains ply by ply.

        Parameters
        ----------
        time : float, str or sequence, optional
            Times, also with a unit, as in ``"50us"``, for which the nearest stored rows are taken;
            all rows by default.
        elements : int or sequence of int, optional
            Numbers of elements; by default all with ply stresses.

        Raises
        ------
        NotStoredError
            If the result has no ply stresses, or not at such a time or of such an element.
        ResultFileError
            If the result's deck can't be read or does not fit its ply stresses.

        Examples
        --------
        >>> plies = result.plies(time=4e-5, elements=[61, 62])  # doctest: +SKIP
        >>> plies.sigma_1.max(), plies.eps_1.max()  # doctest: +SKIP
        """
        stored = self._stored
        if "plies/sigma_1" not in stored:
            way = "in Python run deck.with_program(plies=True)"
            raise NotStoredError(f"the result has no ply stresses{remedy('plies')}; {way}")
        times, numbers, z = (stored[f"plies/{name}"] for name in ("time", "element", "z"))
        rows = np.arange(len(times))
        if time is not None:
            rows = rows_at(times, stored.times_of(time), "ply stresses")
        members = np.arange(len(numbers))
        if elements is not None:
            members = _members(numbers, np.atleast_1d(elements))
        chosen = {
            name: stored[f"plies/{name}"][np.ix_(rows, members)]
            for name in (*IN_PLANE, *INTERLAMINAR, "residual")
        }
        deck = stored.deck
        material = deck.last(Material)
        count = z.shape[-2]
        if material is None or not _fits(deck, z):
            raise ResultFileError(
                f"the result's deck does not have the {count} plies of its stresses"
            )
        layups = _layups(stored, deck, numbers[members])
        variant = variant_of(frozenset(stored.slips)).plate
        points = points_of(
            stored,
            numbers[members],
            count=chosen["sigma_1"].shape[2],
            at_nodes=material.integration.points < 0,
        )
        return PlyResults(
            step=stored["plies/step"][rows],
            time=times[rows],
            element=numbers[members],
            x=points[..., 0],
            y=points[..., 1],
            z=z if z.ndim == 2 else z[_positions(stored, deck, numbers[members])],
            angles=_of_layers(layups, count, lambda layer: layer.angle),
            under_load=stored["plies/under_load"][members] != 0,
            **chosen,
            **_strains(chosen, _constants(deck, layups, count, variant)),
        )


def _members(numbers: Array, asked: Array) -> Indices:
    """Return the positions of the requested elements among those with ply stresses."""
    place = {int(number): position for position, number in enumerate(numbers)}
    for number in asked:
        if int(number) not in place:
            raise NotStoredError(
                f"no ply stresses of element {number}: they are stored for {len(numbers)} "
                f"elements from {min(place)} to {max(place)}"
            )
    return np.array([place[int(number)] for number in asked], dtype=np.intp)


Layup = tuple[Layer, ...]


def _fits(deck: Deck, z: Floats) -> bool:
    """Return whether a deck has the laminates of stored z, and the materials of their layers."""
    layups = deck.layers.values()
    several = (len(layups),) if len(layups) > 1 else ()
    plies = deck.plies
    return z.shape[:-1] == (*several, max(map(len, layups))) and all(
        layer.material in plies for layers in layups for layer in layers
    )


def _positions(stored: Stored, deck: Deck, numbers: Array) -> Indices:
    """Return the positions of the elements' laminates among the deck's laminates."""
    order = list(deck.layers)
    numbers_stored = stored["mesh/laminate"][numbers - 1]
    if not np.isin(numbers_stored, order).all():
        raise ResultFileError("the result's deck does not have the laminates of its elements")
    return np.array([order.index(number) for number in numbers_stored.tolist()], dtype=np.intp)


def cure_stress_of(stored: Stored, element: int) -> Floats | None:
    """Return the residual stresses of the plies of an element, (plies, 2, 3).

    Returns None without CURE.
    """
    if CURE_STRESS not in stored:
        return None
    values = stored[CURE_STRESS]
    if values.ndim == 3:
        return values
    (position,) = _positions(stored, stored.deck, np.array([element]))
    return np.asarray(values[position])


def _layups(stored: Stored, deck: Deck, numbers: Array) -> Layup | list[Layup]:
    """Return the layers of the plate, or of each element where there are several laminates."""
    first, *other_layups = layups = list(deck.layers.values())
    if not other_layups:
        return first
    return [layups[position] for position in _positions(stored, deck, numbers)]


def _of_layers(layups: Layup | list[Layup], count: int, value: Callable[[Layer], float]) -> Floats:
    """Return a value of each layer, (plies,), or of each element, NaN where it has no layer."""
    if isinstance(layups, tuple):
        return np.array([value(layer) for layer in layups])
    values = np.full((len(layups), count), np.nan)
    for row, layers in zip(values, layups, strict=True):
        row[: len(layers)] = [value(layer) for layer in layers]
    return values


class _Constants(NamedTuple):
    """Constants of plies that broadcast to their in-plane stresses."""

    e1: float | Floats
    e2: float | Floats
    nu12: float | Floats
    g12: float | Floats


def _constants(
    deck: Deck, layups: Layup | list[Layup], count: int, variant: PlateVariant
) -> _Constants:
    """Return the constants of the plies."""
    plies = {number: variant.ply(ply) for number, ply in deck.plies.items()}
    if len(plies) == 1:
        (ply,) = plies.values()
        return _Constants(ply.e1, ply.e2, ply.nu12, ply.g12)

    def of(value: Callable[[Ply], float]) -> Floats:
        values = _of_layers(layups, count, lambda layer: value(plies[layer.material]))
        return values[..., None] if values.ndim == 1 else values[:, None, :, None]

    return _Constants(
        of(lambda p: p.e1), of(lambda p: p.e2), of(lambda p: p.nu12), of(lambda p: p.g12)
    )


def _strains(stresses: Mapping[str, Floats], ply: _Constants) -> dict[str, Floats]:
    """Return the strains of plies by their compliance."""
    stress_1, stress_2, shear = (stresses[name] for name in IN_PLANE)
    return {
        "eps_1": (stress_1 - ply.nu12 * stress_2) / ply.e1,
        "eps_2": stress_2 / ply.e2 - ply.nu12 * stress_1 / ply.e1,
        "gamma_12": shear / ply.g12,
    }


def points_of(stored: Stored, numbers: Array, count: int, at_nodes: bool) -> Floats:
    """Return the places of the points of the elements with the numbers (m,): (m, count, 2).

    Points are `count` nodes or Gauss points of each element. Raises ResultFileError if there is no
    such element, or no rule with this number of points.
    """
    order = math.isqrt(count)
    if order**2 != count or not 1 <= order <= HIGHEST_ORDER:
        raise ResultFileError(f"there are {count} points per element, which is invalid")
    elements, coordinates = stored["mesh/elements"], stored["mesh/coordinates"][:, :2]
    if len(numbers) and not 1 <= numbers.min() <= numbers.max() <= len(elements):
        raise ResultFileError(f"elements outside 1 to {len(elements)} have stored values")
    rule = nodal(order) if at_nodes else gauss(order)
    return places(elements[numbers - 1], coordinates, rule)


def places(elements: Array, coordinates: Floats, rule: Quadrature) -> Floats:
    """Return the places of the points of a rule in elements: (elements, points, 2), length."""
    points = np.empty((len(elements), len(rule.xi), 2))
    for family in element_blocks(elements, coordinates):
        N = local_shape_functions(family, rule)[0]
        points[family.rows] = np.einsum("pn,eni->epi", N, family.coordinates)
    return points


def rows_at(stored: Floats, times: Sequence[float] | Floats, what: str) -> Indices:
    """Return the rows nearest to the given times.

    Raises NotStoredError if a time is outside of the rows.
    """
    spacing = float(np.diff(stored).max()) if len(stored) > 1 else float(stored[0])
    for time in times:
        if not stored[0] - spacing <= time <= stored[-1] + spacing:
            message = f"no {what} at time {time:g}: the rows cover {stored[0]:g} to {stored[-1]:g}"
            raise NotStoredError(message)
    return np.array([np.abs(stored - time).argmin() for time in times], dtype=np.intp)
