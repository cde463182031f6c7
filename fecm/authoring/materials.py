"""Named plies, each with its source.

Constants are in the units of their source.  Where a source gives no transverse shear moduli, G13 is
taken as G12, and G23 as E2/2(1 + nu23) with nu23 = 0.4; `assumed` says so.
"""

from __future__ import annotations

from dataclasses import dataclass

from fecm.deck.records import Ply

# Systems of units: names of length, force and time, and one of each in m, N and s.
SYSTEMS = {
    "in-lbf-s": (("in", "lbf", "s"), (0.0254, 4.4482216152605, 1.0)),
    "m-N-s": (("m", "N", "s"), (1.0, 1.0, 1.0)),
    "mm-N-s": (("mm", "N", "s"), (1e-3, 1.0, 1.0)),
}
NU23 = 0.4


@dataclass(frozen=True)
class NamedPly:
    """A ply with a name.

    Attributes
    ----------
    name : str
    ply : Ply
        Constants in the units of `system`.
    system : str
        A key of :data:`SYSTEMS`.
    source : str
        Where the constants were published.
    assumed : str
        What the source does not give.
    """

    name: str
    ply: Ply
    system: str
    source: str
    assumed: str = ""

    def converted(self, system: str) -> Ply:
        """Constants in another system of units; unchanged in their own."""
        if system == self.system:
            return self.ply
        (_, (l0, f0, t0)), (_, (l1, f1, t1)) = SYSTEMS[self.system], SYSTEMS[system]
        modulus = (f0 / f1) * (l1 / l0) ** 2
        # Density is force time^2/length^4.
        density = (f0 / f1) * (t0 / t1) ** 2 * (l1 / l0) ** 4
        ply = self.ply

        def short(value: float) -> float:
            return float(f"{value:.6g}")  # as many digits as a card's field has

        return Ply(
            short(ply.density * density),
            ply.nu12,
            *(short(value * modulus) for value in (ply.e1, ply.e2, ply.g12, ply.g13, ply.g23)),
        )


def _tsai_hahn(
    name: str, e1: float, e2: float, nu12: float, g12: float, specific_gravity: float
) -> NamedPly:
    """A ply of Tsai and Hahn's table: moduli in GPa."""
    g23 = round(e2 / (2.0 * (1.0 + NU23)), 2)
    moduli = (1e9 * value for value in (e1, e2, g12, g12, g23))
    return NamedPly(
        name,
        Ply(1000.0 * specific_gravity, nu12, *moduli),
        "m-N-s",
        "S. W. Tsai and H. T. Hahn, Introduction to Composite Materials, Technomic 1980",
        f"G13 = G12; G23 from nu23 = {NU23:g}",
    )


MATERIALS = {
    material.name: material
    for material in (
        NamedPly(
            "report",
            Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6),
            "in-lbf-s",
            "T. M. Tan and C. T. Sun, NASA CR-168057, 1982, equation 2-25 (graphite/epoxy)",
        ),
        _tsai_hahn("T300/5208", 181.0, 10.3, 0.28, 7.17, 1.6),
        _tsai_hahn("B4/5505", 204.0, 18.5, 0.23, 5.59, 2.0),
        _tsai_hahn("AS/3501", 138.0, 8.96, 0.30, 7.1, 1.6),
        _tsai_hahn("Scotchply-1002", 38.6, 8.27, 0.26, 4.14, 1.8),
        _tsai_hahn("Kevlar49/epoxy", 76.0, 5.5, 0.34, 2.3, 1.46),
    )
}
