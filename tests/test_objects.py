"""Plates, laminates, projectiles and contacts as objects, and meshes of mesh generators.

The `.msh` files were written by Gmsh 4.15: circles of radius 50 with the group "rim", and a plate
of 60 x 40 with a hole of radius 8 at (42, 20) and the groups "clamped" (its edges) and "hole".
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.deck.format import format_deck
from fecm.deck.grid import SUPPORTS
from fecm.deck.model import Impact, Indentation, Material, Patch
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.solutions import static_stiffness
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from tests.builders import DATA, table
from tests.calls import assert_unusable, call
from tests.patches import STRAIN, residual, stretched

CIRCLE, TRIANGLES, HOLE = (
    DATA / f"{name}.msh" for name in ("circle-quad9", "circle-triangle6", "hole-quad8")
)
E, NU, H, R = 70e3, 0.3, 1.0, 50.0
G = E / 2.0 / (1.0 + NU)
METAL = fecm.Laminate([0.0], fecm.Ply(2.7e-9, NU, E, E, G, G, G), H)
QUICK: dict[str, Any] = {"velocity": 1000.0, "duration": 1e-5, "units": "mm-N-s"}
LAW = fecm.Contact(1e5, 0.0, 0.0, 1.5)
MASS = fecm.RigidMass(1e-3)
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def deck_on(plate: fecm.Plate, **options: Any) -> fecm.Deck:
    """A deck without a patch, unless asked for."""
    return fecm.impact(plate, METAL, MASS, LAW, **QUICK | {"patch": None} | options)


def mesh_of(plate: fecm.Plate) -> MeshArrays:
    return generate(deck_on(plate, at=plate.imported and plate.imported.points[0]))


def imported(path: Path, support: Any = None) -> fecm.Plate:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    return fecm.Plate.from_mesh(path, support)


# The same deck from the command line and from Python ----------------------------------------------

PLY = ["--layup", "[0/90]2s", "--ply-thickness", ".25", "--material", "T300/5208"]
PLIES = fecm.Laminate("[0/90]2s", "T300/5208", 0.25)
SIZE = ["--size", "100x80", "--mesh", "6x4"]
SI = ["--units", "mm-N-s"]
LAW_OPTION, MASS_OPTION = ["--law", "1e5,0,0,1.5"], ["--projectile", "mass:1e-3"]
GO = ["--velocity", "1000", "--duration", "1e-5"]
SIDES = (100.0, 80.0)


@pytest.mark.parametrize(
    ("options", "made"),
    [
        ([*SIZE, *PLY, *SI, *LAW_OPTION, *MASS_OPTION, *GO, "--support", "simple", "--edge",
          "top=free"],
         lambda: fecm.impact(
             fecm.Plate.rectangle(SIDES, (6, 4), support="simple", edges={"top": "free"}),
             PLIES, MASS, LAW, **QUICK)),
        ([*SIZE, "--grading", "2", *PLY, *SI, "--contact", "report-0.5", "--projectile",
          "rod:20,16,2e5,8e-9", *GO, "--at", "30,40", "--patch", "hertz:8", "--shear", "full",
          "--damage", "--title", "ROD"],
         lambda: fecm.impact(
             fecm.Plate.rectangle(SIDES, (6, 4), grading=2.0), PLIES,
             fecm.Rod.cylinder(20.0, 16.0, 2e5, 8e-9), "report-0.5", at=(30, 40),
             patch="hertz:8", shear="full", damage=True, title="ROD", **QUICK)),
        (["--columns", "3*20,2*10", "--rows", "4*20", *PLY, *LAW_OPTION, *MASS_OPTION,
          "--energy", "0.1", "--duration", "1e-5", "--patch", "none", "--every", "5"],
         lambda: fecm.impact(
             fecm.Plate.rectangle(columns="3*20,2*10", rows="4*20"), PLIES, MASS, LAW,
             energy=0.1, duration=1e-5, patch=None, every=5)),
        (["--fixture", "D7136", "--mesh", "8x6", "--layup", "[45/0/-45/90]3s", "--ply-thickness",
          ".184", "--material", "AS4/8552", "--energy", "1"],
         lambda: fecm.impact(
             fecm.Plate.on_fixture("D7136", (8, 6)),
             fecm.Laminate("[45/0/-45/90]3s", "AS4/8552", 0.184), energy=1.0)),
        ([*SIZE, *PLY, *SI, *LAW_OPTION, *MASS_OPTION, *GO, "--support", "clamped",
          "--in-plane", "normal", "--nonlinear", "--preload", "-20,0.01kN/mm,3"],
         lambda: fecm.impact(
             fecm.Plate.rectangle(SIDES, (6, 4), support="clamped"), PLIES, MASS, LAW,
             in_plane="normal", nonlinear=True, preload=(-20, "10N/mm", 3.0), **QUICK)),
        (["--mesh", str(CIRCLE), "--edge", "rim=clamped", *PLY, *SI, "--contact", "estimate:8",
          *MASS_OPTION, *GO, "--at", "3,4"],
         lambda: fecm.impact(
             imported(CIRCLE, {"rim": "clamped"}), PLIES, MASS, fecm.Contact.estimate(8.0),
             at=(3, 4), **QUICK)),
        ([*SIZE, *PLY, *SI, *LAW_OPTION, *MASS_OPTION, *GO, "--plies", "4,2", "--failure", "3"],
         lambda: fecm.impact(
             fecm.Plate.rectangle(SIDES, (6, 4)), PLIES, MASS, LAW, plies=(4, 2), failure=3,
             **QUICK)),
    ],
    ids=["rectangle", "graded", "columns", "fixture", "nonlinear", "imported", "stored"],
)  # fmt: skip
def test_the_command_line_and_python_make_the_same_deck(options: list[str], made: Any) -> None:
    deck = made()
    printed = call("new", "-", *options)
    assert printed.exit_code == 0, printed.stderr
    text = "".join(line for line in printed.stdout.splitlines(True) if not line.startswith("! "))
    assert text == format_deck(deck.to_text())
    assert fecm.read_one(deck.to_text()) == deck


# Meshes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("support", "limit"), [("clamped", 0.005), ("simple", 0.005)])
@pytest.mark.few(1)  # of 2, 0.4 s each
def test_a_gmsh_circle_has_the_centre_stiffness_of_the_closed_form(
    support: str, limit: float
) -> None:
    deck = deck_on(imported(CIRCLE, {"rim": support}))
    (problem,) = load_deck(deck).problems
    assert problem.contact is not None
    assert load_deck(deck).findings == []
    rigidity = E * H**3 / 12.0 / (1.0 - NU**2)
    stiffness = static_stiffness(problem.moving_plate, problem.contact) * R**2 / rigidity
    name = "circular clamped" if support == "clamped" else "circular simply supported"
    (row,) = (row for row in table("plate_stiffness.csv") if row["plate"].startswith(name))
    assert stiffness == pytest.approx(float(row["value"]), rel=limit)


def test_a_circle_of_straight_triangles_on_simple_supports_is_no_stiffer_than_a_circle() -> None:
    meshio = pytest.importorskip("meshio", reason="meshes are read by meshio")
    read = meshio.read(TRIANGLES)
    six = np.concatenate([block.data for block in read.cells if block.type == "triangle6"])
    parts = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
    plate = fecm.Plate.from_mesh(
        (read.points, np.concatenate([six[:, p] for p in parts])), "simple"
    )
    (problem,) = load_deck(deck_on(plate)).problems
    assert problem.contact is not None
    rigidity = E * H**3 / 12.0 / (1.0 - NU**2)
    stiffness = static_stiffness(problem.moving_plate, problem.contact) * R**2 / rigidity
    assert stiffness == pytest.approx(19.8015537, rel=0.02)


def test_the_centre_of_a_curved_triangle_is_that_of_its_shape_functions() -> None:
    points = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, -0.3), (0.5, 0.5), (0.0, 0.5)]
    built = fecm.Plate.from_mesh((points, [[0, 1, 2, 3, 4, 5]])).imported
    assert built is not None
    np.testing.assert_allclose(built.points[6], [1.0 / 3.0, 0.2], rtol=1e-5)


def test_a_group_of_the_boundary_does_not_hold_a_side_inside() -> None:
    cells = [[0, 1, 2], [0, 2, 3]]
    built = fecm.Plate.from_mesh((SQUARE, cells), groups={"edge": [0, 1, 2, 3]}).imported
    assert built is not None
    on = built.points[built.groups["edge"]]
    assert len(on) == 8
    assert ((on == 0.0) | (on == 1.0)).any(axis=1).all()


@pytest.mark.parametrize("path", [CIRCLE, TRIANGLES, HOLE], ids=lambda path: path.stem)
@pytest.mark.parametrize("mirrored", [False, True])
def test_an_imported_mesh_passes_the_patch_test(path: Path, mirrored: bool) -> None:
    meshio = pytest.importorskip("meshio", reason="meshes are read by meshio")
    read = meshio.read(path)
    if mirrored:  # every element runs clockwise
        read.points[:, 0] *= -1.0
    built = fecm.Plate.from_mesh(read).imported
    assert built is not None
    mesh = built.points, (built.cells + 1).astype(np.int32)
    assert residual(mesh, stretched(built.points, STRAIN)) < 1e-12


TWO = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]
QUADS, ENDS = [[0, 1, 4, 3], [1, 2, 5, 4]], [[0, 3], [2, 5]]  # two squares, and their outer sides


def test_a_med_file_that_was_converted_from_gmsh_has_the_groups_numbers(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio", reason="meshes are read by meshio")
    cells = [("quad", QUADS), ("line", ENDS)]
    tags = [np.array([7, 7]), np.array([1, 2])]
    names = {"left": np.array([1, 1]), "right": np.array([2, 1]), "sheet": np.array([7, 2])}
    points = np.column_stack([TWO, np.zeros(6)])
    mesh = meshio.Mesh(points, cells, cell_data={"gmsh:physical": tags}, field_data=names)
    mesh.write(tmp_path / "two.med")
    assert meshio.read(tmp_path / "two.med").field_data  # which names no groups in such a file
    built = imported(tmp_path / "two.med", {"1": "clamped", "2": "free"}).imported
    assert built is not None
    assert {name: group.tolist() for name, group in built.groups.items()} == {
        "1": [0, 3], "2": [2, 5]
    }  # fmt: skip


def test_the_families_of_a_med_file_are_its_groups_of_lines_nodes_and_elements(
    tmp_path: Path,
) -> None:
    meshio = pytest.importorskip("meshio", reason="meshes are read by meshio")
    mesh = meshio.Mesh(
        np.column_stack([TWO, np.zeros(6)]),
        [("quad", QUADS), ("line", ENDS)],
        point_data={"point_tags": np.array([0, 3, 0, 0, 3, 0])},
        cell_data={"cell_tags": [np.array([0, -3]), np.array([-1, -2])]},
    )
    mesh.cell_tags = {-1: ["left", "ends"], -2: ["ends"], -3: ["thick"]}
    mesh.point_tags = {3: ["seam"]}
    mesh.write(tmp_path / "two.med")
    built = imported(tmp_path / "two.med").imported
    assert built is not None
    assert {name: group.tolist() for name, group in built.groups.items()} == {
        "left": [0, 3], "ends": [0, 2, 3, 5], "seam": [1, 4]
    }  # fmt: skip
    assert {name: zone.tolist() for name, zone in built.surfaces.items()} == {"thick": [1]}


def test_a_grid_of_pyvista_is_the_plate_that_meshio_reads_from_the_same_file() -> None:
    pyvista = pytest.importorskip("pyvista")
    plate = imported(HOLE, {"clamped": "clamped"}).imported
    built = fecm.Plate.from_mesh(pyvista.read_meshio(HOLE)).imported
    assert plate is not None
    assert built is not None
    np.testing.assert_array_equal(built.points, plate.points)
    np.testing.assert_array_equal(built.cells, plate.cells)
    groups = [{tuple(group) for group in one.groups.values()} for one in (built, plate)]
    assert groups[0] == groups[1]
    flat = fecm.Plate.from_mesh(pyvista.Plane(i_size=3, j_size=2, i_resolution=3, j_resolution=2))
    assert flat.imported is not None
    assert (flat.imported.elements, flat.imported.extent) == (6, ([-1.5, -1.0], [1.5, 1.0]))
    with pytest.raises(fecm.MeshError, match="the mesh has VTK's type 11 elements"):
        fecm.Plate.from_mesh(pyvista.ImageData(dimensions=(3, 3, 3)))


def test_equal_plates_and_laminates_are_one_key() -> None:
    def plates() -> list[fecm.Plate]:
        corners = fecm.Plate.from_mesh((SQUARE, [[0, 1, 2, 3]]), "clamped")
        return [fecm.Plate.rectangle(SIDES, (6, 4)), fecm.Plate.on_fixture("D7136"), corners]

    def laminates() -> list[fecm.Laminate]:
        hybrid = {"C": "IM7/8552", "G": "E-glass/MY750"}
        return [fecm.Laminate([0, 90], "AS4/8552"), fecm.Laminate("[0C/90G]s", hybrid, 0.2)]

    assert len({*plates()[:2], *plates()[:2]}) == 2
    assert len({*plates(), *plates()}) == 4  # an imported mesh equals itself alone
    assert len({*laminates(), *laminates()}) == 2


def turned(cells: Any) -> np.ndarray:
    """Cells of 3, 4, 6, 8 or 9 nodes clockwise, from their second corner."""
    order = {
        3: [1, 0, 2], 4: [1, 0, 3, 2], 6: [1, 0, 2, 3, 5, 4], 8: [1, 0, 3, 2, 4, 7, 6, 5],
        9: [1, 0, 3, 2, 4, 7, 6, 5, 8],
    }  # fmt: skip
    return np.asarray(cells)[:, order[np.shape(cells)[1]]]


NINE = [*SQUARE, (0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5), (0.5, 0.5)]


@pytest.mark.parametrize(
    ("points", "cells", "elements"),
    [
        (SQUARE, [[0, 1, 2], [0, 2, 3]], 6),
        (SQUARE, [[0, 1, 2, 3]], 1),
        (NINE, [[0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7]], 6),
        (NINE[:8], [[0, 1, 2, 3, 4, 5, 6, 7]], 1),
        (NINE, [[0, 1, 2, 3, 4, 5, 6, 7, 8]], 1),
    ],
    ids=["triangle", "quad", "triangle6", "quad8", "quad9"],
)
@pytest.mark.parametrize("clockwise", [False, True])
def test_every_family_fills_its_area_counter_clockwise(
    points: list[tuple[float, float]], cells: list[list[int]], elements: int, clockwise: bool
) -> None:
    plate = fecm.Plate.from_mesh((points, turned(cells) if clockwise else cells), "clamped")
    built = plate.imported
    assert built is not None
    assert built.elements == elements
    x, y = np.moveaxis(built.points[built.cells[:, :4]], 2, 0)
    areas = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2.0
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(1.0)
    if built.most_nodes == 9:
        ends = (
            built.points[built.cells[0, [0, 1, 2, 3]]],
            built.points[built.cells[0, [1, 2, 3, 0]]],
        )
        np.testing.assert_allclose(built.points[built.cells[0, 4:8]], sum(ends) / 2.0)
        np.testing.assert_allclose(built.points[built.cells[0, 8]], 0.5)


def grid_arrays(*names: str) -> tuple[Any, Any, MeshArrays]:
    """Points, cells and mesh of a rectangle with simple supports at some edges."""
    edges: Any = dict.fromkeys(names, "simple")
    mesh = mesh_of(fecm.Plate.rectangle((60, 40), (4, 3), edges=edges))
    return mesh.coordinates, mesh.elements - 1, mesh


def test_supports_of_groups_are_those_of_the_same_edges_of_a_rectangle() -> None:
    points, cells, mesh = grid_arrays("left", "top")
    groups = {
        "a": np.flatnonzero(points[:, 0] == 0.0), "b": np.flatnonzero(points[:, 1] == 40.0)
    }  # fmt: skip
    plate = fecm.Plate.from_mesh((points, cells), {"a": "simple", "b": "simple"}, groups=groups)
    deck = deck_on(plate, at=(30.0, 20.0))
    np.testing.assert_array_equal(generate(deck).codes != 0, mesh.codes != 0)
    np.testing.assert_array_equal(generate(deck).elements, mesh.elements)
    whole = deck_on(fecm.Plate.from_mesh((points, cells), "simple"), at=(30.0, 20.0))
    all_edges = grid_arrays("left", "right", "bottom", "top")[2]
    np.testing.assert_array_equal(generate(whole).codes != 0, all_edges.codes != 0)


def test_a_curved_edge_on_simple_supports_is_free_to_rotate() -> None:
    mesh = generate(deck_on(imported(CIRCLE, {"rim": "simple"})))
    rim = np.isclose(np.hypot(*mesh.coordinates.T), R, rtol=1e-4)
    assert rim.sum() == 2 * 4 * round(rim.sum() / 8)
    held = mesh.codes != 0
    assert (held[:, 2] == rim).all()
    assert not held[:, 3:].any()


def test_a_group_named_after_a_support_has_it_and_the_others_are_free() -> None:
    plate = imported(HOLE)
    assert plate.supports == {"clamped": "clamped"}
    mesh = generate(deck_on(plate, at=(15.0, 20.0)))
    x, y = mesh.coordinates.T
    edge = (x == 0.0) | (x == 60.0) | (y == 0.0) | (y == 40.0)
    assert ((mesh.codes[:, 2:] != 0).all(axis=1) == edge).all()
    both = imported(HOLE, {"boundary": "clamped", "hole": "free", "clamped": "simple"})
    codes = generate(deck_on(both, at=(15.0, 20.0))).codes
    assert not codes[np.isclose(np.hypot(x - 42.0, y - 20.0), 8.0, rtol=1e-3), 2].any()


def test_the_formats_of_gmsh_give_the_same_plate(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio", reason="meshes are read by meshio")
    other = tmp_path / "hole.vtu"
    meshio.write(other, meshio.read(HOLE))
    one, two = imported(HOLE).imported, imported(other).imported
    assert one is not None
    assert two is not None
    np.testing.assert_allclose(one.points, two.points)
    np.testing.assert_array_equal(one.cells, two.cells)


def test_points_without_an_element_are_dropped() -> None:
    points = [(9.0, 9.0), *SQUARE, (0.5, 0.5)]
    built = fecm.Plate.from_mesh((points, [[1, 2, 3, 4]]), groups={"edge": [0, 1, 2]}).imported
    assert built is not None
    np.testing.assert_array_equal(built.points, SQUARE)
    np.testing.assert_array_equal(built.groups["edge"], [0, 1])


@pytest.mark.parametrize(
    ("points", "cells", "groups", "message"),
    [
        (SQUARE, [[0, 1, 2, 2]], {}, "1 elements without an area: number 1"),
        ([(0, 0), (1, 0), (2, 0), (3, 0)], [[0, 1, 2, 3]], {}, "without an area"),
        (SQUARE, [[0, 1, 2, 3], [2, 3, 0, 1]], {}, "1 elements given twice: number 2"),
        ([(*p, z) for z, p in enumerate(SQUARE)], [[0, 1, 2, 3]], {}, "z is 0 to 3"),
        (SQUARE, [[0, 1, 2, 7]], {}, "cells must name points 0 to 3"),
        (SQUARE, [[0.0, 1.0, 2.0, 3.0]], {}, "cells must be integers"),
        (SQUARE, [[0, 1, 2, 3, 0]], {}, "with k one of 3, 4, 6, 8 and 9"),
        ([(0, np.nan), *SQUARE], [[1, 2, 3, 4]], {}, "points must be finite"),
        ([*SQUARE, (9, 9)], [[0, 1, 2, 3]], {"edge": [4]}, "no node of the group 'edge'"),
        (SQUARE, [[0, 1, 2], [1, 3, 2], [0, 1, 3], [0, 3, 1]], {}, "given twice"),
        ([*SQUARE, (0.5, 2)], [[0, 1, 2], [0, 1, 3], [0, 1, 4]], {}, "elements overlap"),
        (SQUARE, "cells", {}, "cells must be integers"),
    ],
)  # fmt: skip
def test_arrays_that_are_no_plate_are_refused(
    points: Any, cells: Any, groups: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        fecm.Plate.from_mesh((points, cells), groups=groups)


def test_a_wrong_group_is_answered_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="no group 'rm'; its groups are boundary, rim"):
        imported(CIRCLE, {"rm": "clamped"})
    with pytest.raises(ValueError, match=f"rim=glued: the supports are {', '.join(SUPPORTS)}"):
        imported(CIRCLE, {"rim": "glued"})


def test_a_plate_whose_groups_hold_nothing_is_warned_of() -> None:
    with pytest.warns(fecm.FecmWarning, match="the plate is free: no group of the mesh"):
        deck_on(imported(CIRCLE))


def test_the_patch_of_an_imported_mesh_lies_at_the_impact_point() -> None:
    plate = imported(CIRCLE, {"rim": "clamped"})
    deck = deck_on(plate, at=(3.0, 4.0), patch="auto")
    patch = deck.require(Patch)
    assert (patch.x, patch.y) == (3.0, 4.0)
    assert plate.imported is not None
    distances = np.hypot(*(plate.imported.points - (3.0, 4.0)).T)
    assert deck.require(Impact).node == distances.argmin() + 1
    with pytest.warns(fecm.FecmWarning, match="the impact point is moved by"):
        deck_on(plate, at=(3.0, 4.0))


ABAQUS = """\
** made by hand
*HEADING
*NODE
1, 0., 0.
2, 100., 0.
3, 100., 80.
4, 0., 80.
9, 5., 5.
*ELEMENT, TYPE=S4R, ELSET=P
1, 1, 4, 3, 2
*NSET, NSET=rim
1, 4
"""


def test_an_input_file_of_another_program_is_named_as_such(tmp_path: Path) -> None:
    path = tmp_path / "plate.inp"
    for text in (ABAQUS, ABAQUS.partition("\n")[2], "\n\n" + ABAQUS.lower()):
        path.write_text(text)
        for command in ("run", "check"):
            done = call(command, path)
            assert done.exit_code == (2 if command == "run" else 1)
            assert "E013" in done.stdout + done.stderr
            assert "input file of Abaqus or CalculiX" in done.stdout + done.stderr
            assert "fecm new DECK --mesh FILE" in done.stdout + done.stderr
    assert "a mesh of Gmsh" in call("run", CIRCLE).stderr


def test_the_mesh_of_another_programs_input_file_can_be_taken(tmp_path: Path) -> None:
    path = tmp_path / "plate.inp"
    path.write_text(ABAQUS)
    built = imported(path, {"rim": "clamped"}).imported
    assert built is not None
    assert (built.nodes, built.elements, built.groups["rim"].tolist()) == (4, 1, [0, 3])
    path.write_text(ABAQUS + "*INCLUDE, INPUT=/etc/passwd\n")
    with pytest.raises(ValueError, match="refers to other files, which are not read"):
        imported(path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--mesh", "nothing.msh"], "nothing.msh: No such file or directory"),
        (["--mesh", "nothing"], "'nothing' is not NXxNY, as in 14x10, or the file of a mesh"),
        (["--mesh", str(CIRCLE), "--edge", "rm=clamped"], "its groups are boundary, rim"),
        (["--mesh", str(CIRCLE), "--size", "9x9"], "--mesh is a file; leave out --size"),
        (["--mesh", str(CIRCLE), "--fixture", "D7136"], "--mesh is NXxNY"),
        (["--mesh", str(CIRCLE), "--at", "300,0"], "--at is outside the plate"),
        (["--mesh", str(Path(__file__))], "can't be read as a mesh by meshio"),
    ],
)
def test_meshes_that_cannot_be_meant_exit_2(options: list[str], message: str) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    answer = call("new", "-", *options, *PLY, *SI, *LAW_OPTION, *MASS_OPTION, *GO)
    assert_unusable(answer)
    assert message in answer.stderr


def test_without_meshio_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(ImportError, match=r"pip install 'fecm\[mesh\]'"):
        fecm.Plate.from_mesh(CIRCLE)
    answer = call("new", "-", "--mesh", CIRCLE, *PLY, *SI, *LAW_OPTION, *MASS_OPTION, *GO)
    assert_unusable(answer)
    assert "pip install 'fecm[mesh]'" in answer.stderr


@pytest.mark.parametrize("kinds", [["triangle", "quad"], ["tetra"], ["line"]])
def test_other_elements_are_refused_by_name(kinds: list[str], tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio", reason="meshes are read by meshio")
    sizes = {"triangle": 3, "quad": 4, "tetra": 4, "line": 2}
    blocks = [(kind, [list(range(sizes[kind]))]) for kind in kinds]
    with pytest.raises(ValueError, match="all must be triangles of 3 or 6 nodes") as refused:
        fecm.Plate.from_mesh(meshio.Mesh([(*p, 0.0) for p in SQUARE], blocks))
    assert kinds == ["line"] or " and ".join(sorted(kinds)) in str(refused.value)


# Calls -------------------------------------------------------------------------------------------

PLATE = fecm.Plate.rectangle(SIDES, (4, 4))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"energy": 1.0}, "give either `velocity` or `energy`"),
        ({"velocity": None}, "give either `velocity` or `energy`"),
        ({"duration": -1.0}, "`duration` is -1.0; it must be a positive number"),
        ({"units": "cubits"}, "`units`: 'cubits' is not a system of units"),
        ({"units": ["mm", "N", "s"]}, "`units` is .*, not a text such as 'mm-N-s'"),
        ({"patch": "square"}, "`patch` is 'square', not none, disc, hertz"),
        ({"shear": "reduced"}, "`shear` is 'reduced'"),
        ({"at": (500.0, 0.0)}, "`at` is outside the plate: 500, 0, where it has x 0 to 100 and"),
        ({"damage": True}, "`damage` needs a named ply"),
        ({"velocity": float("nan")}, "nan can't be written"),
    ],
)
def test_what_makes_no_deck_is_refused_in_the_words_of_the_call(
    options: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        deck_on(PLATE, **options)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fecm.Plate.rectangle((1, 0), (2, 2)), "`size` is 0.0"),
        (lambda: fecm.Plate.rectangle((1, 1), (2, 0)), "not two numbers of elements"),
        (lambda: fecm.Plate.rectangle((1, 1)), "give `size` and `mesh`"),
        (lambda: fecm.Plate.rectangle(columns="3*x", rows="2*1"), "is not COUNT"),
        (lambda: fecm.Plate.rectangle((1, 1), (2, 2), grading=0.5), "`grading` is 0.5"),
        (lambda: fecm.Plate.rectangle((1, 1), (2, 2), edges={"up": "free"}), "up=free"),
        (lambda: fecm.Plate.on_fixture("D1"), "'D1' is not a fixture"),
        (lambda: fecm.Contact.named("cheese"), "'cheese' is not a named contact"),
        (lambda: fecm.Contact.estimate(-1.0), "`radius` is -1.0"),
        (lambda: fecm.Laminate("[0]", "cheese", 1.0), "'cheese' is not a named ply: report"),
        (lambda: fecm.Laminate("[0]", "AS4/8525"), "named ply; did you mean AS4/8552"),
        (lambda: fecm.Laminate("[0C]", {"C": "AS4/8525"}), "did you mean AS4/8552"),
        (lambda: fecm.Laminate([(0, "foam")], {"C": "AS4/8552"}), "the material 'foam'"),
        (lambda: fecm.Laminate([], METAL.ply, 1.0), r"\[\] is not a list of angles"),
        (lambda: fecm.Laminate(["x"], METAL.ply, 1.0), "not a list of angles"),
        (lambda: fecm.Laminate("[0", METAL.ply, 1.0), "can't be read at its end"),
        (lambda: fecm.Laminate("[0]", (1, 2), 1.0), "not a name or a Ply"),  # type: ignore[arg-type]
        (lambda: fecm.Laminate("[0]", METAL.ply, -1.0), "`ply_thickness` is -1.0"),
        (lambda: fecm.Laminate("[0]", METAL.ply).thickness, "`ply_thickness` is missing"),
        (lambda: fecm.impact(PLATE, PLIES, None, LAW, **QUICK), "give `projectile`"),
        (lambda: fecm.impact(PLATE, PLIES, MASS, **QUICK), "give `contact`"),
    ],
)
def test_objects_that_make_no_sense_are_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "options",
    [
        {"projectile": 5.0}, {"contact": 5.0}, {"patch": 0.04}, {"plate": "x"}, {"laminate": "[0]"},
        {"at": 5}, {"at": (1, 2, 3)}, {"gages": [(1, 2)]}, {"title": "a\nb"}, {"every": 2.5},
        {"every": "x"}, {"plies": "x"}, {"plies": (1, 2, 3)}, {"failure": 0},
    ],
)  # fmt: skip
def test_what_is_of_another_type_is_refused(options: dict[str, Any]) -> None:
    given: dict[str, Any] = {"plate": PLATE, "laminate": METAL, "projectile": MASS, "contact": LAW}
    with pytest.raises(fecm.FecmError):
        fecm.impact(**(given | QUICK | options))


@pytest.mark.parametrize(
    "make",
    [
        lambda: fecm.Plate.from_mesh(5),  # type: ignore[arg-type]
        lambda: fecm.Plate.from_mesh(CIRCLE, groups={"a": [1]}),
        lambda: fecm.Plate.from_mesh((SQUARE, [[0, 1, 2, 3]]), ["boundary"]),  # type: ignore[arg-type]
        lambda: fecm.Plate.rectangle(5, (1, 2)),  # type: ignore[arg-type]
        lambda: fecm.Plate.rectangle((1, 2), ("a", 2)),  # type: ignore[arg-type]
    ],
)
def test_plates_of_other_types_are_refused(make: Any) -> None:
    with pytest.raises(fecm.FecmError):
        make()


def test_whole_numbers_make_the_same_deck_as_others() -> None:
    four: Any = np.int64(4)
    one: Any = np.float32(1.0)
    whole = fecm.impact(
        fecm.Plate.rectangle((100, 80), (four, 4)),
        fecm.Laminate([0], fecm.Ply(1, 0, 2, 2, 1, 1, 1), one),
        fecm.RigidMass(1),
        fecm.Contact(1, 0, 0, 2),
        velocity=1,
        duration=1,
    )
    floats = fecm.impact(
        PLATE,
        fecm.Laminate([0.0], fecm.Ply(1.0, 0.0, 2.0, 2.0, 1.0, 1.0, 1.0), 1.0),
        fecm.RigidMass(1.0),
        fecm.Contact(1.0, 0.0, 0.0, 2.0),
        velocity=1.0,
        duration=1.0,
    )
    assert whole.to_text() == floats.to_text()


def test_a_velocity_of_zero_stays_zero() -> None:
    assert deck_on(PLATE, velocity=0.0).require(Impact).velocity == 0.0


def test_a_deck_with_errors_is_not_returned() -> None:
    with pytest.raises(fecm.DeckError, match="E4"):
        fecm.impact(PLATE, METAL, fecm.RigidMass(-1.0), LAW, **QUICK)


def test_gages_of_an_impact_are_read_at_every_step() -> None:
    result = fecm.run_one(deck_on(PLATE, gages=[(30.0, 40.0, 0.5, 0.0), (50.0, 40.0, 0.5, 90.0)]))
    assert result["gages/strain"].shape == (len(result.time), 2)


def test_with_returns_a_deck_with_other_values_under_the_names_of_sweeps() -> None:
    deck = fecm.impact(PLATE, PLIES, MASS, LAW, **QUICK)
    other = deck.with_(velocity=500, layup=[0, 45.0, 90], k=np.float64(2e5))
    assert other.require(Impact).velocity == 500.0
    assert other.require(Indentation).k == 2e5
    assert [layer.angle for layer in other.require(Material).layers] == [0.0, 45.0, 90.0]
    assert deck.require(Impact).velocity == 1000.0
    with pytest.raises(ValueError, match="`velocty` cannot be varied"):
        deck.with_(velocty=1.0)  # type: ignore[call-arg]


def test_an_imported_plate_has_a_short_repr() -> None:
    assert len(repr(fecm.Plate.from_mesh((SQUARE, [[0, 1, 2, 3]])))) < 500
