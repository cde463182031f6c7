"""Failure criteria against independent vectors and textbook examples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fecm
from fecm import Ply, Strengths
from fecm.mechanics.failure import (
    CRITERIA,
    MODES,
    Candidates,
    Codes,
    exposure_of,
    interlaminar,
    is_evaluated,
    largest_modes,
    max_stress,
    puck,
    puck_limits,
    tsai_wu,
)
from fecm.mechanics.laminate import is_fabric, laminate
from fecm.mechanics.ply_stresses import in_plane_stresses
from fecm.problem.parts import ply_strengths
from tests.builders import Floats, table

# T300/5208 (Tsai and Hahn), MPa.
MODULI = {"e1": 181e3, "e2": 10.3e3, "nu12": 0.28, "g12": 7.17e3}
T300 = Strengths(1500.0, 1500.0, 40.0, 246.0, 68.0, 68.0, 50.0, **MODULI)


def evaluate(
    criterion: Callable[[Strengths, Floats, Floats, Floats], Candidates],
    ply: Strengths,
    s1: Floats,
    s2: Floats,
    tau: Floats,
) -> tuple[Floats, Codes]:
    """Exposure and mode of stress states."""
    candidates = criterion(ply, s1, s2, tau)
    return exposure_of(candidates), largest_modes(candidates)


def puck_angle(ply: Strengths, s2: Floats, exposure: Floats) -> Floats:
    """Angle of the fracture plane of mode C, in degrees."""
    resistance, _ = puck_limits(ply)
    ratio = np.clip(exposure * resistance / -s2, 0.0, 1.0)
    return np.asarray(np.rad2deg(np.arccos(np.sqrt(ratio))))


ROWS = table("failure_vectors.csv")
MATERIALS = fecm.materials()
KAW = {row["quantity"]: float(row["computed here"]) for row in table("failure_textbook.csv")}
COLUMNS = {
    "max_stress": "max stress f", "tsai_wu": "Tsai-Wu exposure 1/R", "hashin": "Hashin exposure",
}  # fmt: skip


def one(row: dict[str, str]) -> tuple[Strengths, list[Floats]]:
    xt, xc, yt, yc, s12 = (float(row[name]) for name in ("XT", "XC", "YT", "YC", "S12"))
    slopes = {"p_plus": float(row["p+"]), "p_minus": float(row["p-"])}
    ply = Strengths(xt, xc, yt, yc, s12, 68.0, 50.0, **slopes)
    return ply, [np.array([float(row[name])]) for name in ("s1", "s2", "t12")]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['s1']} {row['s2']} {row['t12']}")
def test_exposures_are_those_of_the_reference_vectors(row: dict[str, str]) -> None:
    ply, stress = one(row)
    for name in (*COLUMNS, "puck"):
        exposure, mode = evaluate(CRITERIA[name], ply, *stress)
        if name == "puck":
            expected = max(float(row["Puck FF f"]), float(row["Puck IFF f"]))
            if float(row["Puck IFF f"]) == expected and row["Puck mode"]:
                assert MODES[mode[0]][-1] == row["Puck mode"] or exposure[0] == pytest.approx(
                    float(row["Puck FF f"])
                )
        else:
            expected = float(row[COLUMNS[name]])
        assert exposure[0] == pytest.approx(expected, rel=1e-9)
        if name == "max_stress":
            assert MODES[mode[0]] == row["mode"]


def test_every_criterion_has_reference_values() -> None:
    assert {*CRITERIA} == {*COLUMNS, "puck"}


def test_the_fracture_angle_of_mode_c_is_that_of_the_reference_vectors() -> None:
    rows = [row for row in ROWS if row["Puck mode"] == "C" and float(row["Puck FF f"]) < 0.5]
    assert len(rows) > 2
    for row in rows:
        ply, (_, s2, _) = one(row)
        angle = puck_angle(ply, s2, np.array([float(row["Puck IFF f"])]))
        assert angle[0] == pytest.approx(float(row["Puck theta_fp deg (mode C)"]), abs=6e-4)


def test_the_textbooks_lamina_fails_at_the_printed_stress() -> None:
    # Kaw 2006, examples 2.17 to 2.20: a ply at 60 degrees under S (2, -3, 4).
    stress = [np.array([KAW[name]]) for name in ("s1/S", "s2/S", "t12/S")]
    ply = replace(T300, xt=1500.0, xc=1500.0, yt=40.0, yc=246.0, s12=68.0)
    names = {max_stress: "S, max stress (MPa)", tsai_wu: "S, Tsai-Wu F12*=-1/2 (MPa)"}
    for criterion, name in names.items():
        exposure, _ = evaluate(criterion, ply, *stress)
        assert 1.0 / exposure[0] == pytest.approx(KAW[name], rel=1e-5)


def test_the_first_ply_of_the_textbooks_laminate_fails_at_the_printed_load() -> None:
    # Kaw 2006, example 5.3: [0/90bar]s of 5 mm plies under N_x.
    ply = Ply(1.0, 0.28, 181e9, 10.3e9, 7.17e9, 7.17e9, 3.68e9)
    plate = laminate(ply, (0.0, 90.0, 0.0), (0.005, 0.005, 0.005))
    strains = np.linalg.solve(plate.A, [1.0, 0.0, 0.0])
    stresses = in_plane_stresses(plate) @ np.concatenate([strains, np.zeros(3)])
    pascal = Strengths(1.5e9, 1.5e9, 40e6, 246e6, 68e6, 68e6, 50e6)
    for layer, name in ((0, "strength ratio, 0 deg ply"), (1, "strength ratio, 90 deg ply")):
        exposure, _ = evaluate(tsai_wu, pascal, *stresses[layer, 0])
        assert 1.0 / exposure == pytest.approx(KAW[name], rel=1e-5)


finite = st.floats(-1e3, 1e3)


@given(finite, finite, finite, st.floats(1e-3, 1e3))
def test_exposures_are_linear_in_the_load(s1: float, s2: float, tau: float, load: float) -> None:
    stress = np.array([s1, s2, tau])[:, None]
    for criterion in CRITERIA.values():
        once, scaled = (
            evaluate(criterion, T300, *stress)[0],
            evaluate(criterion, T300, *(load * stress))[0],
        )
        assert scaled[0] == pytest.approx(load * once[0], rel=1e-9, abs=1e-12 * load)


def test_pucks_modes_meet_without_a_jump() -> None:
    ply = T300
    resistance, critical = puck_limits(ply)
    tau = np.array([30.0])
    for edge, step in ((0.0, 1e-9), (-30.0 * resistance / critical, 1e-9)):
        below, above = (
            evaluate(puck, ply, 0.0 * tau, np.array([edge + d]), tau) for d in (-step, step)
        )
        assert below[0][0] == pytest.approx(above[0][0], rel=1e-7)
        assert below[1][0] != above[1][0]


@pytest.mark.parametrize(
    "ply", [name for name, one in MATERIALS.items() if one.allowables("mm-N-s")]
)
def test_at_a_single_strength_every_criterion_that_holds_has_exposure_1(ply: str) -> None:
    named = MATERIALS[ply]
    known = named.allowables("mm-N-s")
    assert known is not None
    strengths = ply_strengths(known, named.converted("mm-N-s"))
    s1 = np.array([known.xt, -known.xc, 0.0, 0.0, 0.0])
    s2 = np.array([0.0, 0.0, known.yt, -known.yc, 0.0])
    tau = np.array([0.0, 0.0, 0.0, 0.0, known.s12])
    fabric = is_fabric(named.converted("mm-N-s"))
    assert fabric is (ply == "AS4-5H/3501-6")
    names = [name for name in CRITERIA if is_evaluated(name, fabric=fabric)]
    assert len(names) == len(CRITERIA) - fabric
    for name in names:
        exposure, _ = evaluate(CRITERIA[name], strengths, s1, s2, tau)
        np.testing.assert_allclose(exposure, 1.0, rtol=1e-12, err_msg=name)


@given(st.floats(1.0, 1e3), st.floats(1.0, 1e3), st.floats(0.01, 0.99))
def test_pucks_exposure_at_yt_is_1_whatever_its_slope(yt: float, s12: float, slope: float) -> None:
    stress = np.zeros(1), np.array([yt]), np.zeros(1)
    exposure, _ = evaluate(puck, replace(T300, yt=yt, s12=s12, p_plus=slope), *stress)
    assert exposure[0] == pytest.approx(1.0, rel=1e-9)


def test_interlaminar_exposure_is_a_quadratic_sum() -> None:
    actual = interlaminar(60.0, 40.0, np.array([36.0]), np.array([32.0]))
    assert actual[0] == pytest.approx(1.0)
