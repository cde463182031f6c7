"""`fecm modes`: natural modes of a plate without its projectile.

elastic_edges.csv are the results of a program with p-elements that shares no code with fecm.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.plate import Support
from fecm.deck import model
from fecm.deck.model import Boundary, Deck, NodeCodes, NodeValues, OneSidedSupport, Springs
from fecm.mechanics.projectile import MASSES
from fecm.problem.generate import generate
from tests.builders import table
from tests.calls import call

SIZE = 300.0, 200.0
PLY = fecm.Ply(1.57e-9, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.9)
THICKNESS, DENSITY = 2.0, 1.57e-9
SEGMENTS_OF_IMPACT = (model.Impact, model.Patch, model.Indentation, model.Projectile)


def plate(support: Support = "simple", **options: Any) -> Deck:
    """A plate of elastic_edges.csv."""
    size = options.pop("size", SIZE)
    mesh = options.pop("mesh", (12, 8))
    layup = options.pop("layup", "[0/90/0/90/0]s")
    given = {"units": "mm-N-s", "patch": "disc:20", "kinematics": "linear", "shear_factor": 1.0}
    return fecm.impact(
        fecm.Plate.rectangle(size, mesh, support=support),
        fecm.Laminate(layup, PLY, 0.2),
        fecm.RigidMass(1e-3),
        model.Indentation(5e4, 1e6, 0.1, 1.5),
        **{**given, "velocity": 1000.0, "duration": 1e-3, **options},
    )


def with_segments(deck: Deck, *segments: model.Segment) -> Deck:
    """The deck with more segments."""
    return replace(deck, segments=(*deck.segments, *segments), text="")


def test_a_simply_supported_plate_has_the_frequencies_of_another_program_in_hertz() -> None:
    row = table("elastic_edges.csv")[0]
    found = fecm.modes(plate(mesh=(18, 12)))
    expected = [float(row[f"f{n}_Hz"]) for n in range(1, 7)]
    assert found.frequency == pytest.approx(expected, rel=2e-3)
    assert found.frequency_unit == "Hz"
    assert found.period * found.frequency == pytest.approx(1.0)
    assert found.nodal_lines == ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (2, 1))


def test_hertz_do_not_depend_on_the_unit_of_time() -> None:
    in_seconds = fecm.modes(plate("clamped"), 3)
    ply = fecm.Ply(1.57e-3, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.9)
    deck = fecm.plate_deck(
        fecm.Plate.rectangle(SIZE, (12, 8), support="clamped"),
        fecm.Laminate("[0/90/0/90/0]s", ply, 0.2),
        "LMAS\nEIGE,,3",
        units="mm-N-ms",
        shear_factor=1.0,
    )
    in_milliseconds = fecm.modes(deck, 3)
    assert in_milliseconds.frequency == pytest.approx(in_seconds.frequency, rel=1e-6)
    assert in_milliseconds.period == pytest.approx(1e3 * in_seconds.period, rel=1e-6)


def test_the_consistent_mass_has_other_frequencies_that_agree_with_the_other_program() -> None:
    row = table("elastic_edges.csv")[0]
    lumped, consistent = (fecm.modes(plate(), 3, mass=m).frequency for m in MASSES)
    expected = [float(row[f"f{n}_Hz"]) for n in range(1, 4)]
    assert consistent == pytest.approx(expected, rel=2e-3)
    assert (consistent > lumped).all()


def test_a_plate_that_stretches_has_the_modes_of_small_bending() -> None:
    linear, stretches = (
        fecm.modes(plate(mesh=(4, 4), patch="disc:60", kinematics=k), 200)
        for k in ("linear", "von-karman")
    )
    assert stretches.frequency == pytest.approx(linear.frequency, rel=1e-9)  # no mode in the plane


def test_shapes_with_oblique_nodal_lines_have_no_numbers_of_lines() -> None:
    found = fecm.modes(plate(layup="[45]10"), 3)
    assert found.nodal_lines == ((0, 0), None, None)


def test_the_shares_of_all_modes_are_the_whole_flexibility() -> None:
    found = fecm.modes(plate(mesh=(4, 4), patch="disc:60"), 200)
    assert len(found.share) == 175  # w and two rotations of 81 nodes without the edges
    assert found.share.sum() == pytest.approx(1.0, rel=1e-9)


def test_tension_raises_a_frequency_as_a_membrane_has_it() -> None:
    n_x, n_y = 20.0, 5.0
    plain, stretched = fecm.modes(plate(), 1), fecm.modes(plate(preload=(n_x, n_y)), 1)
    added = (n_x * (np.pi / SIZE[0]) ** 2 + n_y * (np.pi / SIZE[1]) ** 2) / (DENSITY * THICKNESS)
    expected = np.sqrt(plain.frequency[0] ** 2 + added / (4.0 * np.pi**2))
    assert stretched.frequency[0] == pytest.approx(expected, rel=2e-4)


def test_a_free_plate_has_rigid_motions_of_zero_hertz() -> None:
    flat = fecm.modes(plate("free"), 5)
    assert flat.frequency[:3].tolist() == [0.0, 0.0, 0.0]
    assert flat.frequency[3] > 10.0
    assert flat.nodal_lines[3] == (1, 1)  # it twists
    assert np.isinf(flat.period[:3]).all()
    assert np.isnan(flat.share).all()
    # u and v of a coupled plate move with w, so that it also moves freely in its plane.
    coupled = fecm.modes(plate("free", layup="[0/90]"), 7)
    assert (coupled.frequency > 0.0).tolist() == [False] * 6 + [True]


def test_a_deck_needs_no_projectile_and_no_program(tmp_path: Path) -> None:
    deck = plate()
    whole = fecm.modes(deck, 3)
    bare = replace(
        deck, segments=tuple(s for s in deck.segments if not isinstance(s, SEGMENTS_OF_IMPACT))
    )
    lines = replace(bare, macros=(), text="").to_text().splitlines()
    start = lines.index("MACR")
    path = tmp_path / "plate.inp"
    path.write_text("\n".join([*lines[:start], "STOP", ""]))
    found = fecm.modes(path, 3)
    assert found.frequency == pytest.approx(whole.frequency, rel=1e-9)
    assert np.isnan(found.share).all()
    assert call("run", path).exit_code == 2  # other commands need the program


def test_supports_with_a_gap_are_open_unless_they_are_held() -> None:
    def on(segment: model.Segment, **options: Any) -> fecm.PlateModes:
        return fecm.modes(with_segments(plate("free"), segment), 4, **options)

    nodes = (1, 25, 401, 425)
    stiffness = 300.0
    one_sided = model.OneSidedSupports(
        tuple(OneSidedSupport(n, 0, 1, stiffness, 0.1) for n in nodes)
    )
    springs = Springs(tuple(NodeValues(n, 0, (0.0, 0.0, stiffness, 0.0, 0.0)) for n in nodes))
    assert on(one_sided).frequency[:3].tolist() == [0.0, 0.0, 0.0]
    assert on(one_sided).notes == (
        "4 of the 4 one-sided supports (UNIL) are open; the closed ones also pull",
    )
    held = on(one_sided, held=True)
    assert held.frequency == pytest.approx(on(springs).frequency, rel=1e-9)
    assert held.frequency[0] > 10.0


def test_a_quarter_of_a_plate_has_the_symmetric_modes_of_the_whole() -> None:
    half = plate("free", size=(150.0, 100.0), mesh=(9, 6))
    places = generate(half).coordinates
    low, high = places == 0.0, np.isclose(places, [150.0, 100.0])
    simple, symmetric = low.any(axis=1), high
    codes = np.zeros((len(places), 5), dtype=int)
    codes[simple, 2] = 1
    codes[low[:, 0], 4] = codes[low[:, 1], 3] = 1  # the rotation along the edge
    codes[symmetric[:, 0], 3] = codes[symmetric[:, 1], 4] = 1
    rows = tuple(NodeCodes(n, 0, tuple(c)) for n, c in enumerate(codes.tolist(), start=1))
    found = fecm.modes(with_segments(half, Boundary(rows)), 2)
    whole = fecm.modes(plate(mesh=(18, 12)), 5)
    assert found.frequency == pytest.approx(whole.frequency[[0, 4]], rel=1e-6)
    assert "the edges x = 150 and y = 100" in found.notes[0]
    assert "only the modes that are symmetric" in found.notes[0]


def test_the_lines_of_a_window_and_its_rim_are_not_counted() -> None:
    deck = fecm.impact(
        fecm.Plate.on_fixture("D7136", mesh=(12, 8)),
        fecm.Laminate("[0/90]6s", PLY, 0.18),
        fecm.RigidMass(5e-3),
        model.Indentation(5e4, 1e6, 0.1, 1.5),
        units="mm-N-s",
        kinematics="linear",
        velocity=1000.0,
    )
    assert fecm.modes(deck, 3).nodal_lines == ((0, 0), (1, 0), (0, 1))


def test_the_command_prints_tables_and_writes_pictures_and_a_result(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(plate().to_text())
    names = ("--plot", "m.png", "-o", "m.h5")
    done = call("modes", "d.inp", "--number", "2", *names, "--format", "json", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    frequencies = [mode["frequency"] for mode in document["modes"]]
    stored = fecm.load(tmp_path / "m.h5")
    assert stored["modes/angular_frequency"] / (2.0 * np.pi) == pytest.approx(frequencies)
    # The deck of the result has the same modes.
    again = fecm.run_one(stored.deck)
    assert again["modes/angular_frequency"].tolist() == stored["modes/angular_frequency"].tolist()
    csv = call("modes", "d.inp", "--number", "2", "--format", "csv", cwd=tmp_path).stdout
    assert [line.split(",")[0] for line in csv.splitlines()] == ["number", "1", "2"]
    assert float(csv.splitlines()[1].split(",")[1]) == frequencies[0]
    assert call("plot", "m.h5", cwd=tmp_path).stdout.strip() == "m-modes.png"
    assert (tmp_path / "m.png").stat().st_size > 10_000
    again_refused = call("modes", "d.inp", *names, cwd=tmp_path)
    assert again_refused.exit_code == 2


def test_a_picture_has_a_panel_with_its_frequency_for_each_mode() -> None:
    from fecm.plot.pictures import draw

    found = fecm.modes(plate("free", layup="[0/90]", mesh=(6, 4), patch="disc:40"), 7)
    figure = draw("modes", {"plate": found.result}).figure
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.axison]
    assert len(titles) == 7
    assert titles[0] == "1: rigid"
    assert titles[6].startswith("7: ")
    assert titles[6].endswith(" Hz")


def test_arguments_that_are_not_valid_are_refused() -> None:
    with pytest.raises(fecm.errors.OptionsError, match="a number from 1 to 200"):
        fecm.modes(plate(), 0)
    with pytest.raises(fecm.errors.OptionsError, match="known are lumped, consistent"):
        fecm.modes(plate(), mass="heavy")  # type: ignore[arg-type]
