"""Springs and one-sided supports at nodes.

A spring to ground has the force -k u on its dof, and the energy k u^2/2.  A one-sided support acts
on w: with the side s and the gap g its force is

    -s r,  r = k max(0, s w - g),

and its energy k max(0, s w - g)^2/2.  w is positive along the push, so that a support under the
plate, on the face away from the projectile, has s = 1, and the tip of a clamp on the struck face
has s = -1.  A support is closed if s w >= g.

The energy of a spring is half the product of u and its force.  With a gap the product is larger by
r g, the excess work; the quadratic strains of a nonlinear plate have one too (see membrane.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.interpolation import W

ROUNDING = 1e-12  # of stiffnesses that are meant to be equal


@dataclass(frozen=True, eq=False)
class NodeSupports:
    """Springs and one-sided supports, (n,) each.

    Attributes
    ----------
    node, dof : ndarray of int (n,)
        Node and dof, from 0.
    side : ndarray (n,)
        1 or -1 for a one-sided support; 0 for a spring, which pushes and pulls.
    stiffness : ndarray (n,)
        Force/length; force*length for rotations.
    gap : ndarray (n,)
        Gap of a one-sided support, length.
    """

    node: Indices
    dof: Indices
    side: Floats
    stiffness: Floats
    gap: Floats

    @property
    def is_one_sided(self) -> Bools:
        """Whether each support is one-sided, (n,)."""
        return np.asarray(self.side != 0.0)

    def select(self, rows: Bools) -> NodeSupports:
        """Return the supports of a mask, (n,)."""
        return NodeSupports(
            self.node[rows],
            self.dof[rows],
            self.side[rows],
            self.stiffness[rows],
            self.gap[rows],
        )

    def held(self) -> NodeSupports:
        """Return the supports as springs: all one-sided supports are closed."""
        return replace(self, side=np.zeros_like(self.side), gap=np.zeros_like(self.gap))

    def without_gaps(self) -> NodeSupports:
        """Return the supports without their gaps."""
        return replace(self, gap=np.zeros_like(self.gap))

    def joined(self, other: NodeSupports) -> NodeSupports:
        """Return these supports and others."""
        return NodeSupports(
            np.concatenate([self.node, other.node]),
            np.concatenate([self.dof, other.dof]),
            np.concatenate([self.side, other.side]),
            np.concatenate([self.stiffness, other.stiffness]),
            np.concatenate([self.gap, other.gap]),
        )

    def of(self, field: Floats) -> Floats:
        """Return the displacement of each support's dof, (n,), in a field, (numnp, 5)."""
        return np.asarray(field[self.node, self.dof])

    def closed(self, displacement: Floats) -> Bools:
        """Return whether each support is closed at displacements of the dofs, (n,)."""
        return np.asarray(~self.is_one_sided | (self.side * displacement >= self.gap))

    def reactions(self, displacement: Floats) -> Floats:
        """Return the internal force of each support, (n,), at displacements of the dofs, (n,).

        The support acts on the plate with the opposite force.
        """
        depth = np.maximum(self.side * displacement - self.gap, 0.0)
        return np.asarray(
            self.stiffness * np.where(self.is_one_sided, self.side * depth, displacement)
        )

    def excess_work(self, displacement: Floats) -> float:
        """Return the product of displacements and forces minus twice the energy."""
        depth = np.maximum(self.side * displacement - self.gap, 0.0)
        return float((self.stiffness * self.gap * depth).sum())

    def energy(self, displacement: Floats) -> float:
        """Return the energy of the supports at displacements of the dofs, (n,)."""
        work = float((displacement * self.reactions(displacement)).sum())
        return 0.5 * (work - self.excess_work(displacement))

    def forces(self, field: Floats) -> Floats:
        """Return the internal forces of all dofs, (numnp, 5), in a displacement field."""
        return self.summed(self.reactions(self.of(field)), len(field))

    def diagonal(self, rows: Bools, numnp: int) -> Floats:
        """Return the stiffness of all dofs, (numnp, 5), of the supports of a mask, (n,)."""
        return self.summed(np.where(rows, self.stiffness, 0.0), numnp)

    def summed(self, values: Floats, numnp: int) -> Floats:
        """Sum values of the supports, (n,), over the dofs of the nodes, (numnp, 5)."""
        total = np.zeros((numnp, 5))
        np.add.at(total, (self.node, self.dof), values)
        return total

    def symmetric(self, images: Indices) -> NodeSupports:
        """Return the supports without rounding errors that break the symmetry of a half turn.

        `images` (numnp,) are the images of the nodes. Stiffnesses that are equal but for rounding
        become equal; others stay as they are.
        """
        order, image_order = (
            np.lexsort((self.gap, self.side, self.dof, node))
            for node in (self.node, images[self.node])
        )
        stiffness = self.stiffness.copy()
        stiffness[order] = self.stiffness[image_order]
        if not np.allclose(stiffness, self.stiffness, ROUNDING, 0.0):
            return self
        return replace(self, stiffness=(self.stiffness + stiffness) / 2.0)

    def is_invariant(self, images: Indices) -> bool:
        """Return whether a half turn maps the supports onto themselves.

        `images` (numnp,) are the images of the nodes. w keeps its sign, and so do the sides.
        """
        order = np.lexsort((self.gap, self.stiffness, self.side, self.dof, self.node))
        turned = replace(self, node=images[self.node])
        image_order = np.lexsort(
            (turned.gap, turned.stiffness, turned.side, turned.dof, turned.node)
        )
        return all(
            np.array_equal(getattr(self, name)[order], getattr(turned, name)[image_order])
            for name in ("node", "dof", "side", "stiffness", "gap")
        )


def side_weights(ends: Indices, middle: Indices, lengths: Floats, numnp: int) -> Floats:
    """Return the length that each node stands for on sides of elements, (numnp,).

    These are the integrals of the shape functions along the sides.

    Parameters
    ----------
    ends : ndarray of int (n, 2)
        Nodes at the ends of each side, from 0.
    middle : ndarray of int (n,)
        Nodes in the middle; -1 for a side of two nodes.
    lengths : ndarray (n,)
        Lengths of the sides.
    numnp : int
        Number of nodes.
    """
    weights = np.zeros(numnp)
    has_middle = middle >= 0
    for corner in ends.T:
        np.add.at(weights, corner, np.where(has_middle, lengths / 6.0, lengths / 2.0))
    np.add.at(weights, middle[has_middle], lengths[has_middle] * 4.0 / 6.0)
    return weights


def one_sided(node: Indices, side: Floats, stiffness: Floats, gap: Floats) -> NodeSupports:
    """Return one-sided supports of w at nodes, from 0."""
    return NodeSupports(node, np.full(len(node), W), side, stiffness, gap)
