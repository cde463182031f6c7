"""The transducer's sensitivity: recovered from made tests, with an error that means something."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fecm.studies.rod_test.pulse_test import calibrate_transducer
from tests.calls import assert_unusable, call

Floats = NDArray[np.float64]

# The report's target of 1.105 lb, and the sensitivity found for it (mV/lb).
MASS, C_A, C_F = 1.105 / 386.09, 10.0 / 386.09, 0.494


def outputs(noise: float = 0.0, offset: float = 0.0, seed: int = 0) -> tuple[Floats, Floats]:
    """V_F and V_a under a pulse of 1000 lb, V_F with noise in parts of its peak."""
    time = np.linspace(0.0, 400e-6, 101)
    force = 1000.0 * np.exp(-(((time - 200e-6) / 80e-6) ** 2))
    scatter = noise * C_F * 1000.0 * np.random.default_rng(seed).normal(size=len(time))
    return C_F * force + offset + scatter, C_A * force / MASS


def test_a_clean_test_gives_the_sensitivity_it_was_made_with() -> None:
    calibration = calibrate_transducer(*outputs(offset=3.0), MASS, C_A)
    assert calibration.sensitivity == pytest.approx(C_F, rel=1e-12)
    assert calibration.offset == pytest.approx(3.0, rel=1e-10)
    assert calibration.r_squared == pytest.approx(1.0, abs=1e-12)
    assert calibration.sensitivity_error < 1e-10


@pytest.mark.parametrize("through_origin", [False, True])
def test_noise_leaves_the_truth_inside_the_standard_error_as_often_as_it_should(
    through_origin: bool,
) -> None:
    missed = []
    for seed in range(400):
        v_f, v_a = outputs(0.01, seed=seed)
        calibration = calibrate_transducer(v_f, v_a, MASS, C_A, through_origin=through_origin)
        missed.append(abs(calibration.sensitivity - C_F) / calibration.sensitivity_error)
    # 68.3 % of a normal variable lie inside one standard error, 95.4 % inside two.
    assert np.mean(np.array(missed) < 1.0) == pytest.approx(0.683, abs=0.06)
    assert np.mean(np.array(missed) < 2.0) == pytest.approx(0.954, abs=0.03)


def test_the_error_is_that_of_the_textbooks_example() -> None:
    # By hand: x = 0, 1, 2, 3 and y = 0, 1, 1, 2 give 0.6 x + 0.1 with residuals -.1, .3, -.3, .1.
    calibration = calibrate_transducer(np.array([0.0, 1, 1, 2]), np.array([0.0, 1, 2, 3]), 1.0, 1.0)
    assert calibration.slope == pytest.approx(0.6)
    assert calibration.offset == pytest.approx(0.1)
    assert calibration.slope_error == pytest.approx(np.sqrt(0.2 / 2 / 5))
    assert calibration.offset_error == pytest.approx(np.sqrt(0.1 * (1 / 4 + 1.5**2 / 5)))
    assert calibration.r_squared == pytest.approx(1.0 - 0.2 / 2.0)


def test_the_command_prints_the_sensitivity_for_persons_and_for_programs(tmp_path: Path) -> None:
    v_f, v_a = outputs(0.01)
    path = tmp_path / "test.csv"
    lines = [f"{n}e-6,{a:.17g},{f:.17g}" for n, (f, a) in enumerate(zip(v_f, v_a, strict=True))]
    path.write_text("time (s),V_a (mV),V_F (mV)\n" + "\n".join(lines) + "\n")
    options = (path, "--mass", MASS, "--c-a", C_A)
    document = json.loads(call("rod", "calibrate", *options, "--format", "json").stdout)
    assert abs(document["sensitivity"] - C_F) < 3 * document["sensitivity_error"]
    text = call("rod", "calibrate", *options).stdout.splitlines()
    assert text[-1].startswith(f"sensitivity c_F   {document['sensitivity']:.6g} ± ")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time,V_F,V_a\n0,1,1\n1,2,2\n", "at least 3 points"),
        ("time,V_F,V_a\n0,1,4\n1,2,4\n2,3,4\n", "V_a is constant (4)"),
        ("time,V_F,V_a\n0,1,1\n1,x,2\n2,3,3\n", ":3: V_F is 'x'"),
        (
            "time,V_F,V_b\n0,1,1\n1,2,2\n2,3,3\n",
            "one must be named V_a; --columns of time and V_F and V_a",
        ),
        ("time,V_F,V_a\n0,1,1\n1,2\n2,3,3\n", ":3: V_a is empty"),
        ("time,V_F,V_a\n0,1,1\n1,2,2\n1,3,3\n", ":4: time must increase: 1 follows 1"),
        ("", "fewer than two rows"),
    ],
)
def test_a_table_that_can_not_be_used_is_refused_in_one_line(
    tmp_path: Path, text: str, told: str
) -> None:
    path = tmp_path / "test.csv"
    path.write_text(text)
    done = call("rod", "calibrate", path, "--mass", 1, "--c-a", 1)
    assert_unusable(done)
    assert told in done.stderr
