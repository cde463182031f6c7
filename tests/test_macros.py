"""The macros beyond the impact: statics, modes, central differences, loads, printed output."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.deck.macros import load_factor
from fecm.deck.model import LoadTable
from fecm.mechanics.solutions import modes
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_plate
from tests.calls import call
from tests.decks import DATA, DATA_CARDS, MESH, PROGRAM, ROOT, small

STATIC = ROOT / "decks" / "static-bending.inp"
MODES = ROOT / "decks" / "natural-frequencies.inp"
PULSE = ROOT / "decks" / "pulse-load.inp"

# D of the decks' plate: E h^3/12(1 - nu^2), h = 0.1.
RIGIDITY = 0.1**3 / (12.0 * (1.0 - 0.3**2))


def run(deck: str | Path, *slips: str) -> Result:
    """Result of a deck of one problem."""
    return fecm.run_one(deck, slips=slips)


def changed(deck: Path, *changes: tuple[str, str]) -> str:
    """Text of a deck with changes."""
    text = deck.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def navier(case: str, load: str) -> float:
    """Deflection of the middle of a simply supported plate."""
    with (DATA / "static_ssss_mindlin.csv").open() as file:
        for row in csv.DictReader(file):
            if row["case"] == case and row["load"].startswith(load):
                return float(row["w_centre"])
    raise LookupError(case)


def test_static_bending_gives_naviers_deflection() -> None:
    expected = navier("isotropic nu=.3 a=1 h/a=0.1 ks=1.000000 E=1", "uni")
    result = run(STATIC)
    # Four elements a side of the whole plate.
    assert result.tape3.w[0, 0] == pytest.approx(expected, rel=2e-3)
    assert result.tape3.step.tolist() == [0]


def test_reactions_balance_the_loads() -> None:
    result = run(STATIC)
    force = result.reactions.force[0]
    # A quarter of the plate carries a quarter of the unit load, less what FORC leaves to the
    # supported nodes themselves: 5/12 h^2 for each of two edges' elements and corners.
    text = STATIC.read_text()
    prepared = load_deck(text).problems[0]
    applied = prepared.mesh.forces[:, 2][prepared.mesh.equations[:, 2] > 0].sum()
    assert force[:, 2].sum() == pytest.approx(-applied, rel=1e-10)
    free = prepared.mesh.equations > 0
    assert np.abs(force[free]).max() < 1e-10 * applied


def test_stress_resultants_of_the_middle_are_those_of_the_plates_theory() -> None:
    # The couple in the middle of a simply supported square plate, nu = 0.3: 0.0479 q a^2; it does
    # not depend on the shear stiffness.
    result = run(changed(STATIC, ("    3    2    3", "    3    2   -3")))
    stresses = result.stresses
    at = np.flatnonzero((np.abs(stresses.x) + np.abs(stresses.y)).ravel() == 0.0)[0]
    assert stresses.M_x[0].ravel()[at] == pytest.approx(0.0479, rel=0.04)
    assert stresses.M_y[0].ravel()[at] == pytest.approx(0.0479, rel=0.04)
    kappa_x, kappa_y = stresses.kappa_x[0], stresses.kappa_y[0]
    np.testing.assert_allclose(
        stresses.M_x[0], RIGIDITY * (kappa_x + 0.3 * kappa_y), rtol=1e-9, atol=1e-12
    )
    assert not stresses.N_x.any()


def test_a_membrane_pull_gives_its_resultant_everywhere() -> None:
    # One element pulled by N_x = 2 along two edges of length 1, held against rigid motion.
    text = """\
FECM pull
    4    1    1    2    5    4
COOR
1, 0, 0, 0
2, 0, 1, 0
3, 0, 1, 1
4, 0, 0, 1

ELEM
    1    1    2    3    4

BOUN
    1    0    1    1    1    1    1
    2    0    0    1    1    1    1
    3    0    0    0    1    1    1
    4    0    1    0    1    1    1

FORC
2, 0, 1
3, 0, 1

MATE
    2    2   -2       0.1
1, .3, 1, 1, .4, .4, .4
    1   0.       0.1
END
MACR
TANG
FORM
SOLV
STRE
REAC
END
STOP
"""
    result = run(text)
    np.testing.assert_allclose(result.stresses.N_x[0], 2.0, rtol=1e-12)
    np.testing.assert_allclose(result.stresses.N_y[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(result.stresses.eps_xx[0], 2.0 / 0.1, rtol=1e-12)
    np.testing.assert_allclose(result.stresses.eps_yy[0], -0.3 * 2.0 / 0.1, rtol=1e-12)
    np.testing.assert_allclose(result.reactions.force[0, [0, 3], 0], -1.0, rtol=1e-12)


def test_conv_leaves_the_loop_once_nothing_changes() -> None:
    looped = changed(
        STATIC,
        ("FORM ", "TOL       1.E-8\nLOOP          9\nFORM "),
        ("DISP ", "DISP\nCONV\nNEXT\nDISP "),
    )
    result = run(looped)
    # A linear plate is solved in the first pass; the second finds nothing to change and leaves.
    assert len(result.tape3.w) == 3
    np.testing.assert_allclose(result.tape3.w[1], result.tape3.w[0], rtol=1e-9)


def test_rows_that_never_came_are_cut_off_in_the_file_too(tmp_path: Path) -> None:
    looped = changed(
        STATIC, ("FORM ", "LOOP          9\nFORM "), ("DISP ", "DISP\nCONV\nNEXT\nDISP ")
    )
    fecm.run(looped, output=tmp_path / "a.h5")
    fecm.run(looped, output=tmp_path / "b.h5")
    loaded = fecm.load(tmp_path / "a.h5")
    assert loaded["tape3/w"].shape == (3, 25)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_a_plate_that_is_not_held_has_no_static_solution(tmp_path: Path) -> None:
    deck = tmp_path / "free.inp"
    deck.write_text(small("TANG\nFORM\nSOLV\nDISP\n", data=DATA_CARDS + "FORC\n13, 0, 0, 0, 1\n\n"))
    done = call("run", str(deck), "-o", str(tmp_path / "x.h5"))
    assert done.exit_code == 2
    assert "the plate is not restrained" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["free.inp"]


def test_natural_frequencies_are_mindlins_with_either_mass() -> None:
    actual = run(MODES).modes
    assert actual.number.tolist() == [1, 2, 3, 4] * 2
    with (DATA / "freq_ssss_mindlin.csv").open() as file:
        rows = [r for r in csv.DictReader(file) if "h/a=0.1 ks=1.0" in r["case"]]
    scale = np.sqrt(RIGIDITY / 0.1)  # omega a^2 sqrt(rho h/D)
    exact = [float(r["omega_flex_rad/s_or_nondim"]) * scale for r in rows[:3]]
    lumped, consistent = actual.angular_frequency[:4], actual.angular_frequency[4:]
    for omega in (lumped, consistent):
        assert omega[0] == pytest.approx(exact[0], rel=1e-3)
        assert omega[1] == pytest.approx(exact[1], rel=1e-2)
        assert omega[2] == pytest.approx(omega[1], rel=1e-9)
        assert omega[3] == pytest.approx(exact[2], rel=1e-2)
    assert (consistent > lumped).all()  # the consistent mass bounds from above


def test_a_free_plate_has_six_rigid_modes() -> None:
    # In-plane unknowns free as well.
    free = small("LMAS\nEIGE          7\n", mesh=MESH.replace("   -1   -1", "    0    0"))
    free = free.replace("   25    0    1    1", "   25    0    0    0")
    omega = run(free).modes.angular_frequency
    assert (omega[:6] < 1e-3 * omega[6]).all()
    assert omega[6] > 0.0


def test_modes_are_orthonormal_in_the_mass() -> None:
    problem = load_deck(MODES).problems[0]
    plate = build_plate(problem.deck, problem.mesh)
    for consistent in (False, True):
        eigenmodes = modes(plate, 6, consistent=consistent)
        M = plate.consistent_mass.toarray() if consistent else np.diag(plate.mass)
        np.testing.assert_allclose(
            eigenmodes.shapes @ M @ eigenmodes.shapes.T, np.eye(6), atol=1e-8
        )
        K = eigenmodes.shapes @ (plate.stiffness @ eigenmodes.shapes.T)
        np.testing.assert_allclose(K, np.diag(eigenmodes.angular_frequency**2), atol=1e-7 * K.max())


def test_a_pulse_gives_the_response_that_the_modes_give() -> None:
    result = run(PULSE)
    problem = load_deck(PULSE).problems[0]
    plate = build_plate(problem.deck, problem.mesh)
    eigenmodes = modes(plate, plate.neq, consistent=False)
    row = int(problem.mesh.equations[40, 2]) - 1
    participation = eigenmodes.shapes[:, row]
    # Each mode answers sin(p t) on 0 < t < 2, then swings freely: Duhamel's integral.
    p, omega = np.pi / 2.0, eigenmodes.angular_frequency

    def answer(t: float) -> float:
        end = min(t, 2.0)
        a, b = omega - p, omega + p

        def integral(s: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
            # of sin(p s) sin(omega (t - s))
            first = np.sin(omega * t - b * s) / b
            second = np.sin(omega * t - a * s) / a
            return np.asarray((first - second) / 2.0 * -1.0)

        return float((participation**2 / omega * (integral(end) - integral(0.0))).sum())

    expected = np.array([answer(t) for t in result.tape3.time])
    got = result.tape3.w[:, 40]
    assert np.abs(got - expected).max() < 2e-2 * np.abs(expected).max()
    assert np.abs(result.energy.balance_error).max() < 2e-2 * result.energy.external_work.max()


def test_central_differences_converge_with_the_square_of_the_step() -> None:
    ends = []
    for dt, count in ((".02", 100), (".01", 200), (".005", 400)):
        text = changed(
            PULSE,
            (" 0.02", f"{dt:>5}"),
            ("        400", f"{count:11d}"),
            ("DISP          4", f"DISP {count:10d}"),
        )
        ends.append(run(text).tape3.w[-1, 40])
    assert abs(ends[1] - ends[2]) < 0.3 * abs(ends[0] - ends[1])


@pytest.mark.parametrize(
    ("clock", "factor"), [(-1.0, 0.0), (0.0, 1.0), (0.5, 2.0 + 3.0 * np.sin(1.5) ** 2), (2.5, 0.0)]
)
def test_a_load_table_is_its_formula_between_its_times(clock: float, factor: float) -> None:
    table = LoadTable(1, 2, 0.0, 2.0, (1.0, 2.0, 3.0, 2.0, 0.5))
    expected = factor if clock != 0.0 else 1.0 + 3.0 * np.sin(0.5) ** 2
    assert load_factor(table, clock) == pytest.approx(expected, rel=1e-14)


def test_an_exponent_below_1_counts_as_1() -> None:
    assert load_factor(LoadTable(1, 0, 0.0, 1.0, (0.0, 0.0, 1.0, 1.0, 0.0)), 0.3) == np.sin(0.3)


def test_the_slip_prop_takes_the_load_at_time_0_or_not_at_all() -> None:
    assert not run(PULSE, "prop").tape3.w.any()
    cosine = changed(PULSE, ("1.5707963267948966, 0.0", "1.5707963267948966, 1.5707963267948966"))
    again = cosine.replace("LOOP ", "PROP\nLOOP ")  # PROP without a number evaluates at t = 0
    constant = run(again, "prop")
    assert constant.energy.external_work[-1] == pytest.approx(constant.tape3.w[-1, 40], rel=1e-9)


def test_a_missing_load_table_is_found() -> None:
    lines = [
        line for line in PULSE.read_text().splitlines() if not line.startswith("1, 1, 0.0, 2.0")
    ]
    assert [f.code for f in load_deck("\n".join(lines) + "\n").findings] == ["E011"]


def test_check_ends_the_program_only_under_its_slip() -> None:
    text = small("CHEC\n" + PROGRAM)
    assert len(run(text).force) == 10
    assert "history/force" not in run(text, "check-end")


def test_check_reports_the_profile_of_the_equations() -> None:
    # Two 4-node elements in a row, in-plane unknowns held: 6 nodes, 18 equations.  Numbered along
    # the short side, each column reaches back to its element's first unknown: nodes 1 to 4 to
    # equation 1, nodes 5 and 6 to node 3's equation 7.
    text = """\
FECM profile
    6    2    1    2    5    4
COOR
1, 0, 0, 0
2, 0, 0, 1
3, 0, 1, 0
4, 0, 1, 1
5, 0, 2, 0
6, 0, 2, 1

ELEM
    1    1    3    4    2
    2    3    5    6    4

BOUN
    1    1   -1   -1    0    0    0
    6    0    1    1    0    0    0

MATE
    2    2   -2       0.1
1, .3, 1, 1, .4, .4, .4
    1   0.       0.1
END
MACR
CHEC
DISP
END
STOP
"""
    result = run(text)
    expected = sum(range(1, 13)) + sum(range(7, 13))
    groups = result._groups["mesh"]
    assert groups["equations"] == 18
    assert groups["profile"] == expected


def test_stresses_are_stored_at_every_nth_pass_of_the_loop() -> None:
    result = run(small(PROGRAM.replace("NEXT", "STRE          4\nNEXT")))
    assert result.stresses.step.tolist() == [4, 8]
    np.testing.assert_allclose(result.stresses.time, [2e-6, 4e-6], rtol=1e-12)


def test_displacements_without_impact_steps_and_impact_steps_without_displacements() -> None:
    assert "tape3/w" not in run(small(PROGRAM.replace("DISP          5\n", "")))
    without = DATA_CARDS[DATA_CARDS.index("MATE") :]
    alone = run(small("LMAS\nDISP\n", data=without))
    assert not alone.tape3.w.any()
    assert "history/force" not in alone


def test_a_loop_inside_the_loop_of_impact_steps_runs_at_every_pass() -> None:
    every = PROGRAM.replace("DISP          5", "DISP")
    inside = PROGRAM.replace("DISP          5", "LOOP          1\nDISP\nNEXT")
    actual, expected = run(small(inside)).tape3, run(small(every)).tape3
    assert actual.step.tolist() == list(range(1, 11))
    np.testing.assert_allclose(
        actual.w, expected.w, rtol=0.0, atol=1e-12 * np.abs(expected.w).max()
    )


def test_central_differences_and_impact_steps_share_one_plate() -> None:
    text = small("LMAS\nDT        .5E-6\nLOOP          4\nTIME\nRODP\nNEXT\nEXCD\nRODP\n")
    result = run(text)
    assert result.energy.step.tolist() == [1, 2, 3, 4, 5, 6]


def test_the_printed_output_holds_what_the_original_printed(tmp_path: Path) -> None:
    printed = tmp_path / "out.txt"
    text = small(PROGRAM.replace("NEXT", "STRE         10\nCHEC\nNEXT"))
    deck = tmp_path / "small.inp"
    deck.write_text(text)
    done = call("run", str(deck), "-o", str(tmp_path / "x.h5"), "--print", str(printed))
    assert done.exit_code == 0
    page = printed.read_text()
    for heading in (
        "Control information",
        "Nodal coordinates",
        "Elements",
        "Restraint codes",
        "Material",
        "Indentation law",
        "Impact",
        "Equation numbers",
        "Macro program",
        "Element strains and stress resultants",
        "Mesh and storage",
    ):
        assert f"\n  {heading}" in page
    assert page.count("\f") == page.count("small plate") - 1
    assert "1.912e+06" in page
    result = fecm.load(tmp_path / "x.h5")
    assert f"{result['stresses/M_x'][0, 0, 0]:13.5g}" in page


def test_nopr_silences_the_mesh_and_page_sets_the_carriage_control(tmp_path: Path) -> None:
    printed = tmp_path / "out.txt"
    deck = tmp_path / "small.inp"
    deck.write_text(
        "FECM x\n" + small().split("\n", 1)[1].replace("COOR\n", "PAGE\n0\nNOPR\nCOOR\n", 1)
    )
    done = call("run", str(deck), "-o", str(tmp_path / "x.h5"), "--print", str(printed))
    assert done.exit_code == 0
    page = printed.read_text()
    assert "Nodal coordinates" not in page
    assert "Equation numbers" not in page
    assert "Material" in page
    assert "\f" not in page


def test_an_existing_printout_is_kept(tmp_path: Path) -> None:
    printed = tmp_path / "out.txt"
    printed.write_text("precious")
    done = call("run", str(STATIC), "-o", str(tmp_path / "x.h5"), "--print", str(printed))
    assert done.exit_code == 2
    assert printed.read_text() == "precious"
    assert not (tmp_path / "x.h5").exists()
