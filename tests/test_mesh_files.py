"""Files of meshes, as the tools of each format write them.

`data/meshes` has a plate of 40 x 30 in 4 x 3 elements, with the groups `left`, `right` and `sheet`,
written by Gmsh 4.15.2 in each format, and an XDMF file of two elements.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.problem.plate_mesh import PlateMesh, read_mesh

MESHES = Path(__file__).parent / "data" / "meshes"
NUMBERED = {"left": "4", "right": "2"}  # groups of Nastran are the numbers of properties
# A plate as Abaqus/CAE writes it, which has an assembly.
CAE = """\
*Heading
** Job name: Plate Model name: Model-1
*Preprint, echo=NO, model=NO, history=NO, contact=NO
*Part, name=Plate
*Node
      1,           0.,           0.,           0.
      2,          10.,           0.,           0.
      3,          20.,           0.,           0.
      4,           0.,          10.,           0.
      5,          10.,          10.,           0.
      6,          20.,          10.,           0.
*Element, type=S4R
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*Nset, nset=edge, generate
 1,  4,  3
*Elset, elset=all, generate
 1,  2,  1
*Shell Section, elset=all, composite
0.125, 3, CFRP, 0., Ply-1
*End Part
*Assembly, name=Assembly
*Instance, name=Plate-1, part=Plate
*End Instance
*End Assembly
"""
MSH = """\
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
2 1 "plate"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 100 0 0 0 0
1 0 0 0 100 80 0 1 1 0
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
100 0 0
100 80 0
0 80 0
$EndNodes
$Elements
2 2 1 2
1 1 1 1
1 1 2
2 1 3 1
2 1 2 3 4
$EndElements
"""


def bulk(*cards: str) -> str:
    return "\n".join(["SOL 101", "CEND", "BEGIN BULK", *cards, "ENDDATA", ""])


def corners(x: float = 2.0, y: float = 1.0) -> list[str]:
    places = [(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)]
    return [f"GRID,{n},,{a},{b},0." for n, (a, b) in enumerate(places, start=1)]


def read(tmp_path: Path, text: str, name: str = "plate.bdf") -> PlateMesh:
    file = tmp_path / name
    file.write_text(text)
    return read_mesh(file)


def area(mesh: PlateMesh) -> float:
    x, y = np.moveaxis(mesh.points[mesh.cells[:, :4]], 2, 0)
    return float((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum() / 2.0)


@pytest.mark.parametrize(
    ("name", "groups", "surfaces"),
    [
        ("plate-2.2.msh", True, True),
        ("plate-4.1.msh", True, True),
        ("plate.inp", True, True),
        ("plate.med", True, True),
        ("plate.bdf", True, False),
        ("plate-nine.bdf", True, False),
        ("plate.vtk", False, False),
        ("plate.mesh", False, False),
    ],
)
def test_every_format_of_the_manual_is_read_as_its_tools_write_it(
    name: str, groups: bool, surfaces: bool
) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    mesh = read_mesh(MESHES / name)
    assert (mesh.elements, mesh.extent) == (12, ([0.0, 0.0], [40.0, 30.0]))
    assert mesh.nodes == (7 * 9 if "nine" in name else 4 * 5)
    assert area(mesh) == pytest.approx(1200.0)
    if groups:
        for group, x in (("left", 0.0), ("right", 40.0)):
            named = NUMBERED[group] if name.endswith("bdf") else group
            places = mesh.points[mesh.groups[named]]
            assert len(places) == (7 if "nine" in name else 4)
            assert (places[:, 0] == x).all()
    if surfaces:
        assert mesh.surfaces["sheet"].tolist() == list(range(12))


def test_a_part_of_abaqus_is_read_with_its_sets(tmp_path: Path) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    mesh = read(tmp_path, CAE, "plate.inp")
    assert (mesh.elements, mesh.extent) == (2, ([0.0, 0.0], [20.0, 10.0]))
    assert mesh.groups["edge"].tolist() == [0, 3]
    assert mesh.surfaces["all"].tolist() == [0, 1]


def test_xdmf_is_read_where_its_numbers_are_in_the_file(tmp_path: Path) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    assert read_mesh(MESHES / "two.xdmf").extent == ([0.0, 0.0], [100.0, 80.0])
    text = (MESHES / "two.xdmf").read_text()
    with pytest.raises(fecm.MeshError, match="refers to other files"):
        read(tmp_path, text.replace('Format="XML"', "Format='HDF'", 1), "two.xdmf")


@pytest.mark.parametrize("name", ["unnamed-4.1.msh", "unnamed-binary-4.1.msh"])
def test_a_curve_or_surface_of_gmsh_counts_for_all_its_groups_without_a_name(name: str) -> None:
    """The left side is in groups 11 and 12, the others in 12, the surface in 21 and 22."""
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    mesh = read_mesh(MESHES / name)
    assert (mesh.points[mesh.groups["11"], 0] == 0.0).all()
    assert (len(mesh.groups["11"]), len(mesh.groups["12"])) == (3, 8)  # of 2 x 2 elements
    assert [mesh.surfaces[group].tolist() for group in ("21", "22")] == [[0, 1, 2, 3]] * 2


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (CAE.replace("S4R", "S8"), "a.inp", "a.inp:12: .*no elements of type S8; write it as S8R"),
        (CAE.replace("S4R", "R3D4"), "a.inp", "a.inp:12: .*type R3D4; write the plate alone"),
        (CAE.replace("*Assembly", "*Part"), "a.inp", "a.inp:22: a second .Part"),
        (CAE.replace("10.,          10.", "  ,          10."), "a.inp", "a.inp:10: .*is blank"),
        (MSH, "a.msh", "a.msh: some elements are in a physical group.*SaveAll"),
        ("nonsense", "a.vtk", "a.vtk can't be read as a mesh by meshio.*; save it as MSH 2.2 or"),
    ],
    ids=lambda value: value[-12:],
)
def test_what_meshio_cannot_read_is_one_line_with_place_and_remedy(
    tmp_path: Path, text: str, name: str, message: str
) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    with pytest.raises(fecm.MeshError, match=message) as caught:
        read(tmp_path, text, name)
    assert "\n" not in str(caught.value)


# Nastran ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "cards",
    [
        ["GRID           1              0.      0.      0.", "GRID*                  2"
         "                              2.              0.", "*                     0.",
         "GRID    3               2.0+0   1.      .0", "GRID,4,,,1.",
         "CQUAD4         1       1       1       2       3       4"],
        ["GRID,1,,0.,0.,0.", "GRID\t2\t\t2.\t0.\t0.", "$ a comment", "GRID*,3,,2.0D0,10.-1,+A",
         "*A,0.", "GRID,4,,0.,1.,0.", "CQUAD4,1,1,1,2,3,4,0.,0.,+", "+,,,,,,"],
    ],
    ids=["columns", "commas"],
)  # fmt: skip
def test_small_large_and_free_fields_of_nastran_are_the_same_plate(
    tmp_path: Path, cards: list[str]
) -> None:
    mesh = read(tmp_path, bulk(*cards))
    np.testing.assert_array_equal(mesh.points, [(0, 0), (2, 0), (2, 1), (0, 1)])


def test_a_ring_sector_in_cylindrical_coordinates_has_the_area_of_the_ring(tmp_path: Path) -> None:
    """Chords of 16 elements over 90 degrees; the plane's own area is the polygon's."""
    grids = [
        f"GRID,{17 * ring + n + 1},{{}},{r},{n * 90.0 / 16.0},0."
        for ring, r in enumerate((50.0, 100.0))
        for n in range(17)
    ]
    quads = [f"CQUAD4,{n},1,{n},{n + 17},{n + 18},{n + 1}" for n in range(1, 17)]
    system = ["CORD2C,1,,0.,0.,0.,0.,0.,1.,+", "+,1.,0.,0."]
    named = read(tmp_path, bulk(*system, *(g.format(1) for g in grids), *quads))
    by_default = read(tmp_path, bulk("GRDSET,,1", *system, *(g.format("") for g in grids), *quads))
    exact = 16 * (100.0**2 - 50.0**2) / 2.0 * np.sin(np.radians(90.0 / 16.0))
    assert area(named) == pytest.approx(exact, rel=1e-6)
    np.testing.assert_array_equal(named.points, by_default.points)


def test_systems_of_nastran_may_be_within_others_and_given_by_nodes(tmp_path: Path) -> None:
    shifted = ["CORD2R,7,,10.,0.,0.,10.,0.,1.,+", "+,10.,1.,0."]  # x along the basic y
    within = ["CORD2R,8,7,0.,5.,0.,0.,5.,1.,+", "+,1.,5.,0."]
    by_nodes = [
        "CORD1R,9,11,12,13",
        "GRID,11,,10.,0.,0.",
        "GRID,12,,10.,0.,1.",
        "GRID,13,,10.,1.,0.",
    ]
    places = {"7": (10.0, 0.0), "8": (5.0, 0.0), "9": (10.0, 0.0)}
    for number, origin in places.items():
        grids = [card.replace(",,", f",{number},", 1) for card in corners()]
        mesh = read(tmp_path, bulk(*shifted, *within, *by_nodes, *grids, "CQUAD4,1,1,1,2,3,4"))
        x, y = origin
        np.testing.assert_allclose(
            mesh.points, [(x, y), (x, y + 2.0), (x - 1.0, y + 2.0), (x - 1.0, y)], atol=1e-9
        )


def test_include_is_followed_from_the_file_that_has_it(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "rest.bdf").write_text(
        "CQUAD4,2,1,2,5,6,3\nGRID,5,,4.,0.\nGRID,6,,4.,1.\n"
    )
    (tmp_path / "parts" / "all.bdf").write_text("INCLUDE 'rest.bdf'\n")
    text = bulk(*corners(), "CQUAD4,1,1,1,2,3,4", 'include "parts/all.bdf"')
    assert read(tmp_path, text).extent == ([0.0, 0.0], [4.0, 1.0])
    (tmp_path / "parts" / "rest.bdf").unlink()
    with pytest.raises(fecm.MeshError, match=r"all\.bdf:1: INCLUDE: .*put it beside"):
        read(tmp_path, text)
    for number in range(11):
        (tmp_path / f"{number}.bdf").write_text(f"INCLUDE {number + 1}.bdf\n")
    with pytest.raises(fecm.MeshError, match="nested deeper"):
        read(tmp_path, bulk("INCLUDE 0.bdf"))


def test_a_file_is_included_once_and_from_the_folder_of_the_mesh(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    for number in range(8):  # 12^8 files, if each were read as often as it is included
        (folder / f"b{number}.bdf").write_text(f"INCLUDE 'b{number + 1}.bdf'\n" * 12)
    (folder / "b8.bdf").write_text("$\n")
    with pytest.raises(fecm.MeshError, match=r"b7\.bdf:2: INCLUDE: .*b8\.bdf is included before"):
        read(folder, bulk("INCLUDE b0.bdf"))
    with pytest.raises(fecm.MeshError, match=r"plate\.bdf is included before"):
        read(folder, bulk("INCLUDE plate.bdf"))
    (tmp_path / "secret").write_text("+SECRET\n")
    for name in ("../secret", str(tmp_path / "secret")):
        with pytest.raises(fecm.MeshError, match=r"secret is outside .*put it beside") as refused:
            read(folder, bulk(f"INCLUDE '{name}'"))
        assert "SECRET" not in str(refused.value)
    with pytest.raises(fecm.MeshError, match="is not the name of a file"):
        read(folder, bulk("INCLUDE 'a\0b'"))


@pytest.mark.links
def test_a_link_to_another_folder_is_not_included(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "secret").write_text("+SECRET\n")
    (tmp_path / "here" / "a.bdf").symlink_to(tmp_path / "secret")
    with pytest.raises(fecm.MeshError, match=r"a\.bdf is outside "):
        read(tmp_path / "here", bulk("INCLUDE a.bdf"))


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        (["CQUAD4,1,1,1,2,3,4,,.5"], "bdf:8: CQUAD4 1 has the offset ZOFFS .5"),
        (["CQUAD4,1,1,1,2,3,4,30."], "bdf:8: CQUAD4 1 has THETA 30."),
        (["CQUAD4,1,1,1,2,3,4,5"], "has the system 5, which no CORD card gives"),
        (["CORD2R,5,,0.,0.,0.,0.,0.,1.,+", "+,0.,1.,0.", "CQUAD4,1,1,1,2,3,4,5"], "has MCID 5"),
        (["CQUAD4,1,1,1,2,3,4,,,+", "+,,1.,1.,1.,1."], "has thicknesses of corners"),
        (["CQUAD4,1,1,1,2,3,9"], "has the node 9, which no GRID card gives"),
        (["CQUAD8,1,1,1,2,3,4"], "has a blank field in place of a whole number"),
        (["CQUAD4,1,1,1,2,3,4", "CTRIA3,2,1,1,2,3"], "CTRIA3 2 is beside CQUAD4"),
        (["CHEXA,1,1,1,2,3,4"], "bdf:8: CHEXA 1 is not part of a plate: leave it out"),
        (["RBE2,1,1,123456,2,3"], "RBE2 1 is not part of a plate"),
        (["CQUAD4,1,1,1,2,3,4", "CBAR,2,7,1,2", "PBAR,7,1,1."], "bdf:9: CBAR 2 is not part of"),
        (["GRID,5,,4.,1.", "=,*1,=,*1.,=="], "bdf:9: = .*write the card in full"),
        (["GRID,1,,1.,1."], "bdf:8: GRID 1 is given twice, first at .*bdf:4"),
        (["GRID,5,,1.x", "CQUAD4,1,1,1,2,3,5"], "GRID 5 has `1.x`, which is not a finite number"),
        (["GRID*,5,,1.,1.,+A", "*B,0."], "bdf:9: the continuation `.B` does not follow its card"),
        (["GRID,5,9,0.", "CQUAD4,1,1,1,2,3,5"], "has the system 9"),
        (["CORD2R,5,5,0.,0.,0.,0.,0.,1.,+", "+,1.,0.,0.", "GRID,5,5", "CQUAD4,1,1,1,2,3,5"],
         "CORD2R 5 depends on itself"),
        ([f"CORD2R,{n},{n + 1},0.,0.,0.,0.,0.,1.,+\n+,1.,0.,0." for n in range(5, 2000)]
         + ["GRID,5,5", "CQUAD4,1,1,1,2,3,5"], "is within more than 100 other systems"),
        (["GRID,5,,1.e400", "CQUAD4,1,1,1,2,3,5"], "not a finite number"),
        (["CQUAD8,1,1,1,2,3,4,5,6,7,8"], "bdf:8: CQUAD8 1 has more than 10 fields in a line"),
        (["CORD2R,5,,50.,0.,0.,50.,0.,1.,51.,0.,0."], "bdf:8: CORD2R 5 has more than 10 fields"),
        ([], "has no elements of a plate"),
    ],
)  # fmt: skip
def test_what_a_plate_does_not_have_is_refused_with_line_and_remedy(
    tmp_path: Path, cards: list[str], message: str
) -> None:
    with pytest.raises(fecm.MeshError, match=message):
        read(tmp_path, bulk(*corners(), *cards))


def test_an_mcid_along_x_turns_nothing(tmp_path: Path) -> None:
    for angle in ("", "0.0", "0", "5"):
        system = ["CORD2R,5,,1.,1.,0.,1.,1.,1.,+", "+,2.,1.,0."]
        mesh = read(tmp_path, bulk(*corners(), *system, f"CQUAD4,1,1,1,2,3,4,{angle}"))
        assert mesh.elements == 1


SQUARE = "1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"*Node\n{SQUARE}*Element, type=S4\n1, 1, 2, 3, 4\n*Node\n9, 0., 5.\n",
         ":8: a second .Node; give the nodes of the plate in one"),
        (f"*Node, system=C\n{SQUARE}*Element, type=S4\n1, 1, 2, 3, 4\n",
         ":1: `.Node, system=C` makes or moves nodes"),
        (f"*System\n1., 1.\n*Node\n{SQUARE}*Element, type=S4\n1, 1, 2, 3, 4\n",
         ":1: `.System` makes or moves nodes"),
        (f"*Node\n{SQUARE}*Element, type=S4\n1, 1, 2, 3, 4\n*Elgen, elset=all\n1, 4, 1, 1\n",
         ":8: `.Elgen, elset=all` makes or moves nodes"),
        (f"*Node\n{SQUARE}*Element, type=S4\n1, 1, 2, 3, 4\n*Nset, generate, nset=a\n4, 1, -3\n",
         ":8: GENERATE has `4, 1, -3`; write first, last and a positive increment"),
        (f"*Node\n{SQUARE}*Element, type=S4\n1, 1, 2, 3, 4\n*Nset, nset=a, generate\n1, 4\n",
         ":8: GENERATE has `1, 4`"),
        ("*Node\n1, 0., 0., 0.,\n2, 1., 0., 0.,\n*Element, type=S4\n1, 1, 2, 2, 1\n",
         ":2: a comma follows the last coordinate"),
    ],
)  # fmt: skip
def test_what_meshio_leaves_out_of_abaqus_is_refused_with_line_and_remedy(
    tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "plate.inp"
    file.write_text(text)
    with pytest.raises(fecm.MeshError, match=message):
        fecm.Plate.from_mesh(file, "simple")


def test_parametric_nodes_of_gmsh_are_named(tmp_path: Path) -> None:
    file = tmp_path / "plate.msh"
    nodes = "$ParametricNodes\n1\n1 0 0 0 0 1\n$EndParametricNodes\n"
    file.write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{nodes}$Elements\n1\n1 15 2 1 1 1\n$EndElements\n"
    )
    with pytest.raises(fecm.MeshError, match=r":4: .*SaveParametric"):
        fecm.Plate.from_mesh(file, "simple")


ROWS = {
    "nodes": "*NODE\n1, 0., 0.\n2, 10., 0.\n3, 20., 0.\n4, 0., 10.\n5, 10., 10.\n6, 20., 10.\n"
    "7, 0., 20.\n8, 10., 20.\n9, 20., 20.\n",
    "first": "1, 1, 2, 5, 4\n2, 2, 3, 6, 5\n3, 4, 5, 8, 7\n",
    "second": "4, 5, 6, 9, 8\n",
}
FIRST, SECOND = (f"*ELEMENT, TYPE=S4R\n{ROWS[name]}" for name in ("first", "second"))


@pytest.mark.parametrize(
    ("text", "groups", "surfaces"),
    [
        (FIRST + "*ELSET, ELSET=Z\n1, 2\n" + SECOND, {}, {"Z": [0, 1]}),
        ("*ELSET, ELSET=Z\n1, 4\n" + FIRST + SECOND, {}, {"Z": [0, 3]}),
        (FIRST + SECOND.replace("S4R", "S4R, ELSET=Z"), {}, {"Z": [3]}),
        (FIRST + SECOND.replace("S4R", "S4R,\nELSET=Z"), {}, {"Z": [3]}),
        (
            FIRST.replace("S4R", "s4r, elset=Z") + SECOND.replace("S4R", "S4R, ELSET=z"),
            {},
            {"Z": [0, 1, 2, 3]},
        ),
        (
            FIRST.replace("S4R", "S4R, ELSET=A") + SECOND + "*ELSET, ELSET=Z\na, 4\n",
            {},
            {"A": [0, 1, 2], "Z": [0, 1, 2, 3]},
        ),
        ("*NSET, NSET=left\n1, 4\n" + FIRST + SECOND, {"left": [0, 3]}, {}),
        (
            FIRST + SECOND + "*NSET, NSET=a\n1, 4\n*NSET, NSET=b\na\n7\n",
            {"a": [0, 3], "b": [0, 3, 6]},
            {},
        ),
        (FIRST + SECOND + "*NSET, NSET=a\n1\n*NSET, NSET=a\n4\n", {"a": [0, 3]}, {}),
        (
            FIRST + SECOND + "*NSET, NSET=a, GENERATE\n1, 2000000000, 3\n",
            {"a": [0, 3, 6]},
            {},
        ),
        (
            FIRST + SECOND + "*NSET, NSET=a\n1\n*NSET, NSET=a, INSTANCE=I\n4\n",
            {"a": [3]},
            {},
        ),
    ],
    ids=range(11),
)
def test_sets_of_abaqus_have_their_members_wherever_they_stand(
    tmp_path: Path, text: str, groups: dict[str, list[int]], surfaces: dict[str, list[int]]
) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    mesh = read(tmp_path, ROWS["nodes"] + text, "plate.inp")
    assert {name: rows.tolist() for name, rows in mesh.groups.items()} == groups
    assert {name: rows.tolist() for name, rows in mesh.surfaces.items()} == surfaces


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        ("*ELSET, ELSET=Z\n1, 99\n", r":17: \*ELSET has the element 99, which is not in the file"),
        ("*NSET, NSET=Z\n99\n", r":17: \*NSET has the node 99, which is not in the file"),
        ("*NSET, NSET=Z\nY\n", r":17: \*NSET has the set Y, which no card before it gives"),
    ],
)
def test_a_set_of_abaqus_without_its_members_is_refused(
    tmp_path: Path, cards: str, message: str
) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    with pytest.raises(fecm.MeshError, match=message):
        read(tmp_path, ROWS["nodes"] + FIRST + SECOND + cards, "plate.inp")


@pytest.mark.parametrize("height", [0.0, 8.0])
def test_a_last_node_in_no_element_at_the_place_of_another_is_left_out(
    tmp_path: Path, height: float
) -> None:
    card = "CQUAD4,1,1,1,2,3,4"
    mesh = read(tmp_path, bulk(*corners(), f"GRID,99,,0.,0.,{height}", card))
    assert (mesh.nodes, mesh.elements) == (4, 1)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.inp", "! plate\n/PREP7\nET,1,SHELL181\n", "is an input or an archive of Ansys, .*VTK"),
        ("a.cdb", "*IF,A,EQ,1,THEN\n/PREP7\n", "is an input or an archive of Ansys"),
        ("a.msh", "$NOD\n1\n1 0 0 0\n$ENDNOD\n", "MSH 1.0, .*save the mesh as MSH 2.2"),
        ("a.unv", "    -1\n  2411\n", "universal file .UNV.*save the mesh as MSH 2.2"),
        ("a.geo", "Point(1) = {0, 0, 0, 1};\n", "script of Gmsh.*-format msh22"),
        ("a.step", "ISO-10303-21;\n", "CAD model.*midsurface"),
    ],
)
def test_a_mesh_of_a_format_that_is_not_read_is_named_with_the_export_that_is(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    with pytest.raises(fecm.MeshError, match=message):
        read(tmp_path, text, name)


def test_triangles_beside_quadrilaterals_are_refused_with_a_way_out(tmp_path: Path) -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    cards = bulk(*corners(), "CQUAD4,1,1,1,2,3,4", "CTRIA3,2,1,1,2,3")
    with pytest.raises(fecm.MeshError, match=r"CTRIA3 2 is beside .*SubdivisionAlgorithm = 1"):
        read(tmp_path, cards)
    text = ROWS["nodes"] + FIRST + "*ELEMENT, TYPE=S3\n9, 5, 6, 9\n"
    with pytest.raises(fecm.MeshError, match=r"quad and triangle .*SubdivisionAlgorithm = 1"):
        read(tmp_path, text, "plate.inp")


def test_the_name_of_an_included_file_may_continue_in_the_next_lines(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "nodes.bdf").write_text("\n".join(corners()) + "\n")
    for name in ("'sub/\nnodes.bdf'", "'su\nb/nodes\n.bdf'  $ comment", '"sub/\n  nodes.bdf"'):
        text = f"BEGIN BULK\nINCLUDE {name}\nCQUAD4,1,1,1,2,3,4\nENDDATA\n"
        assert read(tmp_path, text).nodes == 4
