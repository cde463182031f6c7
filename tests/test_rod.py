"""The free rod under a pulse: against d'Alembert's waves, and as its user sees it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm import Rod
from fecm.mechanics.projectile import AVERAGE, CONSISTENT, report_rod
from fecm.studies.rod_test.filters import Filter
from fecm.studies.rod_test.pulse_test import (
    Pulse,
    RodHistory,
    default_time_step,
    force_row,
    gauss_pulse,
    pulse_of,
    simulate_pulse,
    sine_pulse,
    table_pulse,
)
from tests.builders import table
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, small

Floats = NDArray[np.float64]

GAUSS = gauss_pulse(1000.0, 200e-6, 40e-6)
SINE = sine_pulse(1000.0, 400e-6)
STEEL = 7.33e-4
SHAPE = ("--length", 1, "--modulus", 30e6, "--density", STEEL, "--diameter", 0.625)
PUSH = ("--pulse", "gauss:1000,200e-6,40e-6", "--dt", 2e-7)


def rod(density: float = STEEL, elements: int = 20) -> Rod:
    """The report's free rod."""
    return Rod(1.0, (0.625,) * elements, 30e6, density)


def waves(pulse: Pulse, time: Floats, x: float, density: float = STEEL) -> Floats:
    """Force at x in the rod by d'Alembert: both ends turn compression into tension."""
    through = np.sqrt(density / 30e6)
    actual = np.zeros_like(time)
    for turn in range(int(time[-1] / through / 2) + 2):
        for sign, path in ((1.0, 2 * turn + x), (-1.0, 2 * turn + 2 - x)):
            late = time - path * through
            actual += sign * np.where(late >= 0.0, pulse.force(late), 0.0)
    return actual


# Mechanics ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("density", [7.33e-4, 6.875e-4])
def test_equation_4_5_gives_the_exact_force_at_the_middle(density: float) -> None:
    rows = table("rod_midforce_gauss_eq4-5.csv")
    exact = np.array([float(row[f"Fmid_lb_rho{density * 1e4:g}e-4"]) for row in rows])
    pulse = simulate_pulse(rod(density), GAUSS, 2e-7, 600e-6, (0.5,))
    assert pulse.time[::10] == pytest.approx(np.array([float(row["t_s"]) for row in rows]))
    assert pulse.applied[::10] == pytest.approx(np.array([float(row["F_lb"]) for row in rows]))
    force = pulse.forces[:, 0]
    assert force.max() == pytest.approx(501.1, abs=0.5)
    # The pulse starts with a jump of 1.93 lb, which no mesh of 20 elements follows.
    assert np.sqrt(np.mean((force[::10] - exact) ** 2)) < 1.0


def test_the_light_rod_needs_half_the_time_step() -> None:
    rows = table("rod_midforce_gauss_eq4-5.csv")
    exact = np.array([float(row["Fmid_lb_rho3.225e-4"]) for row in rows])
    errors = []
    for dt, every in ((2e-7, 10), (1e-7, 20)):
        force = simulate_pulse(rod(3.225e-4), GAUSS, dt, 600e-6, (0.5,)).forces[:, 0]
        assert force.max() == pytest.approx(501.1, abs=0.5)
        errors.append(float(np.sqrt(np.mean((force[::every] - exact) ** 2))))
    assert errors[0] == pytest.approx(1.26, abs=0.01)
    assert errors[1] < 1.0


def test_the_mean_ratio_is_the_reports() -> None:
    for pulse in (GAUSS, SINE):
        pulse_result = simulate_pulse(rod(), pulse, 2e-7, pulse.duration, (0.5,))
        assert pulse_result.mean_ratios[0] == pytest.approx(0.498, abs=5e-4)


def test_a_sine_pulse_runs_as_its_waves_do_and_is_over_after_b() -> None:
    places = (0.25, 0.5, 0.731)
    pulse = simulate_pulse(rod(elements=40), SINE, 5e-8, 600e-6, places, AVERAGE)
    for force, x in zip(pulse.forces.T, places, strict=True):
        assert np.abs(force - waves(SINE, pulse.time, x)).max() < 3.0  # of 1000
    assert (pulse.applied[pulse.time > 400e-6] == 0.0).all()


def test_force_at_the_ends_is_the_applied_one_and_none_with_the_consistent_mass() -> None:
    pulse = simulate_pulse(rod().with_mass(CONSISTENT), SINE, 2e-7, 600e-6, (0.0, 1.0))
    assert np.abs(pulse.forces[:, 0] - pulse.applied).max() < 2.0
    assert np.abs(pulse.forces[:, 1]).max() < 2.0


def test_the_whole_rod_gets_the_pulses_impulse_at_every_point() -> None:
    pulse = simulate_pulse(rod(), GAUSS, 2e-7, 600e-6, ())
    impulse = pulse.applied.sum() * 2e-7
    gained = pulse.accelerations.sum(axis=0) * 2e-7 * rod().total_mass
    assert gained == pytest.approx([impulse] * 3, rel=1e-3)
    # Section 4.2: virtually no difference between the accelerations.
    late = pulse.time > 50e-6
    assert np.ptp(pulse.accelerations[late], axis=1).max() < 0.02 * pulse.accelerations.max()


def test_a_rod_of_odd_elements_has_its_middle_inside_one() -> None:
    odd, even = (simulate_pulse(rod(elements=n), GAUSS, 1e-7, 600e-6, (0.5,)) for n in (21, 40))
    assert np.abs(odd.forces - even.forces).max() < 3.0
    middle = [history.accelerations[:, 1] for history in (odd, even)]
    late = odd.time > 50e-6
    assert np.abs(middle[0] - middle[1])[late].max() < 0.01 * middle[1].max()


def test_a_station_on_a_node_of_a_stepped_rod_takes_the_section_behind_it() -> None:
    # As the transducer of an impact does; in front of node 6 the cap ends, 0.50 in wide.
    for node, diameter in ((11, 0.625), (6, 0.625), (5, 0.50), (21, 0.625)):
        row = force_row(report_rod(), 0.05 * (node - 1))
        expected = np.zeros(42)
        expected[2 * node - 1] = -30e6 * np.pi * diameter**2 / 4
        np.testing.assert_allclose(row, expected, rtol=1e-12, atol=1e-3)


def test_a_pulse_by_its_table_is_the_pulse() -> None:
    time = np.arange(0.0, 600.1e-6, 2e-7)
    tabulated, exact = (
        simulate_pulse(rod(), pulse, 2e-7, 600e-6, (0.5,)).forces
        for pulse in (table_pulse(time, GAUSS.force(time)), GAUSS)
    )
    np.testing.assert_allclose(tabulated, exact, rtol=0, atol=1e-6)


def test_a_table_is_linear_between_its_rows_and_zero_outside() -> None:
    pulse = table_pulse(np.array([1.0, 2.0, 4.0]), np.array([3.0, 5.0, 1.0]))
    times = np.array([0.5, 1.0, 1.5, 3.0, 4.0, 4.1])
    assert pulse.force(times).tolist() == [0.0, 3.0, 4.0, 3.0, 1.0, 0.0]


def test_equation_4_5_at_its_width_has_fallen_by_a_quarter_of_an_exponent() -> None:
    assert GAUSS.force(np.array([240e-6])) == pytest.approx(1000 * np.exp(-0.25))


def test_the_default_time_step_is_most_of_a_waves_time_through_an_element() -> None:
    assert default_time_step(rod()) == pytest.approx(0.8 * 0.05 * np.sqrt(STEEL / 30e6), rel=0.05)


def test_the_ratio_is_none_where_no_force_is_applied() -> None:
    history = RodHistory(
        np.arange(3.0),
        np.array([0.0, 2.0, 4.0]),
        (0.5,),
        np.array([[1.0], [1.0], [3.0]]),
        np.zeros((3, 3)),
    )
    assert np.isnan(history.ratios[0, 0])
    assert history.ratios[1:, 0].tolist() == [0.5, 0.75]
    assert history.mean_ratios.tolist() == [0.625]


# Command -----------------------------------------------------------------------------------------


def columns(text: str) -> dict[str, Floats]:
    """A CSV's columns by name."""
    head, *rows = text.splitlines()
    values = np.array([list(map(float, row.split(","))) for row in rows])
    return dict(zip(head.split(","), values.T, strict=True))


def test_the_command_prints_what_the_rod_does() -> None:
    done = call("rod", *SHAPE, *PUSH, "--station", 0.5, "--station", 0.25)
    assert done.exit_code == 0
    assert done.stderr == ""
    actual, expected = columns(done.stdout), simulate_pulse(rod(), GAUSS, 2e-7, 600e-6, (0.5, 0.25))
    assert list(actual) == [
        "time",
        "force",
        "force_at_0.5",
        "force_at_0.25",
        "ratio_at_0.5",
        "ratio_at_0.25",
        "acceleration_struck_end",
        "acceleration_middle",
        "acceleration_far_end",
    ]
    np.testing.assert_array_equal(actual["force_at_0.25"], expected.forces[:, 1])
    np.testing.assert_array_equal(actual["acceleration_far_end"], expected.accelerations[:, 2])
    np.testing.assert_array_equal(actual["ratio_at_0.5"], expected.forces[:, 0] / actual["force"])
    assert call("rod", "pulse", *SHAPE, *PUSH).stdout.startswith("time,force,force_at_0.5,ratio")
    named = call("rod", "pulse", *SHAPE, *PUSH, "--units", "in-lbf-s").stdout.splitlines()[0]
    assert named == (
        "time (s),force (lbf),force_at_0.5 (lbf),ratio_at_0.5,acceleration_struck_end (in/s^2),"
        "acceleration_middle (in/s^2),acceleration_far_end (in/s^2)"
    )


def test_a_file_gets_the_numbers_and_the_user_a_summary(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    done = call("rod", *SHAPE, *PUSH, "--filter", "first-order:10e-6", "-o", out)
    assert "force at 0.5      peak 501.035 at time 0.0002028; mean ratio to the applied 0.498" in (
        done.stdout
    )
    read_columns = columns(out.read_text())
    slow = Filter("first-order", 10e-6)(read_columns["time"], read_columns["force_at_0.5"])
    np.testing.assert_array_equal(read_columns["filtered_at_0.5"], slow)
    assert_unusable(call("rod", *SHAPE, *PUSH, "-o", out))
    assert list(tmp_path.iterdir()) == [out]


def test_a_deck_gives_its_rod_and_its_time_step(tmp_path: Path) -> None:
    deck = tmp_path / "small.inp"
    deck.write_text(small())
    done = call("rod", deck, "--pulse", "sine:1000,400e-6")
    actual, expected = (
        columns(done.stdout),
        simulate_pulse(report_rod(), SINE, 5e-7, 600e-6, (0.5,)),
    )
    np.testing.assert_array_equal(actual["time"], expected.time)
    np.testing.assert_array_equal(actual["force_at_0.5"], expected.forces[:, 0])
    twice = call("rod", deck, "--pulse", "sine:1000,400e-6", "--length", 2)
    assert twice.exit_code == 2
    assert "--length is for a rod without a deck" in twice.stderr


def test_mass_and_integrator_are_the_users_choice() -> None:
    options = ("--mass-matrix", CONSISTENT, "--integrator", AVERAGE)
    read_columns = columns(call("rod", *SHAPE, *PUSH, *options).stdout)
    expected = simulate_pulse(rod().with_mass(CONSISTENT), GAUSS, 2e-7, 600e-6, (0.5,), AVERAGE)
    np.testing.assert_array_equal(read_columns["force_at_0.5"], expected.forces[:, 0])


def test_a_table_in_a_file_is_a_pulse(tmp_path: Path) -> None:
    file = tmp_path / "pulse.csv"
    text = "# measured\nForce [lb], Time (s)\r\n0,0\r\n\n100,1e-4\n0,2e-4\n"
    file.write_text(text)
    options = ("rod", *SHAPE, "--dt", 1e-6, "--pulse", file)
    done = call(*options)
    assert_unusable(done)
    assert "time is in s, and the units of the model are not known" in done.stderr
    file.write_text(text.replace(" [lb]", "").replace(" (s)", ""))
    read_columns = columns(call(*options).stdout)
    assert read_columns["time"][-1] == pytest.approx(2e-4)
    assert read_columns["force"][50] == pytest.approx(50.0)
    assert read_columns["force"][150] == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--pulse", "gauss:1,2"), "gauss takes 3 numbers, gauss:F0,TAU,B"),
        (("--pulse", "gauss:1,2,0"), "the width B must be positive"),
        (("--pulse", "sine:1,nan"), "sine takes 2 numbers"),
        (("--pulse", "box:1,2"), "neither a file nor a pulse"),
        ((*PUSH, "--station", 1.5), "not on the rod of length 1"),
        ((*PUSH, "--filter", "slow:1"), "unknown filter slow:1"),
        ((*PUSH, "--duration", 1e3), "more than 2,000,000 steps"),
        ((*PUSH, "--plot", "out.bmp"), "written as .png, .svg, .pdf"),
        ((*PUSH, "-o", "no-such-folder/out.csv"), "there is no folder"),
        (("--pulse", "sine:1e308,1", "--dt", 0.1), "the motion is not finite"),
    ],
)
def test_what_can_not_be_is_refused_in_one_line(options: tuple[Any, ...], told: str) -> None:
    done = call("rod", *SHAPE, *options)
    assert_unusable(done)
    assert told in done.stderr


@pytest.mark.parametrize("option", ["--length", "--modulus", "--density", "--diameter", "--dt"])
@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf"])
def test_a_measure_that_is_not_positive_is_refused_by_name(option: str, value: str) -> None:
    done = call("rod", *SHAPE, *PUSH, option, value)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert re.search(f"'{option}': '?{value}(.0)?'? is not ", done.stderr)


def test_a_rod_that_is_not_whole_is_refused_with_what_it_lacks() -> None:
    done = call("rod", "--length", 1, "--density", 1, *PUSH)
    assert done.exit_code == 2
    assert "the rod lacks --modulus, --diameter" in done.stderr


@pytest.mark.parametrize("text", ["-1e-4,0\n-5e-5,1\n", "0,1\n"])
def test_a_table_without_a_future_is_no_pulse(tmp_path: Path, text: str) -> None:
    file = tmp_path / "pulse.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"ends before time 0|fewer than two rows"):
        pulse_of(str(file))


# Filtered histories ------------------------------------------------------------------------------


@pytest.fixture
def result(runs: Path, tmp_path: Path) -> Path:
    """A copy of the small plate's result file."""
    return Path(shutil.copy(runs / "small.h5", tmp_path))


def test_a_results_transducer_is_filtered_from_rest_on(result: Path) -> None:
    read_columns = columns(call("rod", "filter", result, "--filter", "moving-average:1e-6").stdout)
    loaded = fecm.load(result)
    assert list(read_columns) == ["time", "transducer", "filtered"]
    np.testing.assert_array_equal(read_columns["time"], loaded.time)
    np.testing.assert_array_equal(read_columns["transducer"], loaded.transducer)
    # A moving average rises from 10 to 90 % in 0.8 of its window.
    window = 1e-6 / 0.8
    time, force = (np.concatenate(([0.0], a)) for a in (loaded.time, loaded.transducer))
    before = np.linspace(-window, 0.0, 20_001)
    expected = [np.interp(before + t, time, force, left=0.0) for t in loaded.time]
    np.testing.assert_allclose(
        read_columns["filtered"],
        [(part[0] / 2.0 + part[1:-1].sum() + part[-1] / 2.0) / 20_000 for part in expected],
        atol=1e-6 * force.max(),
    )


def test_a_table_is_filtered_by_the_column_that_is_named(tmp_path: Path) -> None:
    file = tmp_path / "scope.csv"
    file.write_text("t,a (mV),b (mV)\n0,0,5\n1,1,5\n2,2,5\n")
    options = ("rod", "filter", file, "--filter", "first-order:1")
    assert call(*options).stdout.startswith("time,a,filtered\n")
    read_columns = columns(call(*options, "--column", "b").stdout)
    assert read_columns["filtered"] == pytest.approx([5.0, 5.0, 5.0])
    done = call(*options, "--column", "c")
    assert_unusable(done)
    assert "has no column c; it has t, a, b" in done.stderr


def test_a_filter_never_replaces_what_it_reads(result: Path) -> None:
    before = result.read_bytes()
    options = ("--filter", "first-order:1e-6", "-o", result, "--overwrite")
    assert_unusable(call("rod", "filter", result, *options))
    assert result.read_bytes() == before


# Pictures ----------------------------------------------------------------------------------------


def test_pictures_are_drawn_beside_the_numbers(tmp_path: Path, result: Path) -> None:
    pytest.importorskip("matplotlib")
    test = tmp_path / "test.csv"
    test.write_text("time,V_F,V_a\n0,0,0\n1,1,2.1\n2,2,4.1\n3,1,2\n")
    commands = (
        ("pulse", *SHAPE, *PUSH, "--filter", "first-order:1e-5"),
        ("filter", result, "--filter", "first-order:1e-6"),
        ("calibrate", test, "--mass", 1, "--c-a", 1),
    )
    for command, suffix in zip(commands, (".png", ".svg", ".png"), strict=True):
        picture = tmp_path / f"{command[0]}{suffix}"
        done = call("rod", *command, "--plot", picture)
        assert done.exit_code == 0
        assert picture.stat().st_size > 5000
        assert done.stderr == f"fecm: note: drew {picture}\n"
    assert call("rod", *commands[0], "--plot", tmp_path / "pulse.png").exit_code == 2


def test_the_picture_of_a_pulse_shows_its_forces_and_accelerations() -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.studies import pulse_picture

    history = simulate_pulse(rod(), GAUSS, 2e-7, 600e-6, (0.5,))
    units = {"length": "in", "force": "lbf", "time": "s"}
    above, below = pulse_picture(history, None, units).figure.axes
    assert (above.get_ylabel(), below.get_xlabel()) == ("Force (lbf)", "Time (µs)")
    assert below.get_ylabel() == "Acceleration (10⁶ in/s²)"
    time, force = map(np.asarray, above.get_lines()[1].get_data())
    np.testing.assert_allclose(time, history.time)
    np.testing.assert_allclose(force, history.forces[:, 0])


def test_units_of_a_rod_without_a_deck_are_on_its_picture_and_refused_beside_a_deck(
    tmp_path: Path,
) -> None:
    pytest.importorskip("matplotlib")
    shape = ("--length", "1", "--modulus", "30e6", "--density", "7.33e-4", "--diameter", ".625")
    pulse, units = ("rod", "--pulse", "sine:1000,1e-4"), ("--units", "in-lbf-s")
    picture = tmp_path / "p.svg"
    done = call(*pulse, *shape, *units, "--plot", picture, "-o", tmp_path / "p.csv")
    assert done.exit_code == 0
    text = picture.read_text()
    assert all(f"<!-- {label} -->" in text for label in ("Force (lbf)", "Time (µs)", "at 0.5 in"))
    deck = tmp_path / "deck.inp"
    deck.write_text(small())
    refused = call(*pulse, deck, *units)
    assert refused.exit_code == 2
    assert "--units is for a rod without a deck" in refused.stderr


def test_a_decks_own_rod_is_measured_at_its_own_transducer_and_a_rigid_mass_refused(
    tmp_path: Path,
) -> None:
    cards = "PROJ\n4, 2, 2.0, 30.E6, .0006875\n1, 1, 0.5\n4, 0, 0.5\n\n"
    deck = tmp_path / "own.inp"
    deck.write_text(small(data=cards + DATA_CARDS))
    pulse = ["--pulse", "sine:1000,1e-4"]
    answer = call("rod", str(deck), *pulse)
    named = call("rod", str(deck), *pulse, "--station", "0.5")
    assert answer.exit_code == 0
    assert answer.stdout == named.stdout
    deck.write_text(small(data="PROJ\n0, 0, 1.E-4\n" + DATA_CARDS))
    rigid = call("rod", str(deck), *pulse)
    assert rigid.exit_code == 2
    assert "rigid mass" in rigid.stderr
