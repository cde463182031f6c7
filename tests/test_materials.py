"""Named plies: strengths and toughness of the catalogue, and users' files."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.deck.catalogue import MATERIALS
from fecm.deck.model import Allowables, Deck, Delamination, Indentation
from fecm.deck.units import NAMES, UnitsError, system_named
from fecm.problem.loading import load_deck
from tests.calls import Done, assert_unusable, call

PLATE = (
    "--size", "100x80", "--mesh", "2x2", "--layup", "[0/90]s", "--ply-thickness", ".125",
    "--velocity", "2000", "--law", "5e4,0,0,1.5", "--projectile", "mass:1e-3",
    "--duration", "1e-5", "--patch", "none",
)  # fmt: skip
OWN = '[mine]\ndensity=1.6e-9\nnu12=0.3\nE1=140e3\nE2=9e3\nG12=5e3\nsource="a test"\n'


def new(*options: str | Path) -> Done:
    return call("new", "-", *PLATE, *options)


def deck_of(*options: str | Path) -> Deck:
    answer = new(*options)
    assert answer.exit_code == 0, answer.stderr
    return fecm.read_one(answer.stdout)


# Soden, Hinton and Kaddour 1998, tables 1 and 2; Camanho, Maimi and Davila 2007, tables 2 and 3.
@pytest.mark.parametrize(
    ("name", "moduli", "strengths"),
    [
        ("AS4/3501-6", (126e3, 11e3, 6.6e3), (1950, 1480, 48, 200, 79)),
        ("T300/914", (138e3, 11e3, 5.5e3), (1500, 900, 27, 200, 80)),
        ("E-glass/LY556", (53.48e3, 17.7e3, 5.83e3), (1140, 570, 35, 114, 72)),
        ("E-glass/MY750", (45.6e3, 16.2e3, 5.83e3), (1280, 800, 40, 145, 73)),
        ("IM7/8552", (171.42e3, 9.08e3, 5.29e3), (2326.2, 1200.1, 62.3, 199.8, 92.3)),
    ],
)
def test_published_plies_have_the_published_values(
    name: str, moduli: tuple[float, ...], strengths: tuple[float, ...]
) -> None:
    material = MATERIALS[name]
    assert (material.ply.e1, material.ply.e2, material.ply.g12) == moduli
    actual = material.allowables("mm-N-s")
    assert actual is not None
    assert (actual.xt, actual.xc, actual.yt, actual.yc, actual.s12) == strengths


@pytest.mark.parametrize("name", MATERIALS)
def test_every_ply_is_plausible_and_has_a_source(name: str) -> None:
    material = MATERIALS[name]
    ply = material.converted("mm-N-s")
    assert material.source
    if name == "Divinycell-H60":  # a foam
        assert (ply.density, ply.e1, ply.g13) == (6e-11, 75.0, 20.0)
        return
    assert 1.2e-9 < ply.density < (2.9e-9 if name == "2024-T3" else 2.3e-9)
    assert 1.5e3 < ply.g23 <= ply.e2 <= ply.e1 < 250e3
    strengths = material.allowables("mm-N-s")
    if strengths is not None:
        assert 10 < min(strengths.yt, strengths.s12) < max(strengths.xt, strengths.xc) < 4000


@pytest.mark.parametrize("units", NAMES)
@pytest.mark.few(2)  # of 5, 0.08 s each
def test_damage_adds_strengths_and_toughness_in_the_decks_units(units: str) -> None:
    pascal, metre = {
        "mm-N-s": (1e6, 1e-3),
        "m-N-s": (1.0, 1.0),
        "in-lbf-s": (6894.757, 0.0254),
        "mm-kN-ms": (1e9, 1e-3),
        "mm-N-ms": (1e6, 1e-3),
    }[units]
    deck = deck_of("--material", "IM7/8552", "--damage", "--units", units)
    allowables, delamination = deck.require(Allowables), deck.require(Delamination)
    assert allowables.xc * pascal == pytest.approx(1200.1e6, rel=1e-5)
    assert allowables.s23 == allowables.s13 == allowables.s12
    assert delamination.toughness * pascal * metre == pytest.approx(787.9, rel=1e-5)
    every = {macro.word: macro.value for macro in deck.macros}
    assert every["DISP"] == 2.0 * every["FAIL"]


def test_what_a_ply_lacks_is_told_or_refused() -> None:
    answer = new("--material", "IM7/8551-7", "--damage")
    assert "note: IM7/8551-7 has no GIIc, so no delamination threshold (DELA)" in answer.stderr
    deck = fecm.read_one(answer.stdout)
    assert deck.require(Allowables).s23 == 57.0
    assert not deck.has(Delamination)
    for refused in (
        new("--material", "report", "--damage", "--units", "mm-N-s"),
        new("--ply", "1.6e-9,.3,140e3,9e3,5e3,5e3,3e3", "--damage"),
    ):
        assert_unusable(refused)
        assert "--damage" in refused.stderr


def test_a_users_file_is_used_and_listed(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('units = "m-N-s"\n' + OWN.replace("1.6e-9", "1600").replace("e3", "e9"))
    answer = new("--material", "mine", "--materials", file, "--units", "mm-N-s")
    (problem,) = load_deck(answer.stdout).problems
    assert problem.laminate.A[0, 0] == pytest.approx(0.5 * (140e3 + 9e3) / 2 / (1 - 0.09 * 9 / 140))
    listed = call("materials", file)
    assert "mine (m-N-s)" in listed.stdout
    assert "a test" in listed.stdout
    assert_unusable(new("--material", "mine"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (OWN + "XC=-900", "[mine] XC: -900 is not a positive number; compressive strengths are"),
        (OWN + "E3=9e3", "[mine] E3 is unknown; the keys are density, nu12, E1, "),
        (OWN + 'XT="2000"', "[mine] XT: '2000' is not a number"),
        (OWN + "XT=nan", "[mine] XT: nan is not a positive number"),
        (OWN + "E1=1\n", "Cannot overwrite a value (at line 8"),
        (OWN.replace('"a test"', "7"), "[mine] source: 7 is not a text in quotes"),
        (OWN.replace("E2=9e3\nG12=5e3\n", ""), "[mine] E2 and G12 missing"),
        ('units="psi"\n' + OWN, "[mine] units: 'psi' is not a system of units: name length, force"),
        ("E1=1\n" + OWN, 'E1 is outside the table of a ply; begin each ply with ["its name"]'),
        (OWN + "XT 2000", "(at line 8, column 4)"),
        ("", "no plies"),
        ("a=" + "[" * 9000, "nested too deeply"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_meant_is_refused_with_the_place(
    tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    for done in (call("materials", file), new("--material", "mine", "--materials", file)):
        assert_unusable(done)
        assert message in done.stderr
        assert str(file) in done.stderr


def test_the_plies_are_listed_for_programs_as_python_has_them(tmp_path: Path) -> None:
    lines = call("materials", "--units", "mm-ms-kg", "--format", "json").stdout.splitlines()
    by_name = {row["name"]: row for row in map(json.loads, lines)}
    assert by_name.keys() == fecm.materials().keys()
    # Camanho, Maimi and Davila 2007, in GPa and kN/mm.
    ply = by_name["IM7/8552"]
    assert (ply["units"], ply["E1"], ply["XC"], ply["GIIc"]) == (
        "mm-kN-ms",
        171.42,
        1.2001,
        7.879e-4,
    )
    assert ply["alpha1"] is None
    assert "Camanho" in ply["source"]
    file = tmp_path / "mine.toml"
    file.write_text(OWN)
    (own,) = call("materials", file, "--format", "json").stdout.splitlines()
    assert json.loads(own)["E1"] == fecm.materials(file)["mine"].values["E1"] == 140e3
    file.write_text(OWN + "E3 = 1")
    with pytest.raises(ValueError, match=r"mine\.toml: \[mine\] E3 is unknown") as caught:
        fecm.materials(file)
    assert isinstance(caught.value, fecm.FecmError)


def test_named_plies_and_laws_of_python_make_a_deck() -> None:
    law = fecm.contacts()["report-0.5"]
    assert "Table 3.1" in law.source
    deck = fecm.impact(
        fecm.Plate.rectangle((60, 40), (4, 4), support="simple"),
        fecm.Laminate("[0/90]s", fecm.materials()["IM7/8552"]),
        fecm.RigidMass(1e-4),
        law,
        velocity=1000.0,
        duration=1e-5,
    )
    # Table 3.1 of the report: 1.330e6 lbf/in^1.5.
    assert deck.require(Indentation).k == pytest.approx(1.330e6 * 4.4482216 / 25.4**1.5, rel=1e-5)


def test_the_nearest_names_are_shown_for_an_unknown_one() -> None:
    assert "did you mean IM7/8552" in new("--material", "IM7-8552").stderr


# Puck, Kopp and Knops, Compos. Sci. Technol. 62 (2002) 371-378.
@pytest.mark.parametrize(
    ("name", "slopes"),
    [
        ("IM7/8552", (0.35, 0.30)), ("T300/5208", (0.35, 0.30)),
        ("E-glass/LY556", (0.30, 0.25)), ("E-glass/MY750", (0.30, 0.25)),
        ("S2-glass/epoxy", (0.30, 0.25)), ("Scotchply-1002", (0.30, 0.25)),
    ],
)  # fmt: skip
@pytest.mark.few(1)  # of 6, 0.3 s each
def test_pucks_slopes_are_those_of_the_fibre(name: str, slopes: tuple[float, float]) -> None:
    for units in NAMES:
        card = deck_of("--material", name, "--damage", "--units", units).require(Allowables)
        assert (card.p_plus, card.p_minus) == slopes


def test_a_users_ply_has_its_own_slopes(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    strengths = "XT=2e3\nXC=1e3\nYT=50\nYC=200\nS12=80\n"
    file.write_text(f"{OWN}{strengths}p_plus=0.27\n")
    card = deck_of("--material", "mine", "--materials", file, "--damage").require(Allowables)
    assert (card.p_plus, card.p_minus) == (0.27, 0.30)
    file.write_text(f"{OWN}p_plus=1.0\n")
    assert "[mine] p_plus: 1 is not between 0 and 1" in call("materials", file).stderr


# Consistent units as LS-DYNA's and Radioss's manuals list them: mass, length, time, and the force.
@pytest.mark.parametrize(
    ("given", "system"),
    [
        ("kg-mm-ms", "mm-kN-ms"), ("g-mm-ms", "mm-N-ms"), ("t-mm-s", "mm-N-s"),
        ("kg-m-s", "m-N-s"), ("mm-ms-kg-kN", "mm-kN-ms"), ("s-lbf-in", "in-lbf-s"),
        ("g-mm-us", "mm-MN-us"),
    ],
)  # fmt: skip
def test_a_consistent_system_may_be_named_by_its_mass_or_its_force(given: str, system: str) -> None:
    assert system_named(given) == system


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("mm-ms-kg-N", "the force of kg, mm and ms is kN"),
        ("kg-in-s", "the force of kg, in and s is not one of N, kN"),
        ("mm-N", "not a whole system"), ("mm-m-s", "name length, force and time"), ("", "''"),
    ],
)  # fmt: skip
def test_a_system_that_is_not_consistent_is_refused_with_the_reason(given: str, words: str) -> None:
    with pytest.raises(UnitsError, match=words):
        system_named(given)
    assert words in new("--material", "IM7/8552", "--units", given).stderr.replace("\n", " ")


@pytest.mark.long
def test_an_impact_in_the_units_of_an_explicit_code_is_that_in_millimetres_and_newtons() -> None:
    by_name = {
        units: fecm.impact(
            fecm.Plate.rectangle((60, 40), (4, 4), support="simple"),
            fecm.Laminate("[0/90]s", "IM7/8552", 0.25),
            fecm.RigidMass(mass),
            "report-0.5",
            velocity="3m/s",
            duration="0.02ms",
            dt=dt,
            units=units,
        )
        for units, mass, dt in (("mm-N-s", 1e-4, 2e-7), ("kg-mm-ms", 0.1, 2e-4))
    }
    one, other = (fecm.run_one(deck) for deck in by_name.values())
    # Fields of cards have six digits.
    np.testing.assert_allclose(other.force * 1e3, one.force, rtol=2e-5)
    np.testing.assert_allclose(other.time / 1e3, one.time, rtol=1e-12)
    assert by_name["kg-mm-ms"].to_text().count("mm kN ms") == 1


@pytest.mark.parametrize(
    ("text", "form"),
    [
        ('<?xml version="1.0"?>\n<elamx/>\n', "XML"),
        ('{"AS4": {"E1": 140000}}\n', "JSON"),
        ('[{"name": "AS4", "E1": 140000}]\n', "JSON"),
        ("name,E1,E2\nAS4,140000,9000\n", "a table (CSV)"),
        ("name;E1;E2\nAS4;140000;9000\n", "a table (CSV)"),
    ],
)
def test_a_file_of_plies_in_another_form_is_named(tmp_path: Path, text: str, form: str) -> None:
    (tmp_path / "plies.txt").write_text(text)
    done = call("materials", "plies.txt", cwd=tmp_path)
    assert done.exit_code == 2
    assert f"this is {form}, not TOML" in done.stderr


def test_a_mistake_in_toml_is_told_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "plies.toml").write_text('["a"]\nE1 = 1,2\n')
    done = call("materials", "plies.toml", cwd=tmp_path)
    assert "line 2" in done.stderr
    assert "not TOML" not in done.stderr


def test_moduli_in_gpa_without_their_units_are_doubted(tmp_path: Path) -> None:
    path = tmp_path / "plies.toml"
    ply = "E1 = 140.0\nE2 = 9.0\nG12 = 5.0\nnu12 = 0.3\ndensity = 1.6e-9\n"
    path.write_text(f'["a"]\n{ply}')
    with pytest.warns(fecm.FecmWarning, match=r"\[a\] E1 140 is 0.14 GPa in mm-N-s, too soft"):
        fecm.materials(path)
    foam = ply.replace("140.0", "70.0").replace("1.6e-9", "6e-11")
    for text in (f'units = "mm-kN-ms"\n["a"]\n{ply.replace("e-9", "e-6")}', f'["a"]\n{foam}'):
        path.write_text(text)
        with warnings.catch_warnings(action="error", category=fecm.FecmWarning):
            fecm.materials(path)
