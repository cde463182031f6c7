"""Curved panels as users meet them: decks, values, results, exports, pictures, judgements."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import fecm
from fecm import Deck, MeshError
from fecm.authoring.case import CasesError
from fecm.authoring.parameters import ObjectError
from fecm.deck.model import Boundary, Curvature
from fecm.judge.validity import CURVED
from fecm.problem.generate import generate, restraint_codes
from fecm.problem.loading import load_deck
from fecm.problem.summary import deck_summary
from fecm.report.content import render
from fecm.report.report import page_of
from fecm.results.summary import run_summary as summary_of
from tests.calls import call, new
from tests.pictures import plot

# Of `fecm new`; the numbers of the deck that `panel` makes.
OPTIONS = (
    *("--size", "30x20", "--mesh", "4x4", "--layup", "[0/90]s", "--ply-thickness", "0.1"),
    *("--material", "IM7/8552", "--units", "mm-N-s", "--projectile", "mass:1e-6"),
    *("--law", "5e4,0,0,1.5", "--velocity", "1m/s", "--duration", "2e-5", "--every", "5"),
)
SUPPORTED = (*OPTIONS, "--support", "simple")


def panel(*, support: Any = "simple", edges: Any = None, **given: Any) -> Deck:
    """A small panel, struck softly."""
    settings: dict[str, Any] = {
        "velocity": 1000.0, "duration": 2e-5, "every": 5, "units": "mm-N-s", "patch": None
    }  # fmt: skip
    return fecm.impact(
        fecm.Plate.rectangle((30, 20), (4, 4), support=support, edges=edges),
        fecm.Laminate("[0/90]s", "IM7/8552", 0.1),
        fecm.RigidMass(1e-6),
        fecm.Contact(5e4),
        **settings | given,
    )


def held(deck: Deck) -> dict[str, set[str]]:
    """What the nodes inside the edges of the panel, and those inside it, hold in the plane."""
    places = generate(deck).coordinates
    codes = restraint_codes(tuple(deck.all(Boundary)), deck.control.numnp, deck.control.ndf)
    (x, y), (right, top) = places.T, places.max(axis=0)
    corner = ((x == 0.0) | (x == right)) & ((y == 0.0) | (y == top))
    parts = {
        "left": (x == 0.0) & ~corner,
        "bottom": (y == 0.0) & ~corner,
        "inside": (x > 0.0) & (x < right) & (y > 0.0) & (y < top),
    }
    return {
        name: {dof for dof, code in zip("uv", (codes[nodes, :2] != 0).T, strict=True) if code.all()}
        for name, nodes in parts.items()
    }


# Decks --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "left", "bottom"),
    [
        ({}, {"v"}, {"u"}),
        ({"support": "pinned"}, {"u", "v"}, {"u", "v"}),
        ({"support": "clamped"}, {"u", "v"}, {"u", "v"}),
        ({"edges": {"left": "pinned"}}, {"u", "v"}, {"u"}),
        ({"in_plane": "normal"}, {"u"}, {"v"}),
        ({"in_plane": "held"}, {"u", "v"}, {"u", "v"}),
        ({"in_plane": "free"}, set(), set()),
    ],
)
@pytest.mark.few(3)  # of 7, 0.05 s each
def test_edges_of_a_curved_panel_hold_what_their_support_says(
    given: dict[str, Any], left: set[str], bottom: set[str]
) -> None:
    actual = held(panel(radius_x=100.0, **given))
    assert actual == {"left": left, "bottom": bottom, "inside": set()}


def test_pinned_edges_of_a_nonlinear_plate_hold_both_displacements() -> None:
    actual = held(panel(support="pinned", nonlinear=True, in_plane="free"))
    assert actual == {"left": {"u", "v"}, "bottom": {"u", "v"}, "inside": set()}


def test_the_command_writes_the_deck_of_the_function_and_says_what_the_edges_hold(
    tmp_path: Path,
) -> None:
    path = tmp_path / "panel.inp"
    done = call("new", path, *SUPPORTED, "--radius-x", "-100", "--radius-y", "250")
    assert done.exit_code == 0, done.stderr
    assert (
        "the panel is curved (CURV): in its plane simple edges hold the displacement along the "
        "edge (SS3); --support pinned holds both"
    ) in done.stderr
    built = fecm.read_one(path)
    assert built == panel(patch="auto", radius_x=-100.0, radius_y=250.0)
    assert built.require(Curvature).curvatures == (-0.01, 0.004, 0.0)


def test_a_flat_deck_is_that_of_before(tmp_path: Path) -> None:
    path = tmp_path / "flat.inp"
    assert "curved" not in call("new", path, *SUPPORTED, "--kinematics", "linear").stderr
    assert "CURV" not in path.read_text()
    assert held(fecm.read_one(path))["inside"] == {"u", "v"}


@pytest.mark.parametrize("radius", [0.0, math.inf, math.nan])
def test_what_is_no_radius_is_refused(radius: Any) -> None:
    with pytest.raises(ObjectError, match=r"`radius_y` is .* must be a finite number other than 0"):
        panel(radius_y=radius)


@pytest.mark.parametrize(
    ("radius", "words"),
    [("0", "--radius-x is 0.0; it must be a finite number other than 0"),
     ("inf", "--radius-x is 'inf', not a number"), ("nan", "--radius-x is 'nan', not a number"),
     ("10", "error[E523]: The midplane of CURV has a slope of 1.5")],
)  # fmt: skip
def test_wrong_radii_of_the_command_are_refused_and_nothing_is_written(
    radius: str, words: str, tmp_path: Path
) -> None:
    done = call("new", tmp_path / "panel.inp", *SUPPORTED, "--radius-x", radius)
    assert done.exit_code == 2
    assert words in done.stderr
    assert not any(tmp_path.iterdir())


def test_a_mesh_of_triangles_is_refused_and_one_with_oblique_sides_asks_for_pins() -> None:
    corners = ((0.0, 0.0), (30.0, 0.0), (34.0, 20.0), (4.0, 20.0))
    laminate, mass = fecm.Laminate("[0/90]s", "IM7/8552", 0.1), fecm.RigidMass(1e-6)
    cases: list[tuple[Any, Any, type[Exception], str]] = [
        ("pinned", [[0, 1, 2], [0, 2, 3]], fecm.DeckError, "as CURV needs"),
        ("simple", [[0, 1, 2, 3]], MeshError, "u and v are not tangential to them"),
    ]
    for support, cells, error, words in cases:
        plate = fecm.Plate.from_mesh((corners, cells), support)
        with pytest.raises(error, match=words):
            fecm.impact(plate, laminate, mass, fecm.Contact(5e4), velocity=1000.0,
                        duration=2e-5, units="mm-N-s", radius_x=100.0)  # fmt: skip


# Values that vary ---------------------------------------------------------------------------------


def test_each_radius_of_a_sweep_is_its_own_panel() -> None:
    base = panel(radius_x=100.0)
    swept = fecm.sweep(base, {"radius_x": [0.0, 100.0, 60.0]}, history=True)
    assert swept.force is not None
    for force, radius in zip(swept.force, (0.0, 100.0, 60.0), strict=True):
        full = fecm.run_one(base.with_(radius_x=radius)).force
        assert force == pytest.approx(full, rel=0, abs=1e-10 * full.max())
    assert np.ptp(swept.force[:, -1]) > 1e-3 * swept.force[0, -1]


def test_a_deck_that_holds_its_plane_takes_no_radius_without_supports() -> None:
    flat = panel(kinematics="linear")
    with pytest.raises(CasesError, match="holds u and v at every node"):
        flat.with_(radius_x=100.0)
    assert held(flat.with_(radius_x=100.0, support="pinned"))["left"] == {"u", "v"}
    assert held(flat.with_(radius_x=100.0, support="simple")) == held(panel(radius_x=100.0))


def test_a_new_plate_of_a_curved_deck_has_the_supports_of_a_panel() -> None:
    other = fecm.Plate.rectangle((40, 20), (4, 4), support="simple")
    assert held(panel(radius_x=100.0, patch="auto").with_(plate=other))["left"] == {"v"}


# Results ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nx", "factor"), [(16, 1.461), pytest.param(32, 1.161, marks=pytest.mark.long)]
)
@pytest.mark.long
def test_the_buckling_load_of_a_coarse_curved_panel_is_an_upper_bound(
    nx: int, factor: float
) -> None:
    # A Ritz series gives 1.128; 64 x 32 elements, 2.4 along a buckle, give 1.130.
    answer = new(
        *("--size", "2000x1000", "--mesh", f"{nx}x{nx // 2}", "--radius-y", "2000"),
        *("--support", "simple", "--layup", "[0/90/-45/45]s", "--ply-thickness", ".125"),
        *("--units", "mm-N-s", "--ply", "1.58e-9,.28,142500,8700,5100,5100,5100"),
        *("--preload=-10,0,1", "--projectile", "mass:1e-3", "--law", "4e4,0,0,1.5"),
        *("--velocity", "1000", "--duration", "1e-4", "--dt", "1e-7", "--patch", "none"),
    )
    assert "W561" in answer.stderr
    (problem,) = load_deck(answer.stdout).problems
    summary = deck_summary(problem)
    assert summary.buckling_factor == pytest.approx(factor, rel=1e-3)
    assert summary.elements_per_buckle == pytest.approx(1.73 * 2000.0**0.5 / (2000.0 / nx))
    assert f"at most {summary.buckling_factor:.4g} times the preload" in "\n".join(summary.lines())


@pytest.fixture(scope="module")
def curved() -> fecm.Result:
    """A panel with the radii 100 and -200; its middle is at 15, 10."""
    return fecm.run_one(panel(radius_x=100.0, radius_y=-200.0))


def test_heights_are_those_of_the_arcs_about_the_middle(curved: fecm.Result) -> None:
    x, y = curved["mesh/coordinates"].T - [[15.0], [10.0]]
    z = curved["mesh/z"]
    assert z == pytest.approx(-(x**2) / 200.0 + y**2 / 400.0, rel=0, abs=1e-12)
    assert z[0] == pytest.approx(-1.125 + 0.25)
    # A positive radius: the edges lie towards the projectile, on the side of -w.
    assert z[(np.abs(y) < 1e-9) & (np.abs(x) > 14.9)].max() < 0.0
    assert curved.attributes_of("mesh") == {"radius_x": 100.0, "radius_y": -200.0}
    assert curved.unit("mesh/z") == "mm"


def test_a_flat_result_has_no_heights() -> None:
    flat = fecm.run_one(panel(radius_x=100.0).with_(radius_x=0.0))
    assert "mesh/z" not in flat
    assert flat.attributes_of("mesh") == {}
    assert not any("curved" in line for line in summary_of(flat))


def test_exports_have_the_surface(curved: fecm.Result, tmp_path: Path) -> None:
    curved.export(tmp_path / "panel.vtkhdf")
    with h5py.File(tmp_path / "panel.vtkhdf") as file:
        points = file["VTKHDF/Points"][()]
    assert points[:, 2] == pytest.approx(curved["mesh/z"])
    assert points[:, :2] == pytest.approx(curved["mesh/coordinates"])
    pytest.importorskip("pyvista")
    assert np.asarray(curved.to_pyvista().points) == pytest.approx(points)


def test_summaries_say_radii_and_rise(curved: fecm.Result) -> None:
    said = "curved panel      Rx 100 mm, Ry -200 mm, rise 1.375 mm"
    assert said in [line.strip() for line in summary_of(curved)]
    summary = deck_summary(load_deck(curved.deck).problems[0])
    assert summary.curvature == (0.01, -0.005, 0.0)
    assert summary.rise == pytest.approx(1.125 + 0.25)
    assert "  curved panel        Rx 100 mm, Ry -200 mm, rise 1.375 mm" in summary.lines()


def test_an_estimate_says_which_model_is_flat() -> None:
    flat, bent = fecm.estimate(panel()), fecm.estimate(panel(radius_x=100.0))
    assert bent.remarks["curvature"].endswith("the infinite plate is flat")
    assert bent.stiffness > 1.2 * flat.stiffness
    ours, theirs = bent.models["infinite plate"], flat.models["infinite plate"]
    assert ours.peak_force == theirs.peak_force


# Pictures and pages -------------------------------------------------------------------------------


def test_the_surface_is_the_panel_with_its_deflection_enlarged(
    curved: fecm.Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    corners: list[Any] = []
    right = Poly3DCollection.set_verts

    def kept(plate: Any, verts: Any, *rest: Any, **more: Any) -> None:
        corners.append(verts)
        right(plate, verts, *rest, **more)

    monkeypatch.setattr(Poly3DCollection, "set_verts", kept)
    figure: Any = plot(curved, "surface")
    axes = figure.axes[0]
    (said,) = [t.get_text() for t in axes.texts if t.get_text().startswith("deflection times")]
    w = curved.tape3.w[int(np.ptp(curved.tape3.w, axis=1).argmax())]
    x, y = curved["mesh/coordinates"].T
    (middle,) = np.flatnonzero((np.abs(x - 15.0) < 1e-6) & (np.abs(y - 10.0) < 1e-6))
    drawn = np.reshape(corners[-1], (-1, 3))
    there = np.abs(drawn[:, :2] - (15.0, 10.0)).max(axis=1) < 1e-6
    assert drawn[there, 2] == pytest.approx(float(said.split()[2]) * w[middle])
    at_corner = np.abs(drawn[:, :2]).max(axis=1) < 1e-6
    assert drawn[at_corner, 2] == pytest.approx(-1.125 + 0.25)
    # One scale along x and z: the shape is that of the panel.
    width, _, height = axes.get_box_aspect()
    assert height / width == pytest.approx(np.ptp(axes.get_zlim()) / np.ptp(axes.get_xlim()))
    (plate,) = axes.collections
    assert np.abs(plate.get_array()).max() <= np.abs(curved.tape3.w).max()  # no heights


def test_the_mesh_says_that_it_is_a_panel_from_above(curved: fecm.Result) -> None:
    figure: Any = plot(curved, "mesh")
    title = figure.axes[0].get_title(loc="left")
    assert title == "curved, $R_{x}$ 100 mm, $R_{y}$ -200 mm, rise 1.375 mm"


def test_a_report_names_the_radii(curved: fecm.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("jinja2")
    monkeypatch.setattr("fecm.report.figures.drawn", lambda *_, **__: iter(()))
    monkeypatch.setattr("fecm.report.figures._bytes", lambda _, form: form.encode())
    html = render(page_of({"panel": curved}))
    for name, text in (("radius Rx", "100 mm"), ("radius Ry", "-200 mm")):
        assert text in html.split(name)[1][:120].replace("−", "-")


def test_the_error_of_a_linear_panel_is_said_to_be_that_of_a_flat_plate() -> None:
    swept = fecm.sweep(panel(radius_x=100.0), {"velocity": [2e4]})
    assert CURVED in "\n".join(swept.notes)
