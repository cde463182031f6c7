"""Records that betray their instrument, and clean ones that do not."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm._record_faults import record_faults
from fecm._typing import Floats
from fecm.results.comparison import measurement_of
from tests.calls import call
from tests.decks import ROOT

PEAK = 4500.0
Record = tuple[Floats, Floats]
MILLIMETRES = {"length": "mm", "force": "N", "time": "s"}


def pulse(points: int, noise: float, shape: str = "ripple", duration: float = 9e-3) -> Record:
    """Times in s and a contact force in N: rest, an impact of 3 ms, rest."""
    time = np.linspace(0.0, duration, points)
    x = np.clip((time - 0.25 * duration) / 3e-3, 0.0, 1.0)
    force = np.sin(np.pi * x) ** (1.5 if shape == "hertz" else 1.0)
    if shape == "ripple":
        force *= 1.0 + 0.08 * np.sin(12.0 * np.pi * x)
    if shape == "flat":
        force = np.minimum(1.0, 4.0 * np.minimum(x, 1.0 - x)) * (1.0 + 0.02 * np.sin(40.0 * x))
    scatter = np.random.default_rng(1).standard_normal(points)
    return time, PEAK * (force + noise * scatter)


def rounded(force: Floats, how: str) -> Floats:
    """The record as it is exported."""
    if how == "4 digits":
        return np.array([float(f"{value:.4g}") for value in force])
    step = {"all digits": 0.0, "N": 1.0, "10 bits": 10000 / 2**10, "16 bits": 10000 / 2**16}[how]
    return np.round(force / step) * step if step else force


@pytest.mark.parametrize("how", ["all digits", "4 digits", "N", "10 bits", "16 bits"])
@pytest.mark.parametrize("shape", ["sine", "hertz", "ripple", "flat"])
def test_clean_records_have_no_faults(shape: str, how: str) -> None:
    for points in (60, 200, 600, 4000):
        for noise in (0.0, 0.002, 0.01, 0.05):
            time, force = pulse(points, noise, shape)
            assert record_faults("force", rounded(force, how), time, clock="s") == []


def without(time: Floats, force: Floats) -> Record:
    kept = np.full(len(time), True)
    kept[len(time) // 3 : len(time) // 3 + 8] = False
    return time[kept], force[kept]


def stuck(time: Floats, force: Floats) -> Record:
    row = round(0.27 * len(time))
    force[row : row + 8] = force[row]
    return time, force


FAULTS: dict[str, tuple[Callable[[Floats, Floats], Record], str]] = {
    "clipped": (lambda t, f: (t, np.minimum(f, 4000.0)), "largest value, 4000: .* is clipped"),
    "clipped low": (lambda t, f: (t, np.minimum(f, 2000.0)), "largest value, 2000: .* is clipped"),
    "clipped below": (lambda t, f: (t, np.maximum(-f, -3e3)), "smallest value, -3000: .* clipped"),
    "8 bits": (lambda t, f: (t, np.round(f / 40.0) * 40.0), "steps of 40, .*quantised"),
    "held": (lambda t, f: (t, np.repeat(f[::2], 2)), "5[0-9]% of the points .* repeat"),
    "dropped": (without, "1 gaps in the times of force, the largest of 9 steps"),
    "stuck": (stuck, "stands still for 8 points"),
    "drift": (lambda t, f: (t, f + 0.06 * PEAK * t / t[-1]), "baseline of force moves by [4-7]"),
    "part of hum": (
        lambda t, f: (t, f + 0.05 * PEAK * np.cos(100.0 * np.pi * t)),
        "baseline .* or mains hum",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_of_an_instrument_is_named_with_its_cause(name: str) -> None:
    spoil, message = FAULTS[name]
    for points in (200, 600, 4000):
        for noise in (0.002, 0.01):
            time, force = spoil(*pulse(points, noise))
            (fault,) = record_faults("force", force, time, clock="s")
            assert re.search(message, fault), fault


def test_mains_hum_is_told_with_frequency_and_amplitude_where_the_record_lasts() -> None:
    time, force = pulse(3000, 0.01, duration=60e-3)
    hum = force + 0.04 * PEAK * np.sin(120.0 * np.pi * time + 1.0)
    (fault,) = record_faults("force", hum, time, clock="s")
    amplitude = re.search(r"mains hum: 60 Hz with an amplitude of ([0-9.]+)%", fault)
    assert amplitude is not None
    assert float(amplitude[1]) == pytest.approx(4.0, abs=0.5)
    assert record_faults("force", hum, 1e3 * time, clock="ms") == [fault]


@pytest.mark.parametrize("path", sorted((ROOT / "fecm/examples").glob("measured-*.csv")))
def test_the_measurements_of_the_package_have_no_faults(path: Path) -> None:
    assert measurement_of(path, MILLIMETRES).faults == ()


def clipped_table(path: Path, head: str, *columns: Floats) -> Path:
    rows = zip(*(column.tolist() for column in columns), strict=True)
    path.write_text("\n".join([head, *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return path


def test_a_comparison_with_a_clipped_record_says_so() -> None:
    result = fecm.run_one(fecm.examples.path("impact-patch"))
    time, force = np.append(0.0, result.time), np.append(0.0, result.force)
    assert result.compare((time, force)).doubts == ()
    with pytest.warns(fecm.FecmWarning, match="the record is clipped"):
        compared = result.compare((time, np.minimum(force, 0.7 * force.max())))
    assert "the record is clipped at the range of the amplifier" in compared.doubts[0]


@pytest.mark.filterwarnings("always::fecm.FecmWarning")
def test_a_fit_to_a_clipped_indentation_test_says_so_in_text_and_json(tmp_path: Path) -> None:
    depth = np.concatenate([np.linspace(0.0, 1.0, 100), np.linspace(1.0, 0.1, 80)])
    force = np.where(
        np.arange(180) < 100, 1e3 * depth**1.5, 1e3 * np.clip((depth - 0.1) / 0.9, 0, 1) ** 2.5
    )
    for limit, is_doubted in ((2e3, False), (700.0, True)):
        path = clipped_table(
            tmp_path / "a.csv", "indentation (mm),force (N)", depth, np.minimum(force, limit)
        )
        done = call("indent", "fit", path, "--format", "json")
        notes = json.loads(done.stdout)["notes"]
        assert any("the record is clipped" in note for note in notes) == is_doubted
        assert ("the record is clipped" in done.stderr) == is_doubted


def test_a_calibration_with_a_clipped_output_says_so(tmp_path: Path) -> None:
    time, force = pulse(400, 0.002)
    for limit, is_doubted in ((np.inf, False), (3000.0, True)):
        path = clipped_table(
            tmp_path / "a.csv", "time,V_F,V_a", time, np.minimum(force, limit), 2.0 * force
        )
        done = call("rod", "calibrate", path, "--mass", 1, "--c-a", 1, "--format", "json")
        assert bool(json.loads(done.stdout)["notes"]) == is_doubted
        assert ("V_F are exactly at its largest value" in done.stderr) == is_doubted
