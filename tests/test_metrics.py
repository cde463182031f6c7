"""Impact metrics: one definition for runs, files and sweeps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.plot.kinds import PlotError
from fecm.plot.pictures import draw
from fecm.results.metrics import METRICS, RATIO, SUMMARY, THRESHOLD, VERDICTS
from fecm.results.summary import run_summary
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, small

MASS, SPEED = 2e-4, 115.0
RIGID = f"PROJ\n0,0,{MASS}\n"


def deck(segments: str = RIGID, *, steps: int = 330) -> str:
    """A small plate under a rigid mass, which has left it after 330 steps."""
    data = DATA_CARDS.replace("EXPE", f"{segments}EXPE")
    return small(PROGRAM.replace(" 10\n", f"{steps:3}\n"), data=data)


def test_a_rigid_mass_rebounds_with_the_impulse_and_its_energy_is_absorbed() -> None:
    result = fecm.run_one(deck())
    metrics = result.metrics
    assert metrics["rebound_velocity"] == pytest.approx(result.velocity[-1], rel=1e-9)
    assert metrics["impulse"] == pytest.approx(MASS * (SPEED + result.velocity[-1]), rel=1e-9)
    absorbed = 0.5 * MASS * (SPEED**2 - result.velocity[-1] ** 2)
    assert metrics["energy_absorbed"] == pytest.approx(absorbed, rel=1e-9)
    assert metrics["max_deflection"] == result.plate_w.max()
    assert metrics["peak_force"] == result.force.max()


def test_the_area_of_the_force_displacement_curve_is_the_absorbed_energy() -> None:
    pytest.importorskip("matplotlib")
    result = fecm.run_one(deck())

    def curve(against: Any) -> tuple[Any, Any]:
        line: Any = draw("loop", {"a": result}, against=against).figure.axes[0].get_lines()[0]
        return line.get_xdata(), line.get_ydata()

    x, force = curve("displacement")
    area = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x))
    assert area == pytest.approx(result.metrics["energy_absorbed"], rel=1e-9)
    difference = x - curve("deflection")[0]
    np.testing.assert_allclose(difference[1:], result.indentation, rtol=0.0, atol=1e-15)
    with pytest.raises(PlotError, match="indentation, deflection, displacement"):
        curve("time")


def test_run_info_and_sweep_have_the_same_metrics(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck(f"{RIGID}DELA\n.001,\n"))
    done = call("run", "d.inp", "--format", "json", cwd=tmp_path)
    assert done.exit_code == 0
    said = json.loads(done.stdout)
    assert (said["result"], said["still_in_contact"]) == ("d.h5", False)
    document = json.loads(call("info", "d.h5", "--format", "json", cwd=tmp_path).stdout)
    assert said["metrics"] == document["metrics"]
    assert list(said["metrics"]) == list(METRICS)
    swept = fecm.sweep(tmp_path / "d.inp", {"velocity": [SPEED]})
    for name in (*SUMMARY, *THRESHOLD):
        assert swept[name][0] == pytest.approx(said["metrics"][name], rel=1e-9)


def test_metrics_of_the_threshold_are_those_of_its_group(tmp_path: Path) -> None:
    result = fecm.run_one(deck(f"{RIGID}DELA\n.001,\n"))
    metrics = result.metrics
    for name in ("force", "time", "margin"):
        assert metrics[f"threshold_{name}"] == pytest.approx(result.threshold[name], rel=1e-12)
    above = result.force >= result.threshold["force"]
    assert metrics["time_above"] == pytest.approx(0.5e-6 * np.count_nonzero(above), rel=1e-9)
    assert metrics["threshold_margin"] == pytest.approx(
        1.0 - result.force.max() / result.threshold["force"], rel=1e-12
    )
    missed = fecm.run_one(deck(f"{RIGID}DELA\n10.,\n"))
    below = missed.metrics
    assert np.isnan(below["threshold_time"])
    assert below["time_above"] == 0.0
    assert 0.0 < below["threshold_margin"] < 1.0
    share = f"{1.0 - missed.force.max() / missed.threshold['force']:.1%}"
    assert f"not reached: the peak is {share} below" in "\n".join(run_summary(missed))


def test_a_contact_that_lasts_to_the_end_has_no_rebound(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck(steps=20))
    done = call("run", "d.inp", "--format", "json", cwd=tmp_path)
    metrics = json.loads(done.stdout)["metrics"]
    assert metrics["rebound_velocity"] == metrics["impulse"] == metrics["contact_time"] == "NaN"
    assert "rebound" not in call("info", "d.h5", cwd=tmp_path).stdout


def test_a_sweep_has_columns_of_the_threshold_with_dela_only(tmp_path: Path) -> None:
    with_it = deck(f"{RIGID}DELA\n.001,\n")
    for text, names in ((deck(), ()), (with_it, tuple(THRESHOLD))):
        path = tmp_path / f"{len(names)}.h5"
        swept = fecm.sweep(text, {"k": [2e6, -1.0]}, output=path)
        assert tuple(swept.summary) == (*SUMMARY, *names, RATIO, *VERDICTS)
        loaded = fecm.load_sweep(path)
        for name in names:
            assert np.isfinite(loaded[name][0])
            assert np.isnan(loaded[name][1])
    failed = fecm.sweep(with_it, {"k": [-1.0]})
    assert np.isnan(failed["threshold_margin"]).all()
