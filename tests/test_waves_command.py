"""``fecm waves``: its tables are the solutions' numbers, its pictures their curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.plot.kinds import PlotError
from fecm.studies.waves import FRONTS, MODES, Medium, WaveSurfaces, dispersion
from tests.builders import general_plate, report_plate, table
from tests.calls import assert_unusable, call, rows
from tests.decks import DATA_CARDS, LONG, small

LAYUP = ("--layup", "[0/45/0/-45/0]2s", "--ply-thickness", ".0053")
LAMINATE = (*LAYUP, "--material", "report")
UNSYMMETRIC = ("--layup", "0/30/70", "--ply-thickness", ".1", "--material", "report")


# Tables -----------------------------------------------------------------------------------------


def test_dispersion_of_the_reports_deck_is_the_reference_files() -> None:
    expected = {
        (float(row["alpha_deg"]), float(row["lambda_over_h"])): row
        for row in table("waves_dispersion.csv")
    }
    done = call("waves", "dispersion", LONG, "--wavelengths", "1:10:10")
    assert done.stdout.splitlines()[0] == (
        "angle_deg,wavelength_over_h,mode,phase_velocity,angular_frequency"
    )
    table_rows = rows(done)
    assert len(table_rows) == 3 * 10 * 5
    assert [row["mode"] for row in table_rows[:5]] == list(MODES)
    compared = 0
    for row in table_rows:
        known = expected[float(row["angle_deg"]), float(row["wavelength_over_h"])]
        if row["mode"].startswith("flexural"):
            velocity = float(known[f"mode{row['mode'][-1]}_c_in/s"])
            assert float(row["phase_velocity"]) == pytest.approx(velocity, rel=1e-8)
            k = float(known["k_1/in"])
            assert float(row["angular_frequency"]) == pytest.approx(k * velocity, rel=1e-8)
            compared += 1
    assert compared == 90


def test_speeds_of_the_reports_deck_are_the_reference_files() -> None:
    done = call("waves", "speeds", LONG, "--step", "15")
    header = "angle_deg,extension,in_plane_shear,bending,twisting,transverse_shear"
    assert done.stdout.splitlines()[0] == header
    values = np.array([list(map(float, row.values())) for row in rows(done)])
    expected = [list(map(float, row.values())) for row in table("waves_normal_velocity.csv")]
    np.testing.assert_allclose(values, expected, rtol=1e-9)
    assert done.stderr == ""


def test_fronts_of_the_reports_deck_are_the_reference_files() -> None:
    done = call("waves", "fronts", LONG, "--step", "45", "--time", "2e-6", "1e-5")
    assert done.stdout.splitlines()[0] == (
        "mode,normal_deg,time,x,y,ray_deg,length_per_radian,strength"
    )
    by_name = {(r["mode"], float(r["normal_deg"]), float(r["time"])): r for r in rows(done)}
    assert len(by_name) == 5 * 9 * 2
    for row in table("waves_wavefront_rays.csv"):
        mode = row["mode"].replace("inplane", "in_plane")
        for time, name in ((2e-6, "t2us"), (1e-5, "t10us")):
            mine = by_name[mode, float(row["normal_deg"]), time]
            for axis in "xy":
                expected = float(row[f"{axis}_{name}"])
                assert float(mine[axis]) == pytest.approx(expected, rel=1e-7, abs=1e-8)
            assert float(mine["ray_deg"]) == pytest.approx(float(row["ray_dir_deg"]), abs=1e-6)


@pytest.mark.parametrize(
    "command", [("dispersion",), ("speeds",), ("fronts", "--step", "45", "--time", "1e-6")]
)
@pytest.mark.few(1)  # of 3, 0.3 s each
def test_a_layup_gives_what_the_same_laminate_in_a_deck_gives(command: tuple[str, ...]) -> None:
    deck, layup = (rows(call("waves", *command, *source)) for source in ((LONG,), LAMINATE))
    assert len(deck) == len(layup)
    for ours, theirs in zip(deck, layup, strict=True):
        for name, value in ours.items():
            if name == "mode":
                assert theirs[name] == value
            else:
                assert float(theirs[name]) == pytest.approx(float(value), rel=1e-9, abs=1e-12)


def test_constants_of_a_ply_stand_for_a_named_one() -> None:
    ply = "0.000148,0.3,17.5e6,1.15e6,.8e6,.8e6,.8e6"
    own, named = (call("waves", "speeds", *LAYUP, *x) for x in (("--ply", ply), LAMINATE[-2:]))
    assert rows(own) == rows(named)


@pytest.mark.parametrize(
    ("command", "header"),
    [
        (
            ("dispersion", "--angle", "0", "--wavelengths", "1:2:2"),
            "angle_deg,wavelength_over_h,mode,phase_velocity (in/s),angular_frequency (1/s)",
        ),
        (
            ("speeds", "--step", "90"),
            "angle_deg,extension (in/s),in_plane_shear (in/s),bending (in/s),twisting (in/s),"
            "transverse_shear (in/s)",
        ),
        (
            ("fronts", "--step", "90", "--time", "1e-5"),
            "mode,normal_deg,time (s),x (in),y (in),ray_deg,length_per_radian (in),strength",
        ),
    ],
)
def test_headers_have_the_units_of_a_named_ply(command: tuple[str, ...], header: str) -> None:
    done = call("waves", *command, *LAMINATE, "--units", "in-lbf-s")
    assert done.stdout.splitlines()[0] == header


@pytest.mark.parametrize(
    "times",
    [
        ("--time", "1e-6", "--time", "2e-6", LONG),
        (LONG, "--time=1e-6", "2e-6"),
        ("--time", "1e-6,2e-6", LONG),
        ("--time", "1e-6", "2e-6", "--", LONG),
    ],
)
@pytest.mark.few(1)  # of 4, 0.2 s each
def test_several_times_may_be_given_in_several_ways(times: tuple[object, ...]) -> None:
    table_rows = rows(call("waves", "fronts", "--step", "45", *times))
    assert {float(row["time"]) for row in table_rows} == {1e-6, 2e-6}
    assert len(table_rows) == 5 * 9 * 2


def test_negative_angles_are_no_options() -> None:
    table_rows = rows(
        call("waves", "dispersion", "--angle", "-45", "30", LONG, "--wavelengths", "2:2:1")
    )
    assert [float(row["angle_deg"]) for row in table_rows] == [-45.0] * 5 + [30.0] * 5
    waves = dispersion(Medium(report_plate()), -45.0, [2.0]).phase_velocity[0]
    np.testing.assert_allclose(
        [float(r["phase_velocity"]) for r in table_rows[:5]], waves, rtol=1e-9
    )


def test_the_shear_factor_multiplies_the_transverse_shear_stiffness() -> None:
    plain, reduced = (
        rows(call("waves", "speeds", LONG, "--shear-factor", factor)) for factor in ("1", "0.81")
    )
    for one, other in zip(plain, reduced, strict=True):
        assert float(other["transverse_shear"]) == pytest.approx(
            0.9 * float(one["transverse_shear"]), rel=1e-12
        )
        assert other["bending"] == one["bending"]


def test_fronts_start_from_a_circle_of_the_given_radius() -> None:
    for option, radius in (((), 0.106), (("--radius", "2"), 2.0), (("--radius", "0"), 0.0)):
        for row in rows(call("waves", "fronts", LONG, "--step", "45", "--time", "0", *option)):
            assert np.hypot(float(row["x"]), float(row["y"])) == pytest.approx(radius, abs=1e-15)


def test_normals_run_from_0_to_360_as_far_as_the_step_goes() -> None:
    for step, expected in (("90", [0, 90, 180, 270, 360]), ("100", [0, 100, 200, 300])):
        values = [
            float(row["angle_deg"]) for row in rows(call("waves", "speeds", LONG, "--step", step))
        ]
        assert values == expected
    tenths = rows(call("waves", "speeds", LONG, "--step", ".3"))
    assert len(tenths) == 1201
    assert float(tenths[-1]["angle_deg"]) == 360.0


def test_cusps_are_reported_on_standard_error_alone() -> None:
    done = call("waves", "fronts", LONG, "--time", "0", "5e-6")
    notes = done.stderr.splitlines()
    assert notes[0] == "fecm: note: no cusps at time 0"
    cusps = WaveSurfaces(Medium(report_plate())).cusps(5e-6, 0.106)
    assert [note.split()[2] for note in notes[1:]] == ["in_plane_shear", "twisting"]
    for cusp in cusps:
        assert any(
            f"{cusp.mode} has 4 cusps at time 5e-06" in note
            and f"normal {cusp.normal:.4f} deg at" in note
            for note in notes
        )
    assert "cusp" not in done.stdout


def test_a_name_that_does_not_tell_the_motion_everywhere_is_reported() -> None:
    notes = call("waves", "speeds", *UNSYMMETRIC).stderr.splitlines()
    assert len(notes) == 4
    assert all(" another component dominates the front named " in note for note in notes)


# Files ------------------------------------------------------------------------------------------


def test_a_table_goes_to_a_file_whole(tmp_path: Path) -> None:
    path = tmp_path / "speeds.csv"
    done = call("waves", "speeds", LONG, "-o", path)
    assert (done.exit_code, done.stdout) == (0, "")
    assert done.stderr == f"fecm: note: wrote {path}\n"
    assert path.read_text() == call("waves", "speeds", LONG).stdout
    assert_unusable(call("waves", "speeds", LONG, "-o", path))
    assert call("waves", "speeds", LONG, "-o", path, "--overwrite").exit_code == 0
    assert [one.name for one in tmp_path.iterdir()] == ["speeds.csv"]


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(("dispersion", "--wavelengths", "1:10:5"), marks=pytest.mark.long),
        ("speeds", "--step", "45"),
        pytest.param(("fronts", "--step", "45", "--time", "2e-6"), marks=pytest.mark.long),
    ],
)
def test_a_picture_is_drawn_beside_the_table(command: tuple[str, ...], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "waves.png"
    done = call("waves", *command, LONG, "--plot", path)
    assert done.stdout == call("waves", *command, LONG).stdout
    assert f"fecm: note: drew {path}" in done.stderr.splitlines()
    assert path.read_bytes().startswith(b"\x89PNG")


# Pictures ---------------------------------------------------------------------------------------


def drawn(axes: Any) -> list[Any]:
    """Data of an axes' lines, (2, n) each."""
    return [np.array(line.get_data()) for line in axes.get_lines()]


def test_the_picture_of_dispersion_shows_scaled_velocities_and_frequencies() -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.studies import dispersion_picture

    medium = Medium(report_plate())
    curves = [dispersion(medium, angle, np.linspace(0.5, 20.0, 40)) for angle in (0.0, 90.0)]
    velocity, frequency = dispersion_picture(medium, curves).figure.axes
    unit = (0.8e6 / 0.000148) ** 0.5
    for axes, factor, name in (
        (velocity, 1.0 / unit, "phase_velocity"),
        (frequency, 0.106 / unit, "angular_frequency"),
    ):
        actual = drawn(axes)
        assert len(actual) == 2 * 5
        for n, (x, y) in enumerate(actual):
            np.testing.assert_allclose(x, curves[n // 5].wavelength)
            expected = factor * getattr(curves[n // 5], name)[:, n % 5]
            np.testing.assert_allclose(y, expected, rtol=1e-9)
    with pytest.raises(PlotError, match=r"8 directions .* at most 7"):
        dispersion_picture(medium, curves * 4)


def test_the_picture_of_speeds_is_polar_and_in_the_decks_units() -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.studies import speeds_picture

    surfaces = WaveSurfaces(Medium(report_plate()))
    units = {"length": "in", "force": "lbf", "time": "s"}
    in_plane, flexural = speeds_picture(surfaces, units).figure.axes
    assert in_plane.get_title() == "In-plane fronts: normal velocity (10³ in/s)"
    curves = drawn(in_plane) + drawn(flexural)
    assert (len(drawn(in_plane)), len(curves)) == (2, 5)
    for place, (angle, speed) in enumerate(curves):
        expected = surfaces.fronts(np.rad2deg(angle)).velocity[:, place]
        np.testing.assert_allclose(speed, expected, rtol=1e-9)


def test_the_picture_of_fronts_shows_circle_rays_fronts_and_cusps() -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.studies import fronts_picture

    surfaces = WaveSurfaces(Medium(report_plate()))
    times = (2e-6, 1e-5)
    figure = fronts_picture(surfaces, times, 0.106, {}).figure
    for place, mode in enumerate(FRONTS):
        axes = figure.axes[place]
        assert axes.get_title() == mode.replace("in_plane", "in-plane").replace("_", " ")
        circle, *rest = drawn(axes)
        np.testing.assert_allclose(np.hypot(*circle), 0.106)
        rays, fronts, dots = rest[:8], rest[8:10], rest[10]
        for number, ray in enumerate(rays):
            end = surfaces.fronts(45.0 * number).positions(times[-1], 0.106)[0, place]
            np.testing.assert_allclose(ray[:, 1], end, atol=1e-12)
        for time, front in zip(times, fronts, strict=True):
            at = surfaces.fronts(np.arange(1441) / 4.0).positions(time, 0.106)[:, place]
            np.testing.assert_allclose(front.T, at, atol=1e-12)
        assert dots.shape == (2, 8 if mode in ("in_plane_shear", "twisting") else 0)


# Wrong input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("dispersion",), "give a DECK, or --layup"),
        (("speeds", "--material", "report"), "give a DECK, or --layup"),
        (("speeds", LONG, "--layup", "0"), "--layup describes a laminate"),
        (("speeds", LONG, "--ply-thickness", "1"), "--ply-thickness describes a laminate"),
        (("speeds", "--layup", "0"), "give either --ply or --material"),
        (("speeds", "--layup", "0", "--material", "report"), "--ply-thickness is missing"),
        (("speeds", "--layup", "0", "--ply-thickness", "-1"), "-1.0 is not in the range x>0"),
        (("speeds", *LAYUP), "give either --ply or --material"),
        (("speeds", *LAYUP, "--ply", "1,2"), "is not of the form RHO,NU12,E1"),
        (("speeds", *LAYUP, "--ply", "1,.3,1,1,-1,1,1"), "shear modulus G12 is -1"),
        (("speeds", *LAYUP, "--ply", "1,.3,1e300,1,1,1,1"), "too far apart"),
        (("dispersion", *LAYUP, "--ply", "1,.3,1e300,1,1,1,1"), "too far apart"),
        (("speeds", *LAMINATE, "--units", "furlong"), "'furlong' is not a system of units"),
        (("speeds", "--layup", "[0/", "--ply-thickness", "1"), "can't be read at its end"),
        (("dispersion", LONG, "--wavelengths", "1:2"), "FROM:TO:N"),
        (("dispersion", LONG, "--wavelengths", "2:1:5"), "FROM:TO:N"),
        (("dispersion", LONG, "--wavelengths", "0:1:5"), "FROM:TO:N"),
        (("dispersion", LONG, "--wavelengths", "1:2:2.5"), "FROM:TO:N"),
        (("dispersion", LONG, "--wavelengths", "1:inf:5"), "FROM:TO:N"),
        (("dispersion", LONG, "--wavelengths", "1:2:1"), "FROM = TO is required for N = 1"),
        (("dispersion", LONG, "--wavelengths", "1:2:99999999"), "at most 200000 wavelengths"),
        (("dispersion", LONG, "--wavelengths", "1e-99:1:5"), "between 1e-9 and 1e9"),
        (("dispersion", LONG, "--angle", "north"), "'north' is not a valid number"),
        (("dispersion", LONG, "--angle", "0", "nan"), "'nan' is not a finite number"),
        (("speeds", LONG, "--step", "0"), "'--step': 0.0 is not in the range x>0"),
        (("speeds", LONG, "--step", "1e-9"), "at most 1000000 are allowed"),
        (("speeds", LONG, "--shear-factor", "-1"), "'--shear-factor': -1.0 is not in"),
        (("fronts", LONG, "--time", "-1e-6"), "-1e-06 is not in the range x>=0"),
        (("fronts", LONG, "--time", "1e308"), "overflow"),
        (("fronts", LONG, "--time", "1", "--radius", "x"), "'--radius': 'x' is not a valid number"),
        (("speeds", LONG, "--plot", "x.jpg"), "written as .png, .svg, .pdf"),
        (("speeds", LONG, "--plot", "x.png", "-o", "x.png"), "the name of two outputs"),
        (("speeds", LONG, "-o", "no/such/folder.csv"), "there is no folder"),
        (("fronts", LONG, *("--time", "1e-6,2e-6,3e-6,4e-6,5e-6,6e-6,7e-6,8e-6"),
          "--plot", "x.png"), "at most 7 can"),
    ],
)  # fmt: skip
def test_wrong_input_ends_in_one_line(
    arguments: tuple[object, ...],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    done = call("waves", *arguments)
    assert_unusable(done)
    assert words in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_deck_with_errors_is_told_and_refused(tmp_path: Path) -> None:
    deck = tmp_path / "wrong.inp"
    deck.write_text(small(data=DATA_CARDS.replace("17500000.", "-7500000.")))
    done = call("waves", "speeds", deck)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "error[E403]" in done.stderr
    assert done.stderr.endswith("fecm: error: the deck has 1 error; no waves were computed\n")


def test_of_a_deck_with_several_problems_the_first_is_taken(tmp_path: Path) -> None:
    deck = tmp_path / "two.inp"
    thick = DATA_CARDS.replace(".106", ".212").replace("0.053", "0.106")
    deck.write_text(small(stop=False) + small(data=thick))
    done = call("waves", "fronts", deck, "--time", "0")
    assert float(rows(done)[0]["x"]) == pytest.approx(0.106)
    assert "has 2 problems; the laminate of the first is used" in done.stderr


def test_options_make_the_laminate_of_their_plies() -> None:
    ply = fecm.Ply(1.5, 0.3, 20, 1.5, 0.9, 0.8, 0.5)
    waves = fecm.waves(fecm.Laminate("0/30/70", ply, 0.1), units="m-N-s")
    built, names = waves.medium.laminate, waves.units
    assert names == {"length": "m", "force": "N", "time": "s"}
    assert built.thickness == pytest.approx(0.3)
    assert built.is_coupled
    assert built.shear[0, 0] == pytest.approx(
        general_plate().shear[0, 0]
        + 0.05 * (0.8 * 0.75 + 0.5 * 0.25)
        - 0.05 * (0.8 * np.cos(np.deg2rad(70)) ** 2 + 0.5 * np.sin(np.deg2rad(70)) ** 2)
    )
