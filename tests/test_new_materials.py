"""Plates of several materials and laminates, by `fecm new` and by objects."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Ply
from fecm.deck.catalogue import MATERIALS
from fecm.deck.layup import parse_plies
from fecm.deck.model import (
    Allowables,
    Cure,
    Deck,
    Delamination,
    Expansion,
    Indentation,
    Material,
    Preload,
    Zones,
)
from fecm.deck.segment import Segment
from fecm.judge.criteria import is_isotropic
from fecm.mechanics.failure import CRITERIA
from fecm.problem.loading import load_deck
from fecm.problem.plate_mesh import plate_mesh
from fecm.results.exposures import largest_exposures
from tests.calls import Done, call

PLATE = ("--size", "40x30", "--mesh", "4x3", "--support", "simple", "--patch", "none")
STRIKE = (
    "--velocity", "2000", "--projectile", "mass:1e-3", "--duration", "2e-5",
)  # fmt: skip
LAW = ("--law", "5e4,0,0,1.5")
HYBRID = (
    "--layup", "[0C/90G]s", "--material", "C=IM7/8552", "--material", "G=E-glass/MY750",
    "--ply-thickness", "C=.125", "--ply-thickness", "G=.25",
)  # fmt: skip
SANDWICH = (
    "--layup", "[0/90/K/90/0]", "--material", "IM7/8552", "--ply-thickness", ".25",
    "--core", "Divinycell-H60:5", "--shear-factor", "equi",
)  # fmt: skip


def new(*options: str | Path) -> Done:
    return call("new", "-", *PLATE, *STRIKE, *options)


def deck_of(*options: str | Path) -> Deck:
    answer = new(*LAW, *options)
    assert answer.exit_code == 0, answer.stderr
    return fecm.read_one(answer.stdout)


def rows(deck: Deck, laminate: int = 1) -> list[tuple[float, float, int]]:
    return [(one.angle, one.thickness, one.material) for one in deck.layers[laminate]]


def laminates(deck: Deck) -> list[int]:
    """Laminate of every element."""
    numbers = np.ones(deck.control.numel, int)
    for zone in deck.require(Zones).records:
        numbers[np.array(zone.elements) - 1] = zone.laminate
    return numbers.tolist()


def test_letters_of_a_layup_name_materials() -> None:
    plies = parse_plies("[±45C/0_2/K]s")
    names = [(ply.angle, ply.name) for ply in plies[:5]]
    assert names == [(45, "C"), (-45, "C"), (0, ""), (0, ""), (0, "K")]
    assert plies[5:] == plies[4::-1]


def test_letters_bind_materials_and_their_thicknesses() -> None:
    deck = deck_of(*HYBRID)
    assert rows(deck) == [(0, 0.125, 1), (90, 0.25, 2), (90, 0.25, 2), (0, 0.125, 1)]
    for number, name in ((1, "IM7/8552"), (2, "E-glass/MY750")):
        assert deck.plies[number].e1 == MATERIALS[name].ply.e1
    assert deck.require(Material).integration.thickness == 0.75


def test_a_core_is_a_ply_of_its_own_thickness() -> None:
    deck = deck_of(*SANDWICH)
    assert rows(deck)[1:4] == [(90, 0.25, 1), (0, 5, 2), (90, 0.25, 1)]
    assert (deck.plies[2].e1, deck.plies[2].g13) == (75.0, 20.0)


def test_constants_of_one_material_have_a_name() -> None:
    constants = "6e-11,.4,75,75,20,20,20"
    options = ("--ply-of", f"foam={constants}", "--core", "foam:5", "--units", "mm-N-s")
    deck = deck_of(*SANDWICH[:6], *options)
    assert deck.plies == deck_of(*SANDWICH).plies
    letter = ("--layup", "[0/F/0]", *SANDWICH[2:6], "--ply-of", f"F={constants}", "--core", "F:5")
    assert rows(deck_of(*letter, "--units", "mm-N-s"))[1] == (0, 5, 2)
    refused = new(*LAW, *letter)
    assert refused.exit_code == 2
    assert "need their --units" in refused.stderr


def test_a_zone_has_the_elements_whose_centres_lie_in_it() -> None:
    deck = deck_of(*HYBRID, "--zone", "10,10,30,20:[0C/90G]2s")
    assert laminates(deck) == [1] * 5 + [2] * 2 + [1] * 5
    assert len(rows(deck, 2)) == 8
    assert len(deck.plies) == 2


def test_zones_go_over_each_other_in_their_order() -> None:
    zones = ("--zone", "0,0,20,30:[0C]", "--zone", "0,0,10,30:[0C/90G]s", "--zone", "0,0,4,9:[0C]")
    answer = new(*LAW, *HYBRID, *zones[:4])
    assert laminates(fecm.read_one(answer.stdout)) == [1, 2, 1, 1] * 3
    assert "cuts" not in answer.stderr
    empty = new(*LAW, *HYBRID, *zones[4:])
    assert empty.exit_code == 2
    assert "--zone 0,0,4,9 has no element whose centre lies in it" in empty.stderr


def test_a_zone_that_cuts_elements_is_told() -> None:
    answer = new(*LAW, *HYBRID, "--zone", "9,10,26,20:[0C/90G]2s")
    assert "cuts 2 elements" in answer.stderr
    assert "reaches over 10, 10, 30, 20" in answer.stderr
    assert laminates(fecm.read_one(answer.stdout)) == [1] * 5 + [2] * 2 + [1] * 5


def test_damage_has_strengths_of_every_material_and_the_least_toughness() -> None:
    deck = deck_of("--layup", "[0A/90B]s", "--material", "A=AS4/8552", "--material", "B=IM7/8552",
                   "--damage")  # fmt: skip
    strengths = deck.require(Allowables)
    by_name = {one.material: one.xt for one in (strengths, *strengths.others)}
    assert by_name == {1: 2207.0, 2: 2326.2}
    assert deck.require(Delamination).toughness == 0.7879


def test_materials_without_strengths_are_named() -> None:
    answer = new(*LAW, *SANDWICH[:6], "--core", "F:5", "--ply-of", "F=6e-11,.4,75,75,20,20,20",
               "--units", "mm-N-s", "--damage", "--layup", "[0/F/0]")  # fmt: skip
    assert answer.exit_code == 0
    assert "W498" in answer.stderr


def test_cure_has_the_expansions_of_every_material() -> None:
    deck = deck_of("--layup", "[0C/90G]s", "--material", "C=T300/914", "--material",
                   "G=E-glass/MY750", "--ply-thickness", ".125", "--cure", ":20")  # fmt: skip
    cure = deck.require(Cure)
    assert cure.delta_t == -100.0
    assert [(one.material, one.alpha1) for one in cure.expansions] == [(1, -1e-6), (2, 8.6e-6)]
    other = new(*LAW, "--layup", "[0C/90G]s", "--material", "C=AS4/3501-6", "--material",
                "G=E-glass/MY750", "--ply-thickness", ".125", "--cure", ":20")  # fmt: skip
    assert other.exit_code == 2
    assert "stress-free temperature of AS4/3501-6 and E-glass/MY750 is not the same" in other.stderr


def test_k_is_that_of_the_laminate_under_the_impact() -> None:
    zone = ("--zone", "0,0,40,30:[0G]8")
    sphere = ("--contact", "estimate:8")
    glass = new("--layup", "[0]8", "--material", "E-glass/MY750", "--ply-thickness", ".25", *sphere)
    both = new(*HYBRID, *zone, *sphere)
    k = [fecm.read_one(built.stdout).require(Indentation).k for built in (glass, both)]
    assert k[0] == k[1]


def test_k_of_a_sandwich_is_doubted() -> None:
    assert "k is estimated of a sandwich" in new(*SANDWICH, "--contact", "estimate:8").stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--layup", "[0X]", *HYBRID[2:]), "has the material 'X'; the given materials are C, G"),
        (("--layup", "[0]", *HYBRID[2:]), "a ply without a material"),
        ((*HYBRID, "--material", "C=T300/914"), "C is given twice"),
        ((*HYBRID, "--zone", "1,1,1,2:[0C]"), "--zone 1,1,1,2 is empty"),
        ((*HYBRID, "--zone", "pad:[0C]"), "nor a group of the mesh"),
        ((*HYBRID, "--zone", "[0C]"), "is not X0,Y0,X1,Y1:LAYUP"),
        ((*SANDWICH[:6], "--core", "balza:5"), "'balza' is not a named ply"),
    ],
)
def test_mistakes_are_told(options: tuple[str, ...], message: str) -> None:
    answer = new(*LAW, *options)
    assert answer.exit_code == 2
    assert message in " ".join(answer.stderr.split())
    assert "Traceback" not in answer.stderr


def objects(laminate: fecm.Laminate, **options: object) -> Deck:
    plate = fecm.Plate.rectangle((40, 30), (4, 3), support="simple")
    mass, law = fecm.RigidMass(1e-3), fecm.Contact(5e4, 0.0, 0.0, 1.5)
    return fecm.impact(
        plate,
        laminate,
        mass,
        law,
        velocity=2000.0,
        duration=2e-5,
        patch=None,
        **options,  # type: ignore[arg-type]
    )


def test_objects_make_the_same_deck() -> None:
    bound = {"C": "IM7/8552", "G": "E-glass/MY750"}
    wanted = deck_of(*HYBRID, "--zone", "10,10,30,20:[0C/90G]2s").to_text()
    text = fecm.Laminate("[0C/90G]s", bound, {"C": 0.125, "G": 0.25})
    c, g = (0, "C", 0.125), (90, "G", 0.25)
    tuples = fecm.Laminate([c, g, g, c], bound, {"C": 0.125, "G": 0.25})
    direct = fecm.Laminate([(0, "IM7/8552", 0.125), (90, "E-glass/MY750", 0.25)])
    for laminate in (text, tuples):
        assert laminate.thickness == 0.75
        built = objects(laminate, zones=[((10, 10, 30, 20), "[0C/90G]2s")])
        assert built.to_text() == wanted
    own = objects(text, zones=[((10, 10, 30, 20), direct)])
    assert rows(own, 2) == [(0, 0.125, 3), (90, 0.25, 4)]


def test_groups_of_surfaces_carry_laminates() -> None:
    points = [(x, y) for y in (0, 10, 20) for x in (0, 10, 20)]
    cells = [
        [0, 1, 4],
        [0, 4, 3],
        [
            1,
            2,
            5,
        ],
        [1, 5, 4],
        [3, 4, 7],
        [3, 7, 6],
        [4, 5, 8],
        [4, 8, 7],
    ]
    built = plate_mesh(points, cells, {}, surfaces={"pad": [2, 3]})
    centres = built.points[built.cells].mean(axis=1)
    inside = np.flatnonzero((centres[:, 0] > 10) & (centres[:, 1] < 10))
    assert built.surfaces["pad"].tolist() == inside.tolist()


def test_physical_surfaces_of_gmsh_carry_laminates(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    points = [(10.0 * x, 10.0 * y, 0.0) for y in range(3) for x in range(4)]
    cells = np.array([[n, n + 1, n + 5, n + 4] for n in (0, 1, 2, 4, 5, 6)])
    tags = np.array([1, 2, 1, 1, 2, 1])
    mesh = meshio.Mesh(
        points, [("quad", cells)],
        cell_data={"gmsh:physical": [tags], "gmsh:geometrical": [tags]},
        field_data={"plate": np.array([1, 2]), "pad": np.array([2, 2])},
    )  # fmt: skip
    file = tmp_path / "plate.msh"
    mesh.write(file, file_format="gmsh22")
    answer = call("new", "-", "--mesh", file, "--edge", "boundary=simple", *STRIKE, *LAW, *HYBRID,
                "--zone", "pad:[0C/90G]2s")  # fmt: skip
    assert answer.exit_code == 0, answer.stderr
    assert laminates(fecm.read_one(answer.stdout)) == [1, 2, 1, 1, 2, 1]


def test_a_sweep_over_materials_of_layers_is_that_of_single_runs() -> None:
    deck = objects(fecm.Laminate("[0C/90G]s", {"C": "IM7/8552", "G": "E-glass/MY750"}, 0.25))
    swept = fecm.sweep(deck, {"layer_materials": ["[1/2]s", "[2/1]s"], "dt": [1e-7]}, history=True)
    other = objects(fecm.Laminate("[0G/90C]s", {"C": "IM7/8552", "G": "E-glass/MY750"}, 0.25))
    assert swept.force is not None
    largest = float(swept.force.max())
    for force, one in zip(swept.force, (deck, other), strict=True):
        single = fecm.run_one(one.with_(dt=1e-7)).history.force
        steps = min(len(force), len(single))
        assert steps > 0.9 * len(force)
        assert force[:steps] == pytest.approx(single[:steps], abs=1e-9 * largest)
    assert abs(swept.force[0] - swept.force[1]).max() > 0.1 * largest


def test_a_layup_of_a_sweep_keeps_the_material_of_each_layer() -> None:
    deck = objects(fecm.Laminate("[0C/90G]s", {"C": "IM7/8552", "G": "E-glass/MY750"}, 0.25))
    turned = deck.with_(layup="[30/60]s")
    assert [(one.angle, one.material) for one in turned.layers[1]] == [
        (30, 1), (60, 2), (60, 2), (30, 1),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="several materials"):
        deck.with_(layup="[0]3")
    for numbers, why in (
        ("[1/3]s", "no material 3"),
        ("[1/2]", "2 materials for the deck's 4 layers"),
    ):
        with pytest.raises(ValueError, match=why):
            deck.with_(layer_materials=numbers)


def test_the_picture_of_failure_shows_plates_of_several_laminates(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    deck = deck_of(*SANDWICH, "--zone", "10,10,30,20:[0/90/0/K/0/90/0]", "--damage")
    result = fecm.run_one(deck)
    assert np.isnan(result["failure/max_stress/exposure"]).any()
    result.save(tmp_path / "r.h5")
    answer = call("plot", tmp_path / "r.h5", "--kind", "failure", "-o", tmp_path / "r.png")
    assert answer.exit_code == 0, answer.stderr
    assert (tmp_path / "r.png").stat().st_size > 10_000


def test_a_sweep_over_the_cure_of_several_materials_is_that_of_single_runs() -> None:
    deck = deck_of("--layup", "[0C/90G]s", "--material", "C=T300/914", "--material",
                   "G=E-glass/MY750", "--ply-thickness", ".25", "--cure", ":20", "--damage",
                   "--zone", "10,10,30,20:[0C/90G]2s")  # fmt: skip
    deck = deck.with_(mass=2e-7, duration=5e-5)
    changes = [-100.0, -50.0]
    swept = fecm.sweep(deck, {"cure_dT": changes}, measure="failure")
    for row, change in enumerate(changes):
        single = fecm.run_one(deck.with_(cure_dT=change))
        for one in largest_exposures(single):
            assert swept[f"exposure_{one.criterion}"][row] == pytest.approx(one.exposure, rel=1e-9)


def test_an_interface_of_a_core_has_the_mode_of_the_core() -> None:
    deck = deck_of(*SANDWICH, "--units", "mm-N-s", "--damage").with_(duration=5e-5)
    (largest,) = (e for e in largest_exposures(fecm.run_one(deck)) if e.criterion == "interlaminar")
    layers = deck.require(Material).layers
    core = next(n for n, layer in enumerate(layers, start=1) if layer.thickness > 1.0)
    beside_the_core = largest.ply in (core - 1, core)
    assert largest.mode == ("shear of the core" if beside_the_core else "interlaminar shear")
    assert beside_the_core


def test_a_sandwich_has_no_delamination_threshold() -> None:
    options = (*SANDWICH, "--units", "mm-N-s", "--damage")
    answer = new(*LAW, *options)
    assert "no delamination threshold (DELA): it holds for a solid laminate" in answer.stderr
    deck = deck_of(*options)
    assert deck.last(Delamination) is None
    with_threshold = replace(deck, segments=(Delamination(0.3), *deck.segments), text="")
    (problem,) = load_deck(with_threshold).problems
    assert problem.threshold is None
    with pytest.raises(fecm.FecmError, match="a plate without a core"):
        fecm.sweep(with_threshold, {"k": [5e4]}, until="threshold")


METAL = MATERIALS["2024-T3"].ply
GLARE = (
    "--layup", "[0M/0G/0M]", "--material", "M=2024-T3", "--material", "G=E-glass/MY750",
    "--ply-thickness", "M=.4", "--ply-thickness", "G=.25", "--units", "mm-N-s", "--damage",
)  # fmt: skip


def test_a_metal_yields_and_a_ply_is_named_with_its_material() -> None:
    result = fecm.run_one(deck_of(*GLARE))
    materials = {1: "2024-T3", 2: "E-glass/MY750", 3: "2024-T3"}
    plies = [one for one in largest_exposures(result) if one.criterion != "interlaminar"]
    assert len(plies) == len(CRITERIA)
    for one in plies:
        assert one.materials == (materials[one.ply],)
        assert (one.mode == "yield") == (one.ply != 2)
        assert one.where == f"ply {one.ply} ({materials[one.ply]})"
    (between,) = [one for one in largest_exposures(result) if one.criterion == "interlaminar"]
    assert between.mode == "interlaminar shear"
    assert between.materials == (materials[between.ply], materials[between.ply + 1])


def test_plies_of_glass_keep_the_modes_of_fibre_and_matrix() -> None:
    deck = deck_of(*GLARE)
    card = deck.require(Allowables)
    strong = replace(card, xt=1e6, xc=1e6, yt=1e6, yc=1e6, s12=1e6)
    segments = tuple(strong if one is card else one for one in deck.segments)
    result = fecm.run_one(replace(deck, segments=segments, text=""))
    (one,) = [one for one in largest_exposures(result) if one.criterion == "max_stress"]
    assert (one.ply, one.materials) == (2, ("E-glass/MY750",))
    assert one.mode in {"matrix tension", "matrix compression", "fibre tension", "shear"}


@pytest.mark.long
def test_summary_json_page_and_picture_name_the_metal_that_yields(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    soft = new(*LAW, *GLARE).stdout.replace("345.0", " 34.5").replace("199.0", " 19.9")
    (tmp_path / "g.inp").write_text(soft)
    done = call("run", "g.inp", cwd=tmp_path)
    first = fecm.load(tmp_path / "g.h5").first_failures[0]
    assert (first.mode, first.materials) == ("yield", ("2024-T3",))
    lines = [line.strip() for line in done.stdout.splitlines()]
    (line,) = (line for line in lines if line.startswith("first failure"))
    place = f"ply {first.ply} (2024-T3)"
    assert f"yield ({first.criterion.replace('_', ' ')}), {place} at " in line
    given = json.loads(call("info", "g.h5", "--format", "json", cwd=tmp_path).stdout)
    failure = given.get("run", given)["metrics"]["failure"]["first"][0]
    assert (failure["mode"], failure["materials"]) == ("yield", ["2024-T3"])
    call("report", "g.h5", "-o", "g.html", cwd=tmp_path)
    page = (tmp_path / "g.html").read_text()
    criterion = first.criterion.replace("_", " ")
    assert f'<th scope="row">{criterion}</th>\n<td>yield</td>\n<td>{place}</td>' in page
    assert "1: 2024-T3" in page
    call("plot", "g.h5", "--kind", "failure", "-o", "g.svg", cwd=tmp_path)
    picture = (tmp_path / "g.svg").read_text()
    assert ": yield (" in picture
    assert "(2024-T3)" in picture


def test_the_material_of_a_ply_is_that_of_the_laminate_where_it_is() -> None:
    deck = deck_of(*GLARE[:-1], "--layup", "[0G/0G/0G]", "--zone", "10,10,30,20:[0M/0G/0M]",
                   "--damage")  # fmt: skip
    by_name = {one.criterion: one for one in largest_exposures(fecm.run_one(deck))}
    one = by_name["max_stress"]
    is_inside = 10.0 < one.x < 30.0 and 10.0 < one.y < 20.0
    assert one.materials == (("2024-T3" if is_inside and one.ply != 2 else "E-glass/MY750"),)


def test_a_plate_of_one_metal_yields_and_needs_no_name() -> None:
    deck = deck_of("--layup", "[0]", "--material", "2024-T3", "--ply-thickness", "2",
                   "--units", "mm-N-s", "--damage")  # fmt: skip
    exposures = largest_exposures(fecm.run_one(deck))
    assert {(one.mode, one.where) for one in exposures} == {("yield", "ply 1")}


@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.few(3)  # of 19, 0.08 s each
def test_metals_and_foams_alone_are_isotropic(name: str) -> None:
    deck = deck_of("--layup", "[0]", "--material", name, "--ply-thickness", "2", "--units",
                   "mm-N-s")  # fmt: skip
    assert is_isotropic(deck, 1) == (name in {"2024-T3", "Divinycell-H60"})


@pytest.mark.parametrize(
    ("ply", "expected"),
    [
        (METAL, True),
        (replace(METAL, e2=75e3), False),
        (replace(METAL, g12=6.5e3), False),  # a fabric whose moduli along and across are the same
        (replace(METAL, g23=6.5e3), False),
    ],
)
def test_a_fabric_with_equal_moduli_is_not_isotropic(ply: Ply, expected: bool) -> None:
    deck = deck_of("--layup", "[0]", "--material", "2024-T3", "--ply-thickness", "2", "--units",
                   "mm-N-s")  # fmt: skip
    card = deck.require(Material)
    other = replace(card, ply=ply)
    segments = tuple(other if one is card else one for one in deck.segments)
    assert is_isotropic(replace(deck, segments=segments), 1) is expected


@pytest.mark.parametrize(
    ("segment", "code"),
    [(Preload(5000.0), "W489"), (Cure(-1500.0, expansions=(
        Expansion(1, 23.2e-6, 23.2e-6), Expansion(2, 8.6e-6, 26.4e-6),
    )), "W463")],
)  # fmt: skip
def test_findings_of_stresses_at_rest_name_the_metal_that_yields(
    segment: Segment, code: str
) -> None:
    deck = deck_of(*GLARE)
    weak = replace(deck.require(Allowables), xt=1.0, xc=1.0, yt=1.0, yc=1.0, s12=0.58)
    segments = [weak if isinstance(one, Allowables) else one for one in deck.segments]
    changed = replace(deck, segments=(*segments, segment), text="")
    (finding,) = [one for one in load_deck(changed).findings if one.code == code]
    assert "yield" in finding.message
    assert "(2024-T3)" in finding.message
