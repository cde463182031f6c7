"""Refinement studies: orders and limits of known sequences, and those of a plate's exact series."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm import Deck, SweepResult
from fecm.authoring.case import CasesError
from fecm.deck.model import Patch
from fecm.sweeps.convergence import Convergence, convergence
from tests.builders import REPORT_PLY, table
from tests.calls import assert_unusable, call
from tests.decks import small

Floats = NDArray[np.float64]

# Peak force of the simply supported cross-ply plate under a disc, from the exact series.
RADIUS = 0.25
(PEAK,) = (
    float(row["peak force"])
    for row in table("patch_impact_summary.csv")
    if float(row["c"]) == RADIUS
)


def plate(mass: float = 0.000181, duration: float = 3e-5) -> Deck:
    """The report's plate and rigid mass with a patch, until after its first peak."""
    return fecm.impact(
        fecm.Plate.rectangle((6.0, 4.0), (18, 12), support="simple", grading=2.0),
        fecm.Laminate("[0/90/0/90/0/90/0/90/0/90]s", REPORT_PLY, 0.0053),
        fecm.RigidMass(mass),
        fecm.Contact(1912000.0, 1.0, 0.0, 1.5),
        velocity=115.0,
        duration=duration,
        patch=Patch(radius=RADIUS),
        kinematics="linear",
        shear_factor=1.0,
    )


def found_from(values: Floats | list[float], nodes: int = 9) -> Convergence:
    """Order, limit and band of values on meshes, each twice as fine as the last."""
    factors = np.array([1, 2, 4, 8])[: len(values)]
    summary = {"peak_force": np.array(values)}
    return convergence({"refine": factors}, summary, nodes)["peak_force"]


def power_law(order: float) -> Floats:
    return 80.0 - 3.0 * (1.0 / np.array([1, 2, 4, 8])) ** order


@pytest.mark.parametrize("order", [1.6, 2.0, 3.5])
def test_a_power_law_has_its_order_and_its_limit(order: float) -> None:
    values = power_law(order)
    threshold = found_from(values)
    assert threshold.order == pytest.approx(order, rel=1e-9)
    assert threshold.limit == pytest.approx(80.0, rel=1e-12)
    assert threshold.band == pytest.approx(1.25 * (80.0 - values[-1]), rel=1e-9)
    assert not threshold.remark


@pytest.mark.parametrize(("order", "nodes"), [(1.0, 9), (5.28, 9), (3.5, 4)])
def test_an_order_that_the_scheme_does_not_have_is_not_extrapolated(
    order: float, nodes: int
) -> None:
    values = power_law(order)
    threshold = found_from(values, nodes)
    assert threshold.order == pytest.approx(order, rel=1e-9)
    assert "not yet asymptotic" in threshold.remark
    used = min(order, 4.0 if nodes == 9 else 2.0)
    rest = (values[-1] - values[-2]) / (2.0**used - 1.0)
    assert threshold.limit == pytest.approx(values[-1] + rest, rel=1e-12)
    assert threshold.band == pytest.approx(3.0 * rest, rel=1e-9)


def test_the_band_contains_the_limit_of_the_series_where_the_order_is_too_high() -> None:
    # Peak forces of the cross-ply plate with 12 x 8 elements, and Hertz's pressure on 0.25 in.
    threshold = found_from([98.01768, 92.90860, 92.77713])
    assert threshold.order > 5.0
    assert abs(92.77713 - 92.7672) < threshold.band < 0.05


@pytest.mark.parametrize(
    ("values", "limit", "remark"),
    [
        ([1.0, 2.0, 1.5], np.nan, "not monotone"),
        ([1.0, 2.0, 3.0], np.nan, "does not converge"),
        ([1.0, 2.0, 2.0], 2.0, "equal"),
        ([1.0, np.nan, 2.0], np.nan, "missing"),
        ([1.0, 4.0], 5.0, "order 2 is assumed, not observed"),
    ],
)
def test_no_order_is_stated_where_there_is_none(
    values: list[float], limit: float, remark: str
) -> None:
    threshold = found_from(values)
    np.testing.assert_equal(threshold.limit, limit)
    assert remark in threshold.remark


def test_the_band_of_two_meshes_holds_down_to_order_1() -> None:
    values = power_law(1.0)[:2]
    assert found_from(values).band == pytest.approx(80.0 - values[-1], rel=1e-12)


def test_the_deck_of_a_sweep_is_never_read_as_a_path(tmp_path: Path) -> None:
    (tmp_path / "other.inp").write_text(plate().to_text())
    cases = {"refine": np.array([1, 2, 4])}
    summary = {"peak_force": power_law(3.5)[:3], "status": np.full(3, "ok")}
    one = np.ones(3)
    actual = SweepResult(cases, summary, one, one, deck_text=str(tmp_path / "other.inp"))
    assert "the scheme has order 2" in actual.convergence["peak_force"].remark
    whole = SweepResult(cases, summary, one, one, deck_text=plate().to_text())
    assert not whole.convergence["peak_force"].remark


@pytest.mark.long
def test_the_limit_of_two_meshes_is_that_of_the_series() -> None:
    swept = fecm.sweep(plate(), refine=[1, 2], history=True)
    assert swept["elements"].tolist() == [216, 864]
    assert swept["dt"][0] == 2.0 * swept["dt"][1]
    assert swept.steps[1] == pytest.approx(2 * swept.steps[0], abs=1)
    # The first of several peaks, which the run of the projectile's approach ends after.
    assert np.isnan(swept["peak_force"]).all()
    assert swept.force is not None
    first = {"peak_force": np.nanmax(swept.force, axis=1)}
    limit = convergence(swept.cases, first, 9)["peak_force"].limit
    assert limit == pytest.approx(PEAK, rel=1e-3)


@pytest.mark.long
def test_order_and_limit_of_three_meshes_are_printed_and_stored(tmp_path: Path) -> None:
    # A mass so small that it has left the plate before waves return from the edges.
    (tmp_path / "plate.inp").write_text(plate(mass=3e-6, duration=4e-5).to_text())
    done = call("sweep", "plate.inp", "--refine", "1,2,4", "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 0
    (line,) = [line for line in done.stdout.splitlines() if "peak_force" in line]
    order, limit, band = (float(word.removeprefix("±")) for word in line.split()[-3:])
    with h5py.File(tmp_path / "s.h5") as file:
        stored = dict(file["convergence/peak_force"].attrs)
    assert stored["order"] == pytest.approx(order, abs=5e-3)
    assert stored["limit"] == pytest.approx(limit, rel=1e-5)
    assert stored["band"] == pytest.approx(band, rel=1e-1)
    swept = fecm.load_sweep(tmp_path / "s.h5")
    assert swept["validity"].tolist() == ["ok"] * 3
    assert limit == pytest.approx(swept["peak_force"][-1], rel=1e-3)
    assert order > 1.0
    assert swept.convergence["peak_force"].order == stored["order"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--refine", "1,3"), "1,2,4,8"),
        (("--refine", "2"), "at least two"),
        (("--refine", "1,2", "--vary", "k=1e6"), "varies nothing else"),
    ],
)
def test_a_refinement_that_is_none_is_refused(
    options: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    (tmp_path / "plate.inp").write_text(small())
    done = call("sweep", tmp_path / "plate.inp", *options, "-o", tmp_path / "s.h5")
    assert_unusable(done)
    assert said in done.stderr


def test_a_refinement_varies_nothing_else() -> None:
    with pytest.raises(CasesError, match="refine"):
        fecm.sweep(small(), {"k": [1e6]}, refine=[1, 2])


def test_there_is_no_limit_while_the_elements_are_larger_than_the_patch() -> None:
    # Peaks of a disc of 0.96 mm on elements of 12.5, 6.25 and 3.125 mm; the finest meshes: 2105.8.
    peaks = {"peak_force": np.array([2122.33, 2111.56, 2109.87])}
    factors = {"refine": np.array([1, 2, 4])}
    plain = convergence(factors, peaks, 9)["peak_force"]
    assert abs(plain.limit - 2105.8) > 5.0 * plain.band
    unresolved = convergence(factors, peaks, 9, patch_ratio=12.5 / 0.96)["peak_force"]
    assert np.isnan([unresolved.limit, unresolved.band]).all()
    assert unresolved.remark == "no limit: the elements are larger than the patch"
    assert convergence(factors, peaks, 9, patch_ratio=3.9)["peak_force"] == plain
