"""Values in another unit, order or place: each has a finding with its cause; sound ones none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Ply
from fecm.deck.catalogue import MATERIALS
from fecm.deck.findings import Finding
from fecm.deck.model import Allowables, Damping
from fecm.deck.units import MASS, NAMES, convert
from fecm.mechanics.mesh import MeshArrays
from fecm.problem.loading import load_deck
from fecm.problem.outline import unsupported
from fecm.problem.rules.time_step import clamped_frequency
from fecm.problem.rules.units import likely_unit
from tests.decks import DATA, ROOT
from tests.sound_plate import STRENGTHS, Edit, base, found, replaced, strengths, with_card, with_ply

XT, XC, YT, YC, *S = STRENGTHS


any_step = replaced(r"^DT,.*", "DT,,0.")
metal = with_ply(e1=7e4, e2=7e4, nu12=0.3, g12=2692.0, g13=26923.0, g23=26923.0)


def thick(text: str) -> str:
    """The plate with plies of 0.6, 9.6 thick."""
    text = replaced(r"     0\.184$", "       0.6")(text)
    return replaced("     2.944$", "       9.6")(text)


without_units = replaced(r"^UNIT\n.*\n", "")

MISTAKES: dict[str, tuple[Edit, str, str]] = {  # change, code, and what the text must name
    "strengths in Pa": (
        strengths(*(1e6 * s for s in STRENGTHS)), "W467", "look like Pa; mm, N and s need MPa"),
    "strengths in psi": (
        strengths(*(s / 6.894757e-3 for s in STRENGTHS)), "W467", "look like psi"),
    "strengths in GPa": (strengths(*(1e-3 * s for s in STRENGTHS)), "W467", "look like GPa"),
    "one strength in Pa": (
        strengths(XT, XC, 1e6 * YT, YC, *S), "W467", "6.2e+13 Pa in the units of UNIT"),
    "order XT YT XC YC": (strengths(XT, YT, XC, YC, *S), "W468", "in the order XT, YT, XC, YC"),
    "X and Y exchanged": (strengths(YT, YC, XT, XC, *S), "W468", "X and Y exchanged"),
    "tension and compression": (
        strengths(XC, XT, YC, YT, *S), "W468", "tension and compression exchanged"),
    "YT above XT": (strengths(400.0, XC, 450.0, 500.0, *S), "W468", "YT = 450 is not below XT"),
    "XT and XC": (strengths(XC, XT, YT, YC, *S), "W468", "typed with XT and XC exchanged"),
    "YT and YC": (strengths(XT, XC, YC, YT, *S), "W468", "typed with YT and YC exchanged"),
    "S12 in ksi": (
        strengths(XT, XC, YT, YC, 13.4, *S[1:]), "W553", "looks like ksi; mm, N and s need MPa"),
    "S12 and S13 in ksi": (
        strengths(XT, XC, YT, YC, 13.4, 13.4, S[2]), "W553", "YT = 62.3 (S13 too)"),
    "q = 1": (with_card("EXPE", "42000.,0.,0.,1."), "W437", "the power of loading is 1.5"),
    "alpha_p and s_p": (
        with_card("EXPE", "42000.,.094,.017,2.5"), "W550", "look exchanged"),
    "alpha1 and alpha2": (
        with_card("CURE", "-100.,", ",25.8E-6,-.5E-6", ""), "W551", "alpha1 = 2.58e-05 is above"),
    "beta1 and beta2": (
        with_card("CURE", "-100.,1.", ",-.5E-6,25.8E-6,.006,0.", ""), "W551", "beta1 = 0.006"),
    "expansions per deg F": (
        with_card("CURE", "-100.,", ",-.28E-6,14.3E-6", ""), "W552",
        "per kelvin alpha1 and alpha2 would be -5.04e-07 and 2.574e-05"),
    "rod's length and diameter": (
        replaced(r"^PROJ\n.*", "PROJ\n2,0,16.,210000.,7.85E-9\n1,1,25.\n2,0,25.\n"), "W554",
        "its diameter is 25, its length 16"),
    "10 kJ for 10 J": (
        replaced(r"^(ROD\n.{10}).*", r"\g<1>      1.E5"), "W555", "1e+04 J"),
    "G_IIc in J/m^2": (
        with_card("DELA", "787.9,"), "W469", "looks like J/m^2; mm, N and s need kJ/m^2"),
    "G_IIc in J/mm^2": (with_card("DELA", "7.879E-4,"), "W469", "0.788 J/m^2"),
    "1000 delaminations": (with_card("DELA", "0.7879,1000"), "W470", "15 interfaces"),
    "FAIL every 9000 steps": (
        replaced(r"^FAIL .*", "FAIL,,9000"), "W472", "evaluated 1 time in"),
    "FAIL after the loop": (
        lambda text: replaced(r"^NEXT$", "NEXT\nFAIL")(replaced(r"^FAIL .*\n", "")(text)),
        "W472", "outside the loop of RODP"),
    "ALLO without FAIL": (replaced(r"^FAIL .*\n", ""), "W471", "no exposure is computed"),
    "PATC with a blank field": (
        with_card("PATC", "DISC,,1.,50.,50."), "W474", "the card is `DISC,1.,50.,50.`"),
    "NU12 a tenth": (
        replaced(r"^(   1.57E-9      )0.32", r"\g<1>.008"), "W434", "unlike any ply"),
    "patch away from ROD's node": (
        with_card("PATC", "DISC,1.,20.,50."), "N473", "30 from node"),
    "radius of the indenter for the patch": (
        with_card("PATC", "DISC,8.,"), "W475", "radius of the indenter"),
    "the same without exposures": (
        lambda text: replaced(r"^(FAIL|PLYS).*\n", "")(with_card("PATC", "DISC,8.,")(text)),
        "N475", "2.7 times the thickness"),
    "damping ratio for a": (with_card("DAMP", "0.02,"), "W479", "looks like a damping ratio"),
    "a = 5e4": (with_card("DAMP", "5E4,"), "W480", "above 2.0"),
    "a = 1e6": (with_card("DAMP", "1E6,"), "W480", "above 2.0"),
    "gage's z in m": (
        with_card("GAGE", "1,60.,50.,.0015,0.", ""), "W477", "z looks like m"),
    "gage's direction in radians": (
        with_card("GAGE", "1,60.,50.,1.4,.785", ""), "W478", "45 degrees"),
    "k of a sphere of 0.008 mm": (
        with_card("EXPE", "1331.,0.,0.,1.5"), "W476",
        "radius that it was estimated from looks like m"),
    "k in lbf/in^1.5": (
        with_card("EXPE", "1.331E6,0.,0.,1.5"), "W476", "looks like lbf/in^1.5"),
    "k in N/m^1.5": (with_card("EXPE", "1.331E9,0.,0.,1.5"), "W435", "looks like N/m^1.5"),
    "EQUI and a factor": (
        replaced("^SHEA MITC$", "SHEA MITC EQUI\n.822,"), "W481", "reduced once more"),
    "kg for the force": (
        with_card("UNIT", "mm kg s"), "W482", "with mm, kg and s the force is in mN"),
    "UNIT in another order": (with_card("UNIT", "N mm s"), "W482", "unit of force, not of length"),
    "mass in kg": (with_card("PROJ", "0,0,0.2"), "W438", "looks like kg; mm, N and s need t"),
    "E2 a tenth": (with_ply(e2=908.0), "W584", "E2 = 908 looks like it has a digit too few"),
    "E2 tenfold": (with_ply(e2=90800.0), "W584", "E2 = 90800 looks like it has a digit too many"),
    "E1 a tenth": (with_ply(e1=17142.0), "W584", "E1 = 17142 looks like it has a digit too few"),
    "E1 tenfold": (
        lambda text: any_step(with_ply(e1=1714200.0)(text)), "W584",
        "E1 = 1.7142e+06 looks like it has a digit too many"),
    "E1 in Pa": (lambda text: any_step(with_ply(e1=1.7142e11)(text)), "W435", "(looks like Pa"),
    "E1 in Pa without UNIT": (
        lambda text: without_units(any_step(with_ply(e1=1.7142e11)(text))), "W584",
        "E1 = 1.7142e+11 seems to be in another unit"),
    "E2 of glass a tenth": (
        with_ply(e1=45600.0, e2=1620.0, g12=5830.0, g13=5830.0, g23=5790.0), "W583",
        "of the shear modulus or of E2"),
    "G12 a tenth": (with_ply(g12=529.0), "W583", "G12/E2 = 0.058"),
    "G12 tenfold": (with_ply(g12=52900.0), "W583", "G12/E2 = 5.8"),
    "G13 a tenth": (with_ply(g13=529.0), "W583", "G13/E2 = 0.058"),
    "G23 a tenth": (with_ply(g23=324.0), "W583", "G23/E2 = 0.036"),
    "G12 of a metal a tenth": (
        lambda text: any_step(metal(text)), "W583",
        "isotropic ply, E/(2 (1 + NU12)) = 2.692e+04"),
    "order G23, G13, G12": (with_ply(g12=3242.86, g23=5290.0), "W585", "look exchanged"),
    "order G12, G23, G13": (with_ply(g13=3242.86, g23=5290.0), "W585", "look exchanged"),
    "shear factor in per cent of 1": (
        replaced("^SHEA MITC$", "SHEA MITC\n.0833,"), "W586", "below 0.5"),
    "50 g in kg": (with_card("PROJ", "0,0,0.05"), "N587", "looks like kg; mm, N and s need t"),
    "stress-free temperature in kelvin": (
        with_card("CURE", "-428.,", ",.02E-6,22.5E-6", ""), "W588", "the change would be -155 K"),
    "the same beside strengths": (
        with_card("CURE", "-428.,", ",.02E-6,22.5E-6", ""), "W463",
        "the change of temperature is -428 K"),
    "diameter of the indenter for the patch of a thick plate": (
        lambda text: with_card("PATC", "DISC,16.,")(thick(text)), "W475",
        "radius of the indenter"),
    "radius of the indenter for the patch of a thick plate": (
        lambda text: with_card("PATC", "DISC,8.,")(thick(text)), "W475",
        "radius of the indenter"),
    "moduli in ksi": (
        with_ply(e1=24862.4, e2=1316.94, g12=767.25, g13=767.25, g23=470.34), "W435",
        "E2 1316.94 is 1.32e+09 Pa, outside 3e+09 to 2e+12 (looks like ksi; mm, N and s need MPa)"),
    "moduli of aramid in ksi": (
        with_ply(density=1.46e-9, e1=11023.0, e2=797.7, g12=333.6, g13=333.6, g23=284.3), "W435",
        "looks like ksi"),
    "density tenfold": (
        with_ply(density=1.57e-8), "W435", "is 1.57e+04 kg/m^3, outside 700 to 5000"),
    "density a tenth": (
        lambda text: any_step(with_ply(density=1.57e-10)(text)), "W435",
        "is 157 kg/m^3, outside 700 to 5000"),
    "density of a fabric tenfold": (
        with_ply(density=1.6e-8, e1=7e4, e2=7e4, nu12=0.06, g12=5e3, g13=4e3, g23=4e3), "W435",
        "is 1.6e+04 kg/m^3, outside 700 to 5000"),
    "G_IIc in lbf/in": (
        with_card("DELA", "4.5,"), "W469", "looks like lbf/in; mm, N and s need kJ/m^2"),
    "G_IIc a tenth": (with_card("DELA", ".07879,"), "W469", "78.8 J/m^2"),
    "damping in per cent": (
        with_card("DAMP", "2.,"), "W479", "4.8e-05 in the lowest mode: it looks like a damping"),
    "k tenfold": (with_card("EXPE", "420000.,0.,0.,1.5"), "W476", "about 1.2 m"),
    "k a tenth": (
        with_card("EXPE", "4200.,0.,0.,1.5"), "W476", "a digit is missing or the tip is soft"),
    "radius of the patch in m": (
        with_card("PATC", "DISC,.00096,"), "W568", "looks like m; mm, N and s need mm"),
    "preload in kN/mm": (
        with_card("PREL", ".02,0.,0."), "W569", "has no effect: it strains the plate by 1.1e-07"),
    "velocity in m/s": (
        replaced(r"^(ROD\n.{10}).*", r"\g<1>      1.73"), "W435", "looks like m/s"),
}  # fmt: skip


def test_the_plate_without_mistakes_has_no_finding_with_units_and_without() -> None:
    assert found(base()) == []
    assert found(without_units(base())) == []


@pytest.mark.parametrize(("edit", "code", "text"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named_with_its_cause_and_likely_unit(
    edit: Edit, code: str, text: str
) -> None:
    named = [f for f in found(edit(base())) if f.code == code]
    assert any(text in f"{finding.message} {finding.hint}" for finding in named)


# Rules that compare with the other values of the deck, where nothing names its units.
RELATIVE = ["strengths in Pa", "strengths in psi", "strengths in GPa", "G_IIc in J/m^2",
            "G_IIc in J/mm^2", "k of a sphere of 0.008 mm", "k in lbf/in^1.5", "mass in kg",
            "gage's z in m", "one strength in Pa"]  # fmt: skip


@pytest.mark.parametrize("name", RELATIVE)
def test_a_mistake_is_named_without_units_too(name: str) -> None:
    edit, code, _ = MISTAKES[name]
    assert code in {finding.code for finding in found(edit(without_units(base())))}


DECKS = [*(ROOT / "decks").glob("*.inp"), *(ROOT / "fecm" / "examples").glob("*.inp"),
         *DATA.glob("*.inp")]  # fmt: skip


@pytest.mark.parametrize("deck", DECKS, ids=lambda deck: deck.name)
@pytest.mark.few(3)  # of 10, 0.03 s each
def test_sound_decks_have_no_finding_of_these_rules(deck: Path) -> None:
    assert len(DECKS) > 8
    assert found(deck.read_text()) == []


def new_deck(
    ply: object, system: str, thickness: float, *, k: float = 4e4, damage: bool = False
) -> str:
    """Text of a deck of 100 x 100 mm in a system of units, hit by 20 g at 3 m/s."""

    def own(value: float, dimension: str) -> float:
        return convert(value, dimension, "mm-N-s", system)

    side = own(100.0, "length")
    deck = fecm.impact(
        fecm.Plate.rectangle((side, side), (2, 2), support="simple"),
        fecm.Laminate("[0/90]2s", ply, own(thickness, "length")),  # type: ignore[arg-type]
        fecm.RigidMass(own(2e-5, MASS)),
        fecm.Contact(own(k, "force/length^1.5"), 0.0, 0.0, 1.5),
        velocity=own(3000.0, "length/time"),
        duration=own(3e-5, "time"),
        dt=own(1e-8, "time"),
        every=1,
        units=system,
        damage=damage,
    )
    return deck.to_text()


# A foam is the core of a sandwich: a plate of it alone is doubtful.
PLIES = [name for name in MATERIALS if name != "Divinycell-H60"]


# Each ply in one of the systems in turn; the long tests have all pairs.
IN_UNITS = [
    pytest.param(name, system, marks=() if n % len(NAMES) == m else pytest.mark.long)
    for n, name in enumerate(PLIES)
    for m, system in enumerate(NAMES)
]


@pytest.mark.parametrize(("name", "system"), IN_UNITS)
@pytest.mark.few(3)  # of 18, 0.2 s each
def test_no_ply_of_the_catalogue_has_a_finding_in_any_units(name: str, system: str) -> None:
    has_damage = {"XT", "GIIc"} & MATERIALS[name].values.keys()
    text = new_deck(name, system, 0.25, damage=bool(has_damage))
    assert found(text) == []
    if system != "in-lbf-s":
        assert found(without_units(text)) == []


# Density (t/mm^3), nu12, E1, E2, G (MPa); XT, XC, YT, YC, S (MPa); G_IIc (N/mm).
OTHERS = {
    "steel": ((7.85e-9, 0.3, 207e3, 207e3, 79.6e3), (250.0, 250.0, 250.0, 250.0, 145.0), 5.0),
    "annealed aluminium": ((2.7e-9, 0.33, 69e3, 69e3, 26e3), (35.0, 35.0, 35.0, 35.0, 20.0), 5.0),
    "float glass": ((2.5e-9, 0.23, 70e3, 70e3, 28.5e3), (30.0, 800.0, 30.0, 800.0, 30.0), 0.05),
    "polycarbonate": ((1.2e-9, 0.37, 2300., 2300., 840.), (65.0, 80.0, 65.0, 80.0, 40.0), 3.0),
    "spruce": ((0.45e-9, 0.38, 11e3, 450.0, 700.0), (80.0, 40.0, 2.5, 5.0, 8.0), 0.4),
    "carbon in polyurethane": ((1.4e-9, 0.3, 90e3, 900., 300.), (1200., 300., 10., 30., 30.), 3.0),
    "woven glass, weft stronger": (
        (1.9e-9, 0.12, 22e3, 23e3, 3500.0), (350.0, 300.0, 380.0, 310.0, 60.0), 1.5),
}  # fmt: skip


@pytest.mark.parametrize("units", [True, False], ids=["UNIT", "no UNIT"])
@pytest.mark.parametrize(("elastic", "strong", "toughness"), OTHERS.values(), ids=OTHERS)
@pytest.mark.few(2)  # of 14, 0.1 s each
def test_other_materials_have_no_finding(
    elastic: tuple[float, ...], strong: tuple[float, ...], toughness: float, units: bool
) -> None:
    density, nu12, e1, e2, g = elastic
    k = 1.33 * e2 * 8.0**0.5  # of a rigid sphere of 8 mm
    text = new_deck(Ply(density, nu12, e1, e2, g, g, g), "mm-N-s", 0.25, k=k)
    text = text.replace("EXPE\n", Damping(1000.0).to_card().join(["DAMP\n", "\nEXPE\n"]))
    xt, xc, yt, yc, s = strong
    cards = Allowables(xt, xc, yt, yc, s, s, s).cards(None)  # type: ignore[arg-type]
    text = text.replace("EXPE\n", "\n".join([*cards, f"DELA\n{toughness},", "EXPE\n"]))
    text = replaced(r"^NEXT$", "FAIL\nNEXT")(text)
    assert found(text if units else without_units(text)) == []


def test_deliberate_values_have_no_finding() -> None:
    assert found(strengths(1e30, XC, 1e30, 1e30, *S)(base())) == []  # no failure in these modes
    loaded = with_card("PATC", "DISC,,50.,50.,200.")(base())
    assert found(loaded) == []


@pytest.mark.parametrize(
    ("value", "usual", "unit"),
    [(171420.0, 1e11, "MPa"), (17.5e6, 1e11, "psi"), (1.7e11, 1e11, "Pa"), (165.0, 1e11, "GPa"),
     (1e30, 1e11, ""), (np.inf, 1e11, "")],
)  # fmt: skip
def test_the_likely_unit_is_that_of_a_usual_value(value: float, usual: float, unit: str) -> None:
    assert likely_unit(value, "force/length^2", usual) == unit


# Thickness and distance between supports ----------------------------------------------------------


def strip(thickness: float, **supports: str) -> list[Finding]:
    """Findings about the thickness of a strip of 200 x 40."""
    deck = fecm.impact(
        fecm.Plate.rectangle((200, 40), (10, 4), edges=supports),
        fecm.Laminate("[0/90]2s", "IM7/8552", thickness / 8.0),
        fecm.RigidMass(1e-3),
        fecm.Contact(4e4, 0.0, 0.0, 1.5),
        velocity=1000.0,
        duration=1e-7,
        dt=1e-9,
        units="mm-N-s",
    )
    return [finding for finding in found(deck.to_text()) if finding.code[1:] == "430"]


ALL = dict.fromkeys(("left", "right", "bottom", "top"), "simple")
ENDS = dict.fromkeys(("left", "right"), "simple")


@pytest.mark.parametrize(
    ("thickness", "supports", "codes"),
    [(30.0, ALL, ["W430"]), (5.0, ALL, ["N430"]), (3.9, ALL, []), (19.0, ENDS, []),
     (30.0, ENDS, ["N430"]), (5.0, {}, ["N430"]), (30.0, {"left": "clamped"}, []),
     (0.01, ALL, ["W430"])],
)  # fmt: skip
@pytest.mark.few(3)  # of 8, 0.1 s each
def test_the_thickness_is_compared_with_the_shorter_distance_between_supports(
    thickness: float, supports: dict[str, str], codes: list[str]
) -> None:
    assert [finding.code for finding in strip(thickness, **supports)] == codes


def test_the_distance_between_supports_of_a_round_window_is_its_diameter() -> None:
    x, y = np.meshgrid(np.linspace(-10.0, 10.0, 81), np.linspace(-10.0, 10.0, 81))
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    codes = np.zeros((len(places), 5), dtype=int)
    codes[:, 2] = np.abs(np.hypot(*places.T) - 6.0) < 0.2
    (problem,) = load_deck(base()).problems
    elements = np.arange(1, len(places) // 9 * 9 + 1, dtype=np.int32).reshape(-1, 9)
    values = {**vars(problem.mesh), "coordinates": places, "codes": codes, "elements": elements}
    fields = MeshArrays.__dataclass_fields__
    mesh = MeshArrays(**{name: values[name] for name in fields})
    assert unsupported(mesh, (1.0, 2.0), mesh.coordinates)[0] == pytest.approx(
        2.0 * (6.0 - 0.2), rel=0.05
    )


def test_the_frequency_of_a_clamped_square_is_that_of_the_tables() -> None:
    # 35.99 (D/m)^(1/2)/a^2: A. W. Leissa, Vibration of Plates, NASA SP-160, 1969.
    steel = Ply(7.85e-9, 0.3, 207e3, 207e3, 207e3 / 2.6, 207e3 / 2.6, 207e3 / 2.6)
    (problem,) = load_deck(new_deck(steel, "mm-N-s", 0.25)).problems
    thickness = 8 * 0.25
    rigidity = 207e3 * thickness**3 / (12.0 * (1.0 - 0.3**2))
    expected = 35.99 * np.sqrt(rigidity / (7.85e-9 * thickness)) / 100.0**2
    assert clamped_frequency(problem) == pytest.approx(expected, rel=5e-3)
