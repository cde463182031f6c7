"""Named plies and named contacts. A contact has measured constants of EXPE.

The report gives k for two indenters and two groups of specimens (Table 3.1), alpha_p and s_p for
all specimens (section 3.2.2 and the input listing), and q for each indenter.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from fecm._errors import warn
from fecm._inputs import lines_of, parsed_file, parsed_toml
from fecm._table import Table, html_table
from fecm.deck.model import Allowables, Deck, Delamination, Expansion, Indentation, Ply
from fecm.deck.units import (
    COEFFICIENT,
    DENSITY,
    MODULUS,
    TOUGHNESS,
    UnitsError,
    convert,
    in_si,
    system_named,
    unit_names,
    units_of,
)

# Units of the test standards, and the elastic constants of steel in these units.
STANDARD = "mm-N-s"
STEEL_MODULUS = 207e3
STEEL_POISSON = 0.3


def system_of(deck: Deck) -> str | None:
    """Return the system of units of a deck; None if it has no units or unknown ones."""
    try:
        return system_named("-".join(unit_names(deck).values()))
    except UnitsError:
        return None


# Keys of a ply in a TOML file, and their dimensions.
ELASTIC = {"density": DENSITY, "nu12": "", "E1": MODULUS, "E2": MODULUS, "G12": MODULUS}
KEYS = ELASTIC | {
    "G13": MODULUS,
    "G23": MODULUS,
    "nu23": "",
    "XT": MODULUS,
    "XC": MODULUS,
    "YT": MODULUS,
    "YC": MODULUS,
    "S12": MODULUS,
    "S13": MODULUS,
    "S23": MODULUS,
    "p_plus": "",
    "p_minus": "",
    "GIc": TOUGHNESS,
    "GIIc": TOUGHNESS,
    "thickness": "length",
    # Expansions per kelvin, and a temperature in degrees Celsius.
    "alpha1": "",
    "alpha2": "",
    "stress_free_temperature": "",
}
TEXTS = ("source", "assumed", "units")
SLOPES = ("p_plus", "p_minus")  # of Puck's criterion
EXPANSIONS = Expansion.THERMAL
STRENGTHS = ("XT", "XC", "YT", "YC", "S12")
SYSTEM_OF_FILES = "mm-N-s"  # system of units of a file without `units`
# Smallest E1 of a ply in Pa, and largest density of a core in kg/m^3.
SOFT, LIGHT = 1e9, 800.0
NU23 = 0.4  # nu23 of a ply of parallel fibres whose G23 does not give one
MOST_NU23 = 0.6  # largest nu23 that G23 may give
ISOTROPIC = 0.05  # largest relative difference of moduli from an isotropic solid's


def poissons_ratio_across(
    nu12: float, e1: float, e2: float, g12: float, g23: float | None
) -> float:
    """Return Poisson's ratio nu23 of a ply from its other constants.

    An isotropic ply has nu12. A ply of parallel fibres is isotropic across them: nu23 is E2/(2 G23)
    - 1, to four digits. It is 0.4 if G23 is not known, or gives a value that no ply has.

    Parameters
    ----------
    nu12 : float
        Poisson's ratio in the plane of the ply.
    e1, e2, g12 : float
        Moduli in the plane of the ply, force/area.
    g23 : float or None
        Shear modulus across the fibres, force/area; None if it is not known.

    Examples
    --------
    >>> poissons_ratio_across(0.3, 70e3, 70e3, 70e3 / 2.6, None)
    0.3
    >>> poissons_ratio_across(0.28, 181e3, 10.3e3, 7.17e3, 3.68e3)
    0.3995
    """
    shear = e1 / (2.0 * (1.0 + nu12))
    moduli = (e2, e1), (g12, shear), (g23 or shear, shear)
    if all(abs(value / isotropic - 1.0) < ISOTROPIC for value, isotropic in moduli):
        return nu12
    if g23 is None or not 0.0 <= (ratio := e2 / (2.0 * g23) - 1.0) <= MOST_NU23:
        return NU23
    return float(f"{ratio:.4g}")


class NamedPly(NamedTuple):
    """A ply with a name, which `fecm.Laminate` takes.

    Attributes
    ----------
    name : str
        Name of the ply.
    values : dict of str to float
        The known constants, named as in `fecm materials`, in the units of `system`.
    system : str
        Units of length, force and time, as in ``"mm-N-s"``.
    source : str
        Publication of the constants.
    assumed : str
        Assumptions about constants that the source does not give.
    """

    name: str
    values: dict[str, float]
    system: str
    source: str = ""
    assumed: str = ""

    def __hash__(self) -> int:
        return hash((self.name, self.system, self.source))  # `values` is a dictionary

    @property
    def ply(self) -> Ply:
        """Elastic constants in their own units."""
        return self.converted(self.system)

    @property
    def nu23(self) -> float:
        """Poisson's ratio across the fibres; :func:`poissons_ratio_across` if it is not given."""
        if (given := self.values.get("nu23")) is not None:
            return given
        nu12, e1, e2, g12 = (self.values[key] for key in ("nu12", "E1", "E2", "G12"))
        return poissons_ratio_across(nu12, e1, e2, g12, self.values.get("G23"))

    def value(self, key: str, system: str) -> float | None:
        """Return a constant in a system of units; None if it is not known.

        Examples
        --------
        >>> materials()["IM7/8552"].value("E1", "mm-ms-kg")  # GPa
        171.42
        """
        value, dimension = self.values.get(key), KEYS[key]
        if value is None or not dimension:
            return value
        return convert(value, dimension, self.system, system)

    def constants(self, system: str) -> dict[str, float]:
        """Return the known constants in a system of units; G13 and G23 are always there."""
        ply = self.converted(system)
        stated = {key: self.value(key, system) for key in self.values}
        all_constants = {"G13": ply.g13, "G23": ply.g23, **stated}
        return {key: value for key, value in all_constants.items() if value is not None}

    def to_dict(self, system: str) -> dict[str, object]:
        """Return name, units, a value or None for each of the :data:`KEYS`, and source."""
        constants = self.constants(system)
        return {
            "name": self.name,
            "units": system,
            **{key: constants.get(key) for key in KEYS},
            "source": self.source,
            "assumed": self.assumed,
        }

    def converted(self, system: str) -> Ply:
        """Return the elastic constants in a system of units.

        An unknown G13 is G12; an unknown G23 is E2/(2 (1 + nu23)).
        """
        density, nu12, e1, e2, g12 = (self.value(key, system) or 0.0 for key in ELASTIC)
        g13 = self.value("G13", system) or g12
        g23 = self.value("G23", system) or float(f"{e2 / (2.0 * (1.0 + self.nu23)):.6g}")
        return Ply(density, nu12, e1, e2, g12, g13, g23)

    def allowables(self, system: str) -> Allowables | None:
        """Return the strengths in a system of units; None if one of :data:`STRENGTHS` is missing.

        An unknown S13 is S12; an unknown S23 is S13.
        """
        xt, xc, yt, yc, s12 = (self.value(key, system) for key in STRENGTHS)
        if xt is None or xc is None or yt is None or yc is None or s12 is None:
            return None
        s13 = self.value("S13", system) or s12
        s23 = self.value("S23", system) or s13
        plus = self.values.get("p_plus", Allowables.p_plus)
        minus = self.values.get("p_minus", Allowables.p_minus)
        return Allowables(
            xt=xt, xc=xc, yt=yt, yc=yc, s12=s12, s13=s13, s23=s23, p_plus=plus, p_minus=minus
        )

    @property
    def expansion(self) -> Expansion | None:
        """Thermal expansion; None if a coefficient is not known."""
        alpha1, alpha2 = (self.values.get(key) for key in EXPANSIONS)
        if alpha1 is None or alpha2 is None:
            return None
        return Expansion(alpha1=alpha1, alpha2=alpha2)

    def delamination(self, system: str) -> Delamination | None:
        """Return the toughness G_IIc in a system of units; None if it is not known."""
        toughness = self.value("GIIc", system)
        return None if toughness is None else Delamination(toughness=toughness)


def read_plies(text: str) -> dict[str, NamedPly]:
    """Read the plies of a TOML file, by name.

    Each table is a ply with numbers, named as in :data:`KEYS`, and the texts `source` and
    `assumed`. A file or a ply may give its system of units as `units`; the default is mm-N-s.
    Raises ValueError if a name is unknown, a value or unit is implausible, or the file is not TOML.
    """
    try:
        tables = parsed_toml(text)
    except ValueError:
        if form := _detect_format(text):
            raise ValueError(
                f"this is {form}, not TOML; begin each ply with a line such as "
                '["its name"], and write E1 = 140e3 and so on below'
            ) from None
        raise
    units = tables.pop("units", SYSTEM_OF_FILES)
    for name, table in tables.items():
        if not isinstance(table, dict):
            message = f'{name} is outside the table of a ply; begin each ply with ["its name"]'
            raise ValueError(message)
    if not tables:
        raise ValueError('no plies; begin each with ["its name"]')
    return {name: _parse_ply(name, {"units": units, **table}) for name, table in tables.items()}


def _detect_format(text: str) -> str:
    """Name the format of a text that is not TOML; empty if it looks like TOML with a mistake."""
    import json  # takes 2 ms; only a mistake needs it

    first_letter = text.lstrip()[:1]
    if first_letter in ("<", "{"):
        return {"<": "XML", "{": "JSON"}[first_letter]
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        first = next((line for line in lines_of(text) if line.strip() and line[0] != "#"), "")
        is_table = "=" not in first and first_letter != "[" and re.search("[,;\t]", first)
        return "a table (CSV)" if is_table else ""
    return "JSON"


def _warn_if_soft(ply: NamedPly) -> None:
    """Warn about an implausibly small E1, which may be in GPa instead of the unit of the system."""
    units = units_of(ply.system)
    modulus_unit, density_unit = in_si(MODULUS, units), in_si(DENSITY, units)
    if modulus_unit is None or density_unit is None:
        return
    e1, is_core = ply.values["E1"], ply.values["density"] * density_unit < LIGHT
    if e1 * modulus_unit < SOFT and not is_core:
        warn(
            f"[{ply.name}] E1 {e1:g} is {e1 * modulus_unit / 1e9:.3g} GPa in {ply.system}, too "
            'soft for a ply; if the moduli are in GPa, write units = "mm-kN-ms", or multiply them'
        )


def _parse_ply(name: str, table: Mapping[str, object]) -> NamedPly:
    numbers: dict[str, float] = {}
    texts: dict[str, str] = {}
    for key, value in table.items():
        if key in TEXTS:
            if not isinstance(value, str):
                raise ValueError(f"[{name}] {key}: {value!r} is not a text in quotes")
            texts[key] = value
        elif key in KEYS:
            numbers[key] = _check_constant(name, key, value)
        else:
            message = f"[{name}] {key} is unknown; the keys are {', '.join((*KEYS, *TEXTS))}"
            raise ValueError(message)
    try:
        system = system_named(texts["units"])
    except UnitsError as error:
        raise ValueError(f"[{name}] units: {error}") from None
    if missing := [key for key in ELASTIC if key not in numbers]:
        raise ValueError(f"[{name}] {' and '.join(missing)} missing")
    if numbers["nu12"] ** 2 >= numbers["E1"] / numbers["E2"]:
        raise ValueError(
            f"[{name}] nu12: {numbers['nu12']:g} is too large; nu12² must be below E1/E2; in fibre "
            "composites nu12 is 0.2 to 0.4"
        )
    values = {key: numbers[key] for key in KEYS if key in numbers}
    ply = NamedPly(name, values, system, texts.get("source", ""), texts.get("assumed", ""))
    _warn_if_soft(ply)
    return ply


def _check_constant(name: str, key: str, value: object) -> float:
    """Return a constant of a ply as a float; raise ValueError if it is implausible."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"[{name}] {key}: {value!r} is not a number")
    if not math.isfinite(value) or (KEYS[key] and value <= 0.0):
        hint = "; compressive strengths are positive too" if key in ("XC", "YC") else ""
        raise ValueError(f"[{name}] {key}: {value:g} is not a positive number{hint}")
    if key in SLOPES and not 0.0 < value < 1.0:
        raise ValueError(f"[{name}] {key}: {value:g} is not between 0 and 1")
    if key in EXPANSIONS and abs(value) > Expansion.LARGEST:
        raise ValueError(f"[{name}] {key}: {value:g} is above {Expansion.LARGEST:g} per kelvin")
    return float(value)


def _read_resource(file: str) -> str:
    return (resources.files("fecm.deck") / file).read_text("utf-8")


MATERIALS = read_plies(_read_resource("materials.toml"))


def nu23_of(ply: Ply, system: str | None) -> float:
    """Return Poisson's ratio nu23 of a ply.

    A named ply with these constants has its own value. Otherwise the value follows from the
    constants by :func:`poissons_ratio_across`.
    """
    if (named := named_ply(ply, system)) is not None:
        return named.nu23
    return poissons_ratio_across(ply.nu12, ply.e1, ply.e2, ply.g12, ply.g23)


def named_ply(ply: Ply, system: str | None) -> NamedPly | None:
    """Return the named ply with these constants in a system of units; None without a match."""
    return None if system is None else _by_constants(system).get(ply)


@cache
def _by_constants(system: str) -> dict[Ply, NamedPly]:
    """Return the named plies by their constants; the first name of equal plies wins."""
    return {named.converted(system): named for named in reversed(MATERIALS.values())}


def material_names(deck: Deck) -> dict[int, str]:
    """Return the names of the materials of a deck, by number.

    A material takes the name of the named ply with the same constants; otherwise it is
    ``material N``.
    """
    system = system_of(deck)
    named = {number: named_ply(ply, system) for number, ply in deck.plies.items()}
    return {n: f"material {n}" if ply is None else ply.name for n, ply in named.items()}


class NamedPlies(dict[str, NamedPly]):
    """Named plies, which notebooks show as a table."""

    def _repr_html_(self) -> str:
        columns = ("E1", "E2", "nu12", "G12", "density", "thickness")
        rows = tuple(
            (name, *(f"{ply.values.get(key, math.nan):g}" for key in columns), ply.system)
            for name, ply in self.items()
        )
        return html_table(Table(rows, ("ply", *columns, "units"), "Plies"))


def materials(file: str | Path | None = None) -> NamedPlies:
    """Return the named plies with their sources, as `fecm materials` lists them.

    Parameters
    ----------
    file : str or Path, optional
        TOML file of plies; the catalogue of the package by default.

    Returns
    -------
    dict of str to NamedPly
        Plies by their names; notebooks show them as a table.

    Raises
    ------
    ValueError
        If a name is unknown, a value or unit is implausible, or the file is not TOML.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> ply = materials()["IM7/8552"]
    >>> ply.values["E1"], ply.system
    (171420.0, 'mm-N-s')
    >>> ply.converted("mm-ms-kg").e1  # GPa
    171.42
    """
    return NamedPlies(MATERIALS if file is None else parsed_file(Path(file), read_plies))


SYSTEM = "in-lbf-s"  # system of units of the report
# Constants of the report that do not depend on the indenter, in the units of the report.
ALPHA_P = 6.564e-4  # critical indentation
S_P = 0.094  # slope of the permanent over the maximum indentation
ALPHA_CR = 3.16e-3  # critical indentation of equation 3-7, from reference 14


class NamedContact(NamedTuple):
    """A measured contact law with a name, which `fecm.impact` takes.

    Attributes
    ----------
    name : str
        Name of the law.
    law : Indentation
        Its constants in in, lbf and s.
    source : str
        Indenter, target and publication.
    """

    name: str
    law: Indentation
    source: str

    def converted(self, system: str) -> Indentation:
        """Return the constants in a system of units."""
        k = convert(self.law.k, COEFFICIENT, SYSTEM, system)
        return replace(self.law, k=k, alpha_p=convert(self.law.alpha_p, "length", SYSTEM, system))


CONTACTS = {
    name: NamedContact(name, Indentation(**table["law"]), table["source"])
    for name, table in parsed_toml(_read_resource("contacts.toml")).items()
}


def contacts() -> dict[str, NamedContact]:
    """Return the named contact laws with their sources, as `fecm indent contacts` lists them.

    Returns
    -------
    dict of str to NamedContact
        Laws by their names.

    Examples
    --------
    >>> contacts()["report-0.5"].converted("mm-N-s").k  # N/mm^1.5
    46215.5
    """
    return dict(CONTACTS)
