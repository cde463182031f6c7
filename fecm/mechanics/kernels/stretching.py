"""Midplane of a nonlinear plate by the compiled kernels.

In: displacement fields (fields, numnp, 5).  Out: energies and largest values of each, as in
:class:`~fecm.mechanics.stretching.Stretching`.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fecm._typing import Floats
from fecm.mechanics import strains as assumed_shear
from fecm.mechanics.interpolation import interpolate, jacobian_determinants
from fecm.mechanics.kernels import LIBRARY, Doubles, Structure, filled, floats
from fecm.mechanics.kernels.strains import CompiledStrains, MidplaneStruct, StrainsStruct, midplane
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.stretching import (
    MidplaneField,
    Stretching,
    bending_stiffness,
    largest_principal,
)

ENERGIES, VALUES = 4, 7  # membrane, bending, preload, shear; slope, strain, force


class StretchedStruct(Structure):
    """Elements with the same nodes present and the same laminate.

    The arrays; both widths are the padded numbers of points:

    ================  ====================  =============================================
    `area`            (elements, width)     area that a point represents; 0 for padding
    `half`            (elements, width)     half thickness, 0 near the load
    `shear_area`      (elements, width)     area of the points of the transverse shear
    `stretching`      (3, 3)                A
    `coupling`        (3, 3)                B
    `compliance`      (3, 3)                A^-1
    `bending`         (3, 3)                D - B A^-1 B
    `transverse`      (2, 2)                transverse shear stiffness, xz, yz
    `preload`         (3,)                  membrane force N0
    `preload_strain`  (3,)                  A^-1 N0
    ================  ====================  =============================================
    """

    _fields_ = (
        ("midplane", MidplaneStruct),
        ("sheared", StrainsStruct),
        ("area", Doubles),
        ("half", Doubles),
        ("shear_area", Doubles),
        ("stretching", Doubles),
        ("coupling", Doubles),
        ("compliance", Doubles),
        ("bending", Doubles),
        ("transverse", Doubles),
        ("preload", Doubles),
        ("preload_strain", Doubles),
    )


class CompiledStretching(Stretching):
    """Midplane that the compiled kernels evaluate."""

    @cached_property
    def _families(self) -> list[StretchedStruct]:
        return [self._structure(family) for family in self._plate.families]

    @cached_property
    def _loaded(self) -> list[MidplaneStruct]:
        return [
            midplane(part.block, part.rule, curvature=self._plate.curvature, nonlinear=True)
            for part in self._at_load
        ]

    def _structure(self, family: ElementBlock) -> StretchedStruct:
        """Return the structure of a family."""
        plate = self._plate
        rule, shear_rule = plate.rules.bending, assumed_shear.quadrature(family)
        laminate = plate.laminate_of(family)
        shapes = interpolate(family, rule)
        x, y = np.einsum("pn,eni->iep", shapes.N, family.coordinates)
        sheared = plate.strain_field(shear_rule, CompiledStrains)
        assert isinstance(sheared, CompiledStrains)
        compliance = np.linalg.inv(laminate.A)
        preload = np.array(plate.preload)
        return StretchedStruct(
            midplane=midplane(family, rule, curvature=plate.curvature, nonlinear=True),
            sheared=sheared.structure(family),
            area=filled(shapes.jxw),
            half=filled(np.where(self._near(x, y), 0.0, laminate.thickness / 2.0)),
            shear_area=filled(jacobian_determinants(family, shear_rule) * shear_rule.weights),
            stretching=np.ascontiguousarray(laminate.A),
            coupling=np.ascontiguousarray(laminate.B),
            compliance=compliance,
            bending=bending_stiffness(laminate),
            transverse=np.ascontiguousarray(laminate.shear),
            preload=preload,
            preload_strain=compliance @ preload,
        )

    def evaluate(self, fields: Floats) -> MidplaneField:
        """Evaluate displacement fields; see :meth:`Stretching.evaluate`."""
        u = np.ascontiguousarray(fields)
        families, loaded = self._families, self._loaded
        values = np.empty((len(u), VALUES))
        strains = np.empty((len(u), len(loaded), 6))
        LIBRARY.fecm_stretching(
            (StretchedStruct * len(families))(*families),
            len(families),
            (MidplaneStruct * len(loaded))(*loaded),
            len(loaded),
            len(u),
            u[0].size,
            floats(u),
            floats(values),
            floats(strains),
        )
        membrane, bending, preload, shear, slope, strain, force = values.T
        force_at_load = moment_at_load = np.zeros(len(u))
        if loaded:
            eps, kappa = strains[..., :3], strains[..., 3:]
            A, B, D = (
                np.stack([getattr(part.laminate, name) for part in self._at_load])
                for name in ("A", "B", "D")
            )
            forces = np.einsum("eij,fej->fei", A, eps) + np.einsum("eij,fej->fei", B, kappa)
            moments = np.einsum("eij,fej->fei", B, eps) + np.einsum("eij,fej->fei", D, kappa)
            force_at_load = largest_principal(self._preload + forces.mean(axis=1))
            moment_at_load = largest_principal(moments.mean(axis=1))
        return MidplaneField(
            energy=membrane,
            strain_energy=membrane + bending + preload + shear,
            preload_energy=preload,
            largest_slope=slope,
            largest_strain=strain,
            largest_force=force,
            force_at_load=force_at_load,
            moment_at_load=moment_at_load,
        )
