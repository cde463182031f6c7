"""Named plies, and named contacts: measured constants of EXPE for an indenter on a laminate.

The report gives k for two indenters and two groups of specimens (Table 3.1), alpha_p and s_p for
all of them (section 3.2.2 and the input listing), and q for each indenter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fecm.deck.model import Indentation, Units
from fecm.deck.records import Ply
from fecm.deck.units import DENSITY, MODULUS, in_si

# Systems of units: names of length, force and time.
SYSTEMS = {
    name: dict(zip(Units.NAMES, name.split("-"), strict=True))
    for name in ("in-lbf-s", "m-N-s", "mm-N-s")
}


def convert(value: float, dimension: str, system: str, other: str) -> float:
    """A value in another system of units, with as many digits as the field of a card has."""
    before, after = in_si(dimension, SYSTEMS[system]), in_si(dimension, SYSTEMS[other])
    if before is None or after is None:
        raise LookupError(f"no unit of {dimension}")
    return value if system == other else float(f"{value * (before / after):.6g}")


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
        Publication of the constants.
    assumed : str
        Values that the source does not give.
    """

    name: str
    ply: Ply
    system: str
    source: str
    assumed: str = ""

    def converted(self, system: str) -> Ply:
        """Constants in another system of units; unchanged in their own."""
        ply = self.ply
        moduli = (ply.e1, ply.e2, ply.g12, ply.g13, ply.g23)
        return Ply(
            convert(ply.density, DENSITY, self.system, system),
            ply.nu12,
            *(convert(value, MODULUS, self.system, system) for value in moduli),
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

# Constants of the report that are not the indenter's: alpha_p, s_p and reference 14's alpha_cr.
ALPHA_P, S_P, ALPHA_CR = 6.564e-4, 0.094, 3.16e-3

# System of units of the report.
SYSTEM = "in-lbf-s"
COEFFICIENT = "force/length^1.5"


@dataclass(frozen=True)
class NamedContact:
    """A contact with a name.

    Attributes
    ----------
    name : str
    law : Indentation
        Constants in in, lbf and s.
    source : str
        Indenter, target and publication.
    """

    name: str
    law: Indentation
    source: str

    def converted(self, system: str) -> Indentation:
        """Constants in a system of units, a key of :data:`~fecm.deck.catalogue.SYSTEMS`."""
        return replace(
            self.law,
            k=convert(self.law.k, COEFFICIENT, SYSTEM, system),
            alpha_p=convert(self.law.alpha_p, "length", SYSTEM, system),
        )


_GROUPS = {"": "mean of both groups", "a": "[0/45/0/-45/0]2s", "b": "[90/45/90/-45/90]2s"}


def _table(size: str, group: str, k: float, q: float) -> NamedContact:
    """A column of Table 3.1."""
    return NamedContact(
        f"report-{size}{group}",
        Indentation(k, ALPHA_P, S_P, q),
        f"{size} in steel sphere on graphite/epoxy, {_GROUPS[group]}; T. M. Tan and C. T. Sun, "
        "NASA CR-168057, 1982, Table 3.1",
    )


CONTACTS = {
    contact.name: contact
    for contact in (
        _table("0.5", "", 1.330e6, 2.5),
        _table("0.5", "a", 1.284e6, 2.5),
        _table("0.5", "b", 1.376e6, 2.5),
        _table("0.75", "", 1.912e6, 2.0),
        _table("0.75", "a", 1.833e6, 2.0),
        _table("0.75", "b", 1.990e6, 2.0),
        NamedContact(
            "yang-0.5",
            Indentation(9.694e5, ALPHA_CR, 0.0, 2.5, Indentation.ACR),
            "0.5 in steel sphere on graphite/epoxy, by dial gage; S. H. Yang and C. T. Sun, "
            "NASA CR-165460, 1981, as in Table 3.1 of NASA CR-168057; the law of equation 3-7",
        ),
    )
}
