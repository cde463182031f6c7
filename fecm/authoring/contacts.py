"""Named contacts: what was measured of an indenter on the report's laminate, for EXPE.

The report gives k for two indenters and two groups of specimens (Table 3.1), alpha_p and s_p for
all of them (section 3.2.2 and the input listing), and q for each indenter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fecm.authoring.materials import SYSTEMS
from fecm.deck.model import Indentation

# Constants of the report that are not the indenter's: alpha_p, s_p and reference 14's alpha_cr.
ALPHA_P, S_P, ALPHA_CR = 6.564e-4, 0.094, 3.16e-3
# System of units of the report.
SYSTEM = "in-lbf-s"


def lengths(system: str) -> float:
    """How many of a system's units of length an inch is."""
    return SYSTEMS[SYSTEM][1][0] / SYSTEMS[system][1][0]


@dataclass(frozen=True)
class NamedContact:
    """A contact with a name.

    Attributes
    ----------
    name : str
    law : Indentation
        Constants in in, lbf and s.
    source : str
        What was pressed into what, and who did.
    """

    name: str
    law: Indentation
    source: str

    def converted(self, system: str) -> Indentation:
        """Constants in a system of units, a key of :data:`~fecm.authoring.materials.SYSTEMS`."""
        if system == SYSTEM:
            return self.law
        force = SYSTEMS[SYSTEM][1][1] / SYSTEMS[system][1][1]
        length = lengths(system)
        return replace(
            self.law,
            k=float(f"{self.law.k * force / length**1.5:.6g}"),
            alpha_p=float(f"{self.law.alpha_p * length:.6g}"),
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
