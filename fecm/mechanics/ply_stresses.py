"""Stresses ply by ply, residual stresses, and the transverse shear stiffness from equilibrium.

z runs from the struck face, -h/2, to h/2; ply 1 is at the struck face.  Stresses of a ply are in
its own axes; interlaminar shear stresses are in the axes of the plate.  Both are linear in the
midplane strains eps and the curvatures kappa, eps(z) = eps + z kappa, or in their derivatives.
An initial membrane force N0 adds the constant strain A^-1 N0.

Residual stresses arise because plies cannot expand freely during cure or when they take up
moisture.  A ply whose temperature changes by dT and whose moisture changes by dC would strain by
e = (alpha_1, alpha_2, 0) dT + (beta_1, beta_2, 0) dC in its own axes.  The cured laminate is free:

    [N; M] = sum over plies of int Qbar e (1, z) dz,
    (eps0, kappa) = [A B; B D]^-1 [N; M],
    sigma_r = T Qbar (eps0 + z kappa - e)

(Hahn and Pagano 1975; Tsai and Hahn 1980, chapter 8).  The stresses sigma_r have no resultants.
They change neither the motion nor the force of an impact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import Quadrature, gauss
from fecm.mechanics.interpolation import interpolate, inverse_jacobian, local_shape_functions
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.membrane import QuadraticStrains
from fecm.mechanics.mesh import ElementBlock, Ints, MeshArrays, element_blocks
from fecm.mechanics.strains import FLAT, Curvature, Rows, strain_of_deflection


def in_plane_stresses(laminate: LaminateSection) -> Floats:
    """Return sigma_1, sigma_2, tau_12 of every ply, T Qbar (eps + z kappa), (plies, 2, 3, 6).

    The stresses are at the lower and the upper z of each ply, per unit of eps_xx, eps_yy, gamma_xy
    (force/area) and kappa_x, kappa_y, kappa_xy (force/length).
    """
    plies = laminate.plies
    m, n = np.cos(np.deg2rad(plies.angles)), np.sin(np.deg2rad(plies.angles))
    T = np.array(
        [
            [m * m, n * n, 2 * m * n],
            [n * n, m * m, -2 * m * n],
            [-m * n, m * n, m * m - n * n],
        ]
    )
    stiffness = T.transpose(2, 0, 1) @ plies.stiffness
    z = np.stack([plies.faces[:-1], plies.faces[1:]], axis=1)[:, :, None, None]
    parts = np.broadcast_arrays(stiffness[:, None], z * stiffness[:, None])
    return np.concatenate(parts, axis=3)


def _moments(laminate: LaminateSection, z: Floats) -> Floats:
    """Integrate Qbar and Qbar zeta from the struck face to z, (2, n, 3, 3)."""
    plies = laminate.plies

    def integrals(lower: Floats, upper: Floats, stiffness: Floats) -> Floats:
        powers = np.stack([upper - lower, (upper**2 - lower**2) / 2.0])
        return np.asarray(powers[:, :, None, None] * stiffness)

    # Sum the whole plies below, and add the part of the ply at z.
    of_plies = integrals(plies.faces[:-1], plies.faces[1:], plies.stiffness)
    below = np.zeros_like(of_plies)
    np.cumsum(of_plies[:, :-1], axis=1, out=below[:, 1:])
    ply = np.clip(np.searchsorted(plies.faces, z, side="right") - 1, 0, len(plies.angles) - 1)
    return below[:, ply] + integrals(plies.faces[ply], z, plies.stiffness[ply])


def interlaminar_stresses(laminate: LaminateSection) -> tuple[Floats, Floats]:
    """Return the shear stresses tau_xz, tau_yz from the equilibrium of the plies, without inertia.

    tau_xz,z = -sigma_x,x - tau_xy,y and tau_yz,z = -sigma_y,y - tau_xy,x are integrated from the
    struck face.  The residual at z = h/2 is removed linearly in z.

    Returns
    -------
    stresses : ndarray (plies, 3, 2, 2, 6)
        tau_xz and tau_yz at the lower, middle and upper z of each ply, per unit of the derivatives
        of the strains eps and kappa with respect to x and y.
    residual : ndarray (2, 2, 6)
        Stress removed at z = h/2.
    """
    faces, z = laminate.plies.faces, laminate.plies.z

    def shear(z: Floats) -> Floats:
        strips = -np.concatenate(_moments(laminate, z), axis=2)  # (n, 3, 6)
        return np.stack([strips[:, [0, 2]], strips[:, [2, 1]]], axis=2)  # (n, tau, d/dx d/dy, 6)

    residual = shear(faces[-1:])[0]
    share = (z - faces[0]) / (faces[-1] - faces[0])
    stresses = shear(z.ravel()).reshape(*z.shape, 2, 2, 6)
    return stresses - share[:, :, None, None, None] * residual, residual


def equilibrium_shear_stiffness(laminate: LaminateSection) -> Floats:
    """Return the transverse shear stiffness H from equilibrium, (2, 2), force/length.

    H stores the same energy as the stresses of equilibrium; its order is xz, yz.  In cylindrical
    bending in x and in y without membrane forces, H^-1 is the integral of F2' G^-1 F2, where F2
    gives tau_xz and tau_yz per unit of Q_x and Q_y.  Bending is along the plate's axes, so that H
    of an angle-ply laminate depends on the axes.
    """
    plies = laminate.plies
    inverse_A = np.linalg.inv(laminate.A)
    bending = np.linalg.inv(laminate.D - laminate.B @ inverse_A @ laminate.B)
    points, weights = np.polynomial.legendre.leggauss(3)  # exact, as the integrand is quartic
    half = np.diff(plies.faces)[:, None] / 2.0
    z = (plies.faces[:-1, None] + half * (1.0 + points)).ravel()
    A, B = _moments(laminate, z)
    F = (A @ inverse_A @ laminate.B - B) @ bending
    F2 = np.stack([F[:, [0, 2], [0, 1]], F[:, [2, 1], [0, 1]]], axis=1)
    G = np.linalg.inv(np.repeat(plies.shear, 3, axis=0))
    compliance = np.einsum("p,pki,pkl,plj->ij", (half * weights).ravel(), F2, G, F2)
    return np.asarray(np.linalg.inv(compliance))


# Second derivatives d2/dxi2, d2/deta2 and d2/dxi deta of the 9-node shape functions at the centre.
_CURVED = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, -2.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -2.0],
        [0.25, -0.25, 0.25, -0.25, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
)


def second_derivatives(family: ElementBlock) -> Floats:
    """Return d2N/dx2, d2N/dy2 and d2N/dxdy at the centre of 9-node elements, (ne, 3, 9)."""
    _, local = local_shape_functions(family, gauss(1))
    inverse, _ = inverse_jacobian(family, local)
    xi, eta = np.linalg.inv(inverse[:, 0]).swapaxes(0, 1)  # x and y by xi, by eta: (ne, 2)
    # d2N/dxi2 = x,xi^2 N,xx + y,xi^2 N,yy + 2 x,xi y,xi N,xy + x,xixi N,x + y,xixi N,y, and so on.
    terms = [
        (a[:, 0] * b[:, 0], a[:, 1] * b[:, 1], a[:, 0] * b[:, 1] + a[:, 1] * b[:, 0])
        for a, b in ((xi, xi), (eta, eta), (xi, eta))
    ]
    chain = np.array(terms).transpose(2, 0, 1)
    slopes = np.einsum("eia,an->ein", inverse[:, 0], local[0])
    curved = np.einsum("an,eni->eai", _CURVED, family.coordinates)  # of x and y
    return np.linalg.solve(chain, _CURVED - curved @ slopes)


# Laminates with the rows of their elements.
Zones = Sequence[tuple[LaminateSection, Rows]]


@dataclass(frozen=True)
class ElementZone:
    """Stresses per strain in the plies of a laminate's elements."""

    laminate: LaminateSection
    rows: Rows  # rows of the elements in the arrays of stresses
    in_plane: Floats
    interlaminar: Floats
    residual: Floats

    @classmethod
    def of(cls, laminate: LaminateSection, rows: Rows) -> Self:
        """Build the zone of a laminate."""
        return cls(laminate, rows, in_plane_stresses(laminate), *interlaminar_stresses(laminate))

    @property
    def plies(self) -> int:
        """Number of plies."""
        return len(self.laminate.plies.angles)


class PlyStresses:
    """Stresses in the plies of elements.

    `members` are rows of the mesh, ascending; all elements by default.  In-plane stresses are
    evaluated at the points of `rule`, interlaminar stresses at the element's centre.  `initial` is
    a uniform midplane strain of the undeformed plate, (3,).  The midplane strains contain w/R for a
    plate with a `curvature`, and eps_q for a `nonlinear` plate; the elements of both have nine
    nodes.  If `stretches` is false, u and v of all fields are 0 and the midplane has no strains.

    The arrays have as many plies as the laminate with the most plies.  Plies that an element lacks
    are NaN.
    """

    def __init__(
        self,
        mesh: MeshArrays,
        laminate: LaminateSection | Zones,
        rule: Quadrature,
        members: Indices | None = None,
        initial: Floats | None = None,
        *,
        curvature: Curvature = FLAT,
        nonlinear: bool = False,
        stretches: bool = True,
    ) -> None:
        self.initial = initial
        self.members = np.arange(len(mesh.elements)) if members is None else members
        elements = mesh.elements[self.members]
        zones = [(laminate, slice(None))] if isinstance(laminate, LaminateSection) else laminate
        self.zones = [
            ElementZone.of(section, _positions(self.members, rows)) for section, rows in zones
        ]
        most_plies = max(zone.plies for zone in self.zones)
        # Numbers of elements, points of an element, and plies.
        self.shape = (len(elements), len(rule.xi), most_plies)
        self.rule, self.curvature, self.nonlinear = rule, curvature, nonlinear
        self.stretches = stretches
        self._mesh = elements, mesh.coordinates

    @cached_property
    def families(self) -> list[tuple[ElementBlock, bool]]:
        """Elements in blocks with the same nodes present, and whether a block has all nine."""
        elements, coordinates = self._mesh
        return [
            (family, bool(is_complete(elements[family.rows]).all()))
            for family in element_blocks(elements, coordinates)
        ]

    @cached_property
    def _interpolations(
        self,
    ) -> list[tuple[ElementBlock, Floats, Floats | None, _OfDeflection | None]]:
        """Slopes and second derivatives of the shape functions, and the strains of w, by block."""
        rule, stretches = self.rule, self.nonlinear or self.curvature != FLAT
        return [
            (
                family,
                interpolate(family, rule).dN,
                second_derivatives(family) if complete else None,
                _OfDeflection(family, rule, self.curvature, nonlinear=self.nonlinear)
                if stretches
                else None,
            )
            for family, complete in self.families
        ]

    def strains(self, field: Floats) -> tuple[Floats, Floats]:
        """Return the strains of a displacement field, (numnp, 5), and their derivatives.

        Returns
        -------
        strains : ndarray (elements, points, 6)
            eps_xx, eps_yy, gamma_xy including the initial strain; kappa_x, kappa_y, kappa_xy.
        gradients : ndarray (elements, 2, 6)
            Derivatives with respect to x and y at the centre; NaN in elements without 9 nodes.
        """
        count, points, _ = self.shape
        strains, gradients = np.empty((count, points, 6)), np.full((count, 2, 6), np.nan)
        for family, slopes, second, of_deflection in self._interpolations:
            q = field[family.nodes][:, :, [0, 1, 3, 4]]
            q[:, :, 2:] *= -1.0  # curvatures are the strains of the negative rotations
            strains[family.rows] = strains_of(slopes @ q[:, None])
            if second is not None:
                # Rows: d/dx, d/dy.  Their derivatives by x, y are xx, xy and xy, yy.
                gradients[family.rows] = strains_of((second @ q)[:, [[0, 2], [2, 1]]])
            if of_deflection is not None:
                w = field[family.nodes, 2]
                strains[family.rows, :, :3] += of_deflection.strains(w)
                if second is not None:
                    gradients[family.rows, :, :3] += of_deflection.gradients(w, second)
        if self.initial is not None:
            strains[..., :3] += self.initial
        return strains, gradients

    def evaluate(self, field: Floats) -> dict[str, Floats]:
        """Compute the stresses of a displacement field, (numnp, 5).

        Returns
        -------
        dict of ndarray
            sigma_1, sigma_2, tau_12 (elements, points, plies, 2); tau_xz, tau_yz (elements, plies,
            3) and residual (elements, 2), NaN in elements without 9 nodes.
        """
        strains, gradients = self.strains(field)
        elements, points, plies = self.shape
        stress = np.full((3, elements, points, plies, 2), np.nan)
        shear = np.full((2, elements, plies, 3), np.nan)
        residual = np.empty((elements, 2))
        for zone in self.zones:
            zone_strains, zone_gradients = strains[zone.rows], gradients[zone.rows]
            in_plane = np.einsum("lfcs,eps->ceplf", zone.in_plane, zone_strains)
            stress[:, zone.rows, :, : zone.plies] = in_plane
            interlaminar = np.einsum("lptds,eds->telp", zone.interlaminar, zone_gradients)
            shear[:, zone.rows, : zone.plies] = interlaminar
            residual[zone.rows] = np.einsum("tds,eds->et", zone.residual, zone_gradients)
        names = ("sigma_1", "sigma_2", "tau_12")
        result = dict(zip(names, stress, strict=True))
        result["tau_xz"], result["tau_yz"] = shear
        result["residual"] = residual
        return result


def _positions(members: Indices, rows: Rows) -> Rows:
    """Return the positions in `members` of the elements in rows of the mesh."""
    return rows if isinstance(rows, slice) else np.flatnonzero(np.isin(members, rows))


class _OfDeflection:
    """Midplane strains of w in a block: w/R, and eps_q of a nonlinear plate."""

    def __init__(
        self, family: ElementBlock, rule: Quadrature, curvature: Curvature, *, nonlinear: bool
    ) -> None:
        self._values, _ = local_shape_functions(family, rule)
        self._slopes_at_centre = interpolate(family, gauss(1)).dN[:, 0]
        self._curved = strain_of_deflection(curvature)
        self._tied = QuadraticStrains(family, rule) if nonlinear else None

    def strains(self, w: Floats) -> Floats:
        """Return strains at the points, (ne, points, 3), of nodal w (ne, nn); eps_q is tied."""
        strains = (w @ self._values.T)[:, :, None] * self._curved
        if self._tied is not None:
            strains += self._tied.of(w.T).transpose(2, 1, 0)
        return np.asarray(strains)

    def gradients(self, w: Floats, second: Floats) -> Floats:
        """Return the derivatives by x and y at the centre, (ne, 2, 3).

        `second` are the shape functions' `second_derivatives`.
        """
        x, y = np.einsum("ein,en->ie", self._slopes_at_centre, w)
        gradients = np.stack([x, y], axis=1)[:, :, None] * self._curved
        if self._tied is not None:
            xx, yy, xy = np.einsum("ein,en->ie", second, w)
            by_x = (x * xx, y * xy, xx * y + x * xy)
            by_y = (x * xy, y * yy, xy * y + x * yy)
            gradients += np.array([by_x, by_y]).transpose(2, 0, 1)
        return np.asarray(gradients)


def strains_of(slopes: Floats) -> Floats:
    """Return strains (..., 6) from d/dx, d/dy (..., 2, 4) of u, v and the negative rotations."""
    x, y = slopes[..., 0, :], slopes[..., 1, :]
    parts = [(x[..., i], y[..., i + 1], y[..., i] + x[..., i + 1]) for i in (0, 2)]
    return np.stack([*parts[0], *parts[1]], axis=-1)


def is_complete(elements: Ints) -> Bools:
    """Return whether elements, (ne, nen), are quadrilaterals with all nine nodes."""
    nodes = np.zeros((len(elements), 12), dtype=bool)
    nodes[:, : elements.shape[1]] = elements > 0
    return np.asarray(nodes[:, :9].all(axis=1) & ~nodes[:, 9:].any(axis=1))


def uniform_stresses(laminate: LaminateSection, strain: Floats) -> Floats:
    """Return the stresses of the plies, (plies, 2, 3), under a uniform midplane strain, (3,)."""
    return np.asarray(in_plane_stresses(laminate)[..., :3] @ strain)


class Residual(NamedTuple):
    """State of a free laminate after a change of temperature and moisture."""

    stresses: Floats  # (plies, 2, 3): sigma_1, sigma_2, tau_12 at both faces of each ply
    strain: Floats  # (3,): midplane strain eps_xx, eps_yy, gamma_xy
    curvature: Floats  # (3,): kappa_x, kappa_y, kappa_xy, 1/length


def free_strains(
    laminate: LaminateSection, along: Floats | float, across: Floats | float
) -> Floats:
    """Return the free strains xx, yy, xy of the plies in the laminate's axes, (plies, 3).

    `along` and `across` are the free strains along and across the fibres, for all plies or
    (plies,).
    """
    angles = np.deg2rad(laminate.plies.angles)
    m, n = np.cos(angles), np.sin(angles)
    return np.stack(
        [
            m * m * along + n * n * across,
            n * n * along + m * m * across,
            2.0 * m * n * (along - across),
        ],
        axis=1,
    )


def residual_stresses(
    laminate: LaminateSection, along: Floats | float, across: Floats | float
) -> Residual:
    """Return residual stresses of a free laminate whose plies would strain by `along` and `across`.

    The result is NaN for a laminate without stiffness.

    Parameters
    ----------
    laminate : Laminate
    along, across : float or ndarray (plies,)
        Free strains alpha dT + beta dC along and across the fibres, for all plies or for each.

    Examples
    --------
    Two plies of T300/5208 at 0 and 90 degrees, cooled by 100 K, in MPa:

    >>> from fecm.deck.catalogue import MATERIALS
    >>> from fecm.mechanics.laminate import laminate
    >>> ply = MATERIALS["T300/5208"].converted("mm-N-s")
    >>> plate = laminate(ply, (0.0, 90.0, 90.0, 0.0), [0.125] * 4)
    >>> residual_stresses(plate, -2e-6, -2.25e-3).stresses[0, 0].round(2)
    array([-21.27,  21.27,   0.  ])
    """
    free = free_strains(laminate, along, across)
    plies = laminate.plies
    stress = np.einsum("pij,pj->pi", plies.stiffness, free)  # force/area per ply
    lower, upper = plies.faces[:-1, None], plies.faces[1:, None]
    N = (stress * (upper - lower)).sum(axis=0)
    M = (stress * (upper**2 - lower**2)).sum(axis=0) / 2.0
    ABD = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    try:
        mean = np.linalg.solve(ABD, np.concatenate([N, M]))
    except np.linalg.LinAlgError:
        mean = np.full(6, np.nan)
    # T Qbar (eps0 + z kappa) of the laminate minus T Qbar e of the ply.
    per_strain = in_plane_stresses(laminate)
    total = per_strain @ mean - np.einsum("pfij,pj->pfi", per_strain[..., :3], free)
    return Residual(total, mean[:3], mean[3:])
