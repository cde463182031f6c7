"""Residual stresses of cure and moisture: CURE.

thermal_stress.csv: residual stresses by the minimum of the elastic energy, with Kaw's Example 4.5
(A. K. Kaw, Mechanics of Composite Materials, 2nd ed. 2006).  thermal_first_failure.csv: loads at
the first failure of a simply supported square plate, a/h = 100, by Navier's solution of first-order
theory and the criteria on the total stress.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
import pytest

import fecm
from fecm import Deck, Strengths
from fecm.deck.catalogue import MATERIALS, read_plies
from fecm.deck.grid import grid_lines, uniform_section
from fecm.deck.layup import parse_layup
from fecm.deck.model import Cure, Expansion, Preload
from fecm.judge.criteria import ALL_CRITERIA
from fecm.judge.exposures import LargestExposure
from fecm.mechanics.failure import CRITERIA, exposure_of, failure_load_factor
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.ply_stresses import PlyStresses, Residual, residual_stresses
from fecm.problem.loading import load_deck
from fecm.problem.parts import strengths_of_deck
from fecm.results.exposures import largest_exposures
from fecm.results.metrics import EXPOSURES
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation
from fecm.sweeps import in_full
from fecm.verification import decks
from tests.builders import Floats, table
from tests.calls import assert_unusable, call
from tests.sound_plate import base, with_card
from tests.test_failure_runs import failing
from tests.test_first_failure import failing as weak

T300 = MATERIALS["T300/5208"]
PLY = T300.converted("m-N-s")
ALPHA = Expansion(alpha1=0.02e-6, alpha2=22.5e-6)
THERMAL = "CURE\n{dt:g},\n,.02E-6,22.5E-6\n\nEXPE"


def residual(plate: LaminateSection, dt: float, free: Expansion = ALPHA) -> Residual:
    """Residual stresses of a laminate of one material."""
    return residual_stresses(plate, free.alpha1 * dt, free.alpha2 * dt)


# Stresses ----------------------------------------------------------------------------------------


def cases() -> dict[tuple[str, float], list[dict[str, str]]]:
    """Rows of each laminate and change of temperature."""
    actual: dict[tuple[str, float], list[dict[str, str]]] = {}
    for row in table("thermal_stress.csv"):
        actual.setdefault((row["case"], float(row["dT_K"])), []).append(row)
    return actual


CASES = cases()


def plate_of(rows: list[dict[str, str]]) -> LaminateSection:
    """The laminate of some rows, two a ply."""
    z = [float(row["z_m"]) for row in rows]
    thicknesses = np.subtract(z[1::2], z[::2]).tolist()
    return laminate(PLY, [float(row["angle"]) for row in rows[::2]], thicknesses)


@pytest.mark.parametrize(("name", "dt"), CASES)
def test_residual_stresses_are_those_of_the_least_energy(name: str, dt: float) -> None:
    rows = CASES[name, dt]
    actual = residual(plate_of(rows), dt)
    expected = np.array([[float(row[f"{s}_Pa"]) for s in ("s1", "s2", "t12")] for row in rows])
    atol = 1e-9 * np.abs(expected).max()
    np.testing.assert_allclose(actual.stresses.reshape(-1, 3), expected, rtol=0.0, atol=atol)
    strain = [float(rows[0][key]) for key in ("eps0_x", "eps0_y", "gamma0_xy")]
    np.testing.assert_allclose(actual.strain, strain, rtol=1e-9, atol=1e-15)
    curvature = [float(rows[0][key]) for key in ("kx_1/m", "ky_1/m", "kxy_1/m")]
    np.testing.assert_allclose(actual.curvature, curvature, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("layup", ["[0/90]", "[45/0/-45/90]4s", "[30/-20/75/10]", "[0]4"])
def test_residual_stresses_have_no_resultants(layup: str) -> None:
    angles = parse_layup(layup)
    plate = laminate(PLY, angles, [1e-4 * (1 + n % 3) for n in range(len(angles))])
    stresses = residual(plate, -155.0).stresses
    theta = np.deg2rad(angles)
    m, n = np.cos(theta), np.sin(theta)
    turned = np.array(  # xx, yy, xy by 1, 2, 12
        [[m * m, n * n, -2 * m * n], [n * n, m * m, 2 * m * n], [m * n, -m * n, m * m - n * n]]
    )
    in_axes = np.einsum("ijp,pfj->pfi", turned, stresses)
    lower, upper = plate.plies.faces[:-1], plate.plies.faces[1:]
    h = (upper - lower)[:, None]
    first, last = in_axes[:, 0], in_axes[:, 1]  # linear between the faces
    N = (h * (first + last) / 2.0).sum(axis=0)
    middle = (lower + upper)[:, None] / 2.0
    M = (h * middle * (first + last) / 2.0 + h**2 * (last - first) / 12.0).sum(axis=0)
    size = max(np.abs(stresses).max(), 0.0225 * 155.0 * 1e-3 * PLY.e2)
    assert np.abs(N).max() < 1e-12 * size * plate.thickness
    assert np.abs(M).max() < 1e-12 * size * plate.thickness**2


def test_plies_of_one_direction_have_none_and_an_isotropic_one_expands() -> None:
    unidirectional = residual(laminate(PLY, [30.0] * 4, [1e-4] * 4), -100.0)
    free = ALPHA.alpha2 * 100.0 * PLY.e2
    assert np.abs(unidirectional.stresses).max() < 1e-12 * free
    same = Expansion(alpha1=1e-5, alpha2=1e-5)
    heated = residual(laminate(PLY, [0.0, 90.0, 20.0], [1e-4] * 3), 50.0, same)
    np.testing.assert_allclose(heated.strain, [5e-4, 5e-4, 0.0], rtol=1e-12, atol=1e-18)
    assert np.abs(heated.stresses).max() < 1e-12 * 5e-4 * PLY.e1


def test_moisture_strains_as_much_as_a_temperature_of_the_same_free_strain() -> None:
    def stresses(card: Cure) -> Floats:
        (problem,) = load_deck(with_cure(card)).problems
        assert problem.residual is not None
        return problem.residual.stresses

    dry = stresses(Cure(-100.0, 0.0, (ALPHA,)))
    wet = stresses(Cure(0.0, 0.5, (Expansion(beta1=-4e-6, beta2=-4.5e-3),)))
    np.testing.assert_allclose(wet, dry, rtol=1e-12)


# Failure -----------------------------------------------------------------------------------------

STRENGTHS = T300.allowables("m-N-s")
ALONE = "exposure of the residual stress alone (q0 = 0, 90 ply)"
NAMES = {"max stress": "max_stress", "Tsai-Wu": "tsai_wu", "Puck IFF or FF": "puck"}


def bent(load: float, dt: float) -> fecm.Result:
    """A quarter of a simply supported square of a/h = 100 under a sinusoidal load."""
    assert STRENGTHS is not None
    along = np.cos(np.pi * np.array(grid_lines(uniform_section(0.5, 8))))
    plate = decks.material(PLY, (0.0, 90.0, 90.0, 0.0), 0.0025, points=3)
    others = [decks.MITC, STRENGTHS, Cure(dt, expansions=(ALPHA,))]
    macros = decks.program("TANG FORM SOLV FAIL")
    pressure = load * np.outer(along, along)
    return decks.run_of_deck(decks.quarter_plate(8, plate, macros, pressure, further=others))


@pytest.mark.parametrize(
    "row",
    table("thermal_first_failure.csv"),
    ids=lambda row: f"{row['criterion']} at {row['dT_K']}",
)
@pytest.mark.few(2)  # of 6, 0.05 s each
def test_the_first_ply_fails_at_the_load_of_the_exact_solution(row: dict[str, str]) -> None:
    name, dt = NAMES[row["criterion"]], float(row["dT_K"])
    expected = float(row["q0 at first failure (Pa)"])
    bent_plate = bent(expected, dt)
    (one,) = [one for one in largest_exposures(bent_plate) if one.criterion == name]
    assert one.at_rest == pytest.approx(float(row[ALONE]), abs=1e-6)
    load = expected / one.exposure if one.load_factor is None else expected * one.load_factor
    assert load == pytest.approx(expected, rel=2e-3)
    assert one.ply == int(row["ply"])
    assert max(one.x, one.y) < 0.01  # the point nearest to the middle of the plate


def test_the_factor_of_a_single_stress_is_that_of_the_closed_form() -> None:
    card = Strengths(1500.0, 1500.0, 40.0, 246.0, 68.0, 68.0, 68.0)
    rest, pull = np.array([0.0, 21.0, 0.0]), np.array([0.0, 10.0, 0.0])
    for name in ("max_stress", "hashin", "puck", "tsai_wu"):
        assert failure_load_factor(card, CRITERIA[name], rest, pull) == pytest.approx(
            1.9, rel=1e-11
        )
    assert failure_load_factor(card, CRITERIA["max_stress"], rest, -pull) == pytest.approx(
        26.7, rel=1e-11
    )
    # Where it fails at rest, and where nothing is added.
    assert failure_load_factor(card, CRITERIA["max_stress"], 2.0 * rest, pull) == 0.0
    assert failure_load_factor(card, CRITERIA["tsai_wu"], rest, 0.0 * pull) == np.inf


# Runs --------------------------------------------------------------------------------------------

PLANE = tuple(enumerate(("sigma_1", "sigma_2", "tau_12")))


def with_cure(card: Cure, every: int = 1) -> Deck:
    """The small plate with FAIL and CURE."""
    deck = fecm.read_one(failing(every))
    return replace(deck, segments=(*deck.segments, card), text="")


def cooled(dt: float, every: int = 1) -> Deck:
    return with_cure(Cure(dt, expansions=(ALPHA,)), every)


def test_fail_judges_the_sum_of_residual_and_mechanical_stresses() -> None:
    result = fecm.run_one(cooled(-100.0))
    ((card, *_),) = strengths_of_deck(fecm.read_one(failing()))
    assert card is not None
    (problem,) = load_deck(cooled(-100.0)).problems
    assert problem.residual is not None
    stresses = problem.residual.stresses
    np.testing.assert_allclose(result["plies/cure_stress"], stresses, rtol=1e-15)
    plies = PlyStresses(problem.mesh, problem.laminate, problem.rules[2])
    rows = [plies.evaluate(field) for field in result["tape3/displacement"]]
    rows.append({name: 0.0 * rows[0][name] for name in ("sigma_1", "sigma_2", "tau_12")})
    for name, criterion in CRITERIA.items():
        exposures = [
            exposure_of(criterion(card, *(row[n] + stresses[..., c] for c, n in PLANE)))
            for row in rows
        ]
        largest = np.max(exposures, axis=0)
        np.testing.assert_allclose(result[f"failure/{name}/exposure"], largest, rtol=1e-11)
        at_rest = float(exposures[-1].max())
        assert result.failure.attributes["cure"] == -100.0
        about = result.attributes_of(f"failure/{name}")
        assert about["at_rest"] == pytest.approx(at_rest, rel=1e-12)


def test_motion_force_and_stresses_between_plies_do_not_depend_on_the_cure() -> None:
    cold, plain = fecm.run_one(struck(-6.0)), fecm.run_one(struck(0.0))
    values = [path for path in plain if path.startswith(("history", "energy", "tape"))]
    for path in (*values, "failure/interlaminar/exposure", "failure/interlaminar/time"):
        np.testing.assert_array_equal(cold[path], plain[path], err_msg=path)


@pytest.mark.parametrize("solver", ["kernels", "numpy"])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_without_a_change_a_run_stores_what_it_does_without_the_card(
    solver: Literal["kernels", "numpy"],
) -> None:
    plain, cold = (
        fecm.run_one(deck, solver=solver) for deck in (fecm.read_one(failing()), cooled(0.0))
    )
    assert not cold["plies/cure_stress"].any()
    assert {*cold} - {*plain} == {"plies/cure_stress"}
    for path in plain:
        np.testing.assert_array_equal(cold[path], plain[path], err_msg=path)
    for name in CRITERIA:
        assert cold.attributes_of(f"failure/{name}") == {"at_rest": 0.0}
    assert cold.failure.attributes == {**plain.failure.attributes, "cure": 0.0}


SOLVERS: tuple[Literal["kernels"], Literal["numpy"]] = ("kernels", "numpy")


def test_the_compiled_criteria_are_those_of_numpy() -> None:
    compiled, plain = (fecm.run_one(cooled(-100.0), solver=s) for s in SOLVERS)
    for name in CRITERIA:
        for part in ("exposure", "time"):
            path = f"failure/{name}/{part}"
            np.testing.assert_allclose(compiled[path], plain[path], rtol=1e-10, err_msg=path)
        factors = [one.attributes_of(f"failure/{name}")["load_factor"] for one in (compiled, plain)]
        assert factors[0] == pytest.approx(factors[1], rel=1e-9)


def test_the_factor_on_a_static_load_reaches_an_exposure_of_1() -> None:
    one = next(one for one in largest_exposures(bent(3e4, -100.0)) if one.criterion == "tsai_wu")
    assert one.load_factor is not None
    again = next(
        one
        for one in largest_exposures(bent(3e4 * one.load_factor, -100.0))
        if one.criterion == "tsai_wu"
    )
    assert again.exposure == pytest.approx(1.0, rel=1e-9)
    assert again.load_factor == pytest.approx(1.0, rel=1e-9)


def test_summary_and_json_have_what_the_residual_stresses_contribute(tmp_path: Path) -> None:
    path = tmp_path / "d.inp"
    path.write_text(struck(-6.0).to_text())
    done = call("run", path, cwd=tmp_path)
    (line,) = [row for row in done.stdout.splitlines() if row.startswith("  tsai wu")]
    result = fecm.load(tmp_path / "d.h5")
    (one,) = [one for one in largest_exposures(result) if one.criterion == "tsai_wu"]
    assert one.at_rest is not None
    assert one.load_factor is not None
    assert f"; at rest {one.at_rest:.3g}, 1 at {one.load_factor:.4g} of the load's" in line
    document = json.loads(call("info", tmp_path / "d.h5", "--format", "json").stdout)
    failure = document["metrics"]["failure"]
    assert failure["at_rest"]["tsai_wu"] == pytest.approx(one.at_rest)
    assert failure["load_factor"]["tsai_wu"] == pytest.approx(one.load_factor)
    assert "interlaminar" not in failure["at_rest"]
    with h5py.File(tmp_path / "d.h5", "r+") as file:
        file["failure/puck"].attrs["at_rest"] = "much"
    broken = call("info", tmp_path / "d.h5")
    assert_unusable(broken)
    assert "the attribute at_rest of failure/puck is much, not a number" in broken.stderr


def test_the_factor_acts_on_the_load_alone_under_a_preload() -> None:
    assert STRENGTHS is not None
    plate = decks.material(PLY, (0.0, 90.0, 90.0, 0.0), 0.0025, points=3)
    along = np.outer(*[np.cos(np.pi * np.array(grid_lines(uniform_section(0.5, 4))))] * 2)

    def largest(load: float) -> LargestExposure:
        others = [decks.MITC, STRENGTHS, Preload(2e5, 1e5), Cure(-50.0, expansions=(ALPHA,))]
        macros = decks.program("TANG FORM SOLV FAIL")
        quarter = decks.quarter_plate(4, plate, macros, load * along, further=others)
        return largest_exposures(decks.run_of_deck(quarter))[0]

    one = largest(5e4)
    assert one.load_factor is not None
    assert one.load_factor != pytest.approx(1.0, rel=0.01)
    assert largest(5e4 * one.load_factor).exposure == pytest.approx(1.0, rel=1e-9)
    at_rest = residual(laminate(PLY, (0.0, 90.0, 90.0, 0.0), [0.0025] * 4), -50.0).stresses
    assert one.at_rest == pytest.approx(at_rest.max() / STRENGTHS.yt, rel=1e-12)


def test_a_run_begins_with_the_exposures_at_rest() -> None:
    result = fecm.run_one(cooled(-100.0, every=3))
    at_rest = [result.attributes_of(f"failure/{name}")["at_rest"] for name in CRITERIA]
    assert result["exposures/time"][0] == 0.0
    np.testing.assert_allclose(
        result["exposures/exposure"][0, : len(CRITERIA)], at_rest, rtol=1e-12
    )
    assert (np.diff(result["exposures/exposure"][:, : len(CRITERIA)], axis=0) >= 0.0).all()


# Sweeps and searches -----------------------------------------------------------------------------


def struck(dt: float) -> Deck:
    """A small plate that fails, whose projectile has left it."""
    deck = fecm.read_one(weak(every=4, steps=400))
    return replace(deck, segments=(*deck.segments, Cure(dt, expansions=(ALPHA,))), text="")


@pytest.mark.parametrize(
    "values", [{"cure_dT": [-6.0, 3.0]}, {"velocity": [60.0, 80.0], "cure_dT": [-6.0, 2.0]}]
)
@pytest.mark.few(1)  # of 2, 0.6 s each
def test_cases_of_a_sweep_are_the_runs_of_their_decks(values: dict[str, list[float]]) -> None:
    deck = struck(-1.0)
    swept = fecm.sweep(deck, values, measure="failure")
    for row in range(len(swept["cure_dT"])):
        single = fecm.run_one(deck.with_(**{name: swept[name][row] for name in values}))
        largest = {f"exposure_{one.criterion}": one.exposure for one in largest_exposures(single)}
        columns = {name: swept[name][row] for name in EXPOSURES if name in largest}
        assert columns == pytest.approx(largest, rel=1e-9)
        assert swept["peak_force"][row] == pytest.approx(single.force.max(), rel=1e-9)
        assert swept["validity"][row] == single.validity


@pytest.mark.long
def test_cases_that_differ_in_the_cure_alone_share_their_motion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[Simulation] = []

    def counted(simulation: Simulation) -> None:
        runs.append(simulation)
        run_program(simulation)

    monkeypatch.setattr(in_full, "run_program", counted)
    (tmp_path / "d.inp").write_text(struck(0.0).to_text())
    options = ("--random", "cure_dT=normal:-3,1", "--samples", "16", "--measure", "failure")
    done = call("sweep", "d.inp", *options, "-o", "s.h5", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    text = "16 draws are run in full; those that differ only in cure_dT, together"
    assert text in done.stderr
    assert len(runs) == 1
    swept = fecm.load_sweep(tmp_path / "s.h5")
    assert len(set(swept["exposure_tsai_wu"])) == 16
    assert len(set(swept["peak_force"])) == 1
    # Without exposures all cases are that of the plate.
    with pytest.warns(fecm.FecmWarning, match="cure_dT changes only exposures"):
        forces = fecm.sweep(struck(0.0), {"cure_dT": [-3.0, 0.0]})["peak_force"]
    assert forces[0] == forces[1]


@pytest.mark.long
def test_a_search_finds_the_velocity_at_which_residual_and_other_stresses_reach_1() -> None:
    (velocity,) = fecm.sweep(struck(-6.0), until={"exposure": 1.0})["found_velocity"]
    (free,) = fecm.sweep(struck(0.0), until={"exposure": 1.0})["found_velocity"]
    assert velocity < 0.8 * free
    single = fecm.run_one(struck(-6.0).with_(velocity=velocity))
    assert max(one.exposure for one in largest_exposures(single)) == pytest.approx(1.0, rel=2e-5)


def test_a_search_for_an_exposure_that_the_plate_at_rest_has_is_refused() -> None:
    (status,) = fecm.sweep(struck(-9.0), until={"exposure": 1.0})["status"]
    assert status.startswith("the plate at rest has the exposure 1.1")


def test_a_deck_without_expansions_can_not_vary_the_cure() -> None:
    with pytest.raises(ValueError, match="cure_dT: the deck has no CURE"):
        fecm.read_one(failing()).with_(cure_dT=-100.0)


def test_the_first_failure_begins_with_the_exposure_at_rest() -> None:
    result = fecm.run_one(struck(-6.0))
    first = next(one for one in result.first_failures if one.criterion in CRITERIA)
    number = list(ALL_CRITERIA).index(first.criterion)
    times, exposures = result["exposures/time"], result["exposures/exposure"][:, number]
    assert exposures[0] > 0.5
    after = int(np.argmax(exposures >= 1.0))
    share = (1.0 - exposures[after - 1]) / (exposures[after] - exposures[after - 1])
    assert first.time == pytest.approx(times[after - 1] + share * np.diff(times)[after - 1])
    # Plies that fail at rest fail without a force.
    broken = fecm.run_one(struck(-9.0)).first_failures[0]
    assert (broken.time, broken.force, broken.energy) == (0.0, 0.0, 0.0)


# Cards -------------------------------------------------------------------------------------------

NEW = (
    "new", "-", "--size", "100x80", "--mesh", "4x4", "--layup", "[0/90]s", "--units", "mm-N-s",
    "--ply-thickness", ".125", "--velocity", "2000", "--law", "5e4,0,0,1.5",
    "--projectile", "mass:1e-3", "--duration", "1e-5", "--patch", "none", "--damage",
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "cure", "dt"),
    [
        ("T300/5208", "-100", -100.0),
        ("T300/5208", "177:20.5", -156.5),
        ("T300/5208", "-20:-60", -40.0),
        ("AS4/3501-6", ":22", -155.0),
        ("E-glass/MY750", ":20", -100.0),
    ],
)
@pytest.mark.few(2)  # of 5, 0.1 s each
def test_new_writes_the_cure_of_a_named_ply(name: str, cure: str, dt: float) -> None:
    answer = call(*NEW, "--material", name, "--cure", cure)
    assert answer.exit_code == 0, answer.stderr
    card = fecm.read_one(answer.stdout).require(Cure)
    values = MATERIALS[name].values
    expected = Expansion(1, values["alpha1"], values["alpha2"])
    assert card == Cure(dt, expansions=(expected,))
    deck = fecm.impact(
        fecm.Plate.rectangle((100, 80), (4, 4)),
        fecm.Laminate("[0/90]s", name, 0.125),
        fecm.RigidMass(1e-3),
        fecm.Contact(5e4, 0.0, 0.0, 1.5),
        velocity=2000.0, duration=1e-5, units="mm-N-s", patch=None, damage=True, cure=cure,
    )  # fmt: skip
    assert deck == fecm.read_one(answer.stdout)


@pytest.mark.parametrize(
    ("name", "cure", "message"),
    [
        ("IM7/8552", "-100", "--cure: IM7/8552 has no alpha1 and alpha2"),
        ("T300/5208", ":20", "the stress-free temperature of T300/5208 is not known"),
        ("T300/5208", "cold", "--cure is 'cold', not a change of temperature, as -100"),
        ("T300/5208", "177:", "--cure is '177:', not a change of temperature"),
        ("T300/5208", "inf", "--cure is 'inf', not a change of temperature"),
    ],
)
def test_a_cure_that_can_not_be_meant_is_told(name: str, cure: str, message: str) -> None:
    done = call(*NEW, "--material", name, "--cure", cure)
    assert_unusable(done)
    assert message in done.stderr


def test_the_published_expansions_are_in_the_catalogue() -> None:
    # Tsai and Hahn 1980, chapter 8; Soden, Hinton and Kaddour 1998, table 1.
    for name, alpha1, alpha2, free in (
        ("T300/5208", 0.02, 22.5, None),
        ("B4/5505", 6.1, 30.3, None),
        ("AS/3501", -0.3, 28.1, None),
        ("Scotchply-1002", 8.6, 22.1, None),
        ("Kevlar49/epoxy", -4.0, 79.0, None),
        ("AS4/3501-6", -1.0, 26.0, 177.0),
        ("T300/914", -1.0, 26.0, 120.0),
        ("E-glass/LY556", 8.6, 26.4, 120.0),
        ("E-glass/MY750", 8.6, 26.4, 120.0),
    ):
        values = MATERIALS[name].values
        assert (values["alpha1"] * 1e6, values["alpha2"] * 1e6) == pytest.approx((alpha1, alpha2))
        assert values.get("stress_free_temperature") == free
    with pytest.raises(ValueError, match=r"alpha2: 22\.5 is above 0\.001"):
        read_plies(OWN.format("alpha1=0.02e-6\nalpha2=22.5"))
    assert read_plies(OWN.format("alpha1=-1e-6\nalpha2=2e-5"))["mine"].expansion is not None
    assert read_plies(OWN.format("alpha1=-1e-6"))["mine"].expansion is None


OWN = "[mine]\ndensity=1.6e-9\nnu12=0.3\nE1=140e3\nE2=9e3\nG12=5e3\n{}\n"


def messages(card: Cure) -> dict[str, str]:
    """Findings about a card on the small plate, by code."""
    findings = load_deck(with_cure(card)).findings
    return {f.code: f.message for f in findings if f.code in CODES}


CODES = ("E453", "E454", "W462", "W463", "W464", "W465", "W496")


@pytest.mark.parametrize(
    ("card", "code", "message"),
    [
        (Cure(-100.0), "E453", "CURE has no card for material 1, MATE's."),
        (Cure(-9.0, expansions=(Expansion(),)), "E453", "by -9, but alpha1 and alpha2 are 0."),
        (Cure(0.0, 1.0, (ALPHA,)), "E453", "moisture by 1, but beta1 and beta2 are 0."),
        (
            Cure(-1.0, expansions=(ALPHA, replace(ALPHA, material=2))),
            "E453",
            "The deck has no material 2, only 1",
        ),
        (Cure(-1.0, expansions=(Expansion(1, -1.0, 2e-5),)), "E454", "alpha1 = -1 is above 0.001"),
        (Cure(-1.0, expansions=(ALPHA, ALPHA)), "E453", "Material 1 has a second card"),
        (Cure(-501.0, expansions=(ALPHA,)), "W462", "change of temperature is -501 K, above 500."),
        (Cure(-450.0, expansions=(ALPHA,)), "W463", "cracks before any load"),
        (Cure(-200.0, expansions=(ALPHA,)), "W464", "warps by 0.0173 over its longer side, 0.16"),
        (Cure(0.0, 0.1, (Expansion(beta2=0.6),)), "W496", "beta2 = 0.6 is large"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_cure_is_told(card: Cure, code: str, message: str) -> None:
    assert message in messages(card).get(code, "")


@pytest.mark.parametrize(
    ("force", "dt", "blamed"),
    [("2000.", "-1.", {"W489"}), ("1.", "-450.", {"W463"}), ("500.", "-200.", {"W564"})],
)
def test_of_preload_and_cure_the_one_that_fails_a_ply_alone_is_blamed_or_both_together(
    force: str, dt: str, blamed: set[str]
) -> None:
    cured = with_card("CURE", f"{dt},", ",.02E-6,22.5E-6", "")(base())
    findings = load_deck(with_card("PREL", force)(cured)).findings
    assert {finding.code for finding in findings} & {"W463", "W489", "W564"} == blamed


def test_a_sound_cure_has_no_findings() -> None:
    deck = replace(fecm.read_one(base()), text="")
    cold = Cure(-155.0, expansions=(ALPHA,))
    changed = replace(deck, segments=(*deck.segments, cold))
    assert [f.code for f in load_deck(changed).findings if f.code in CODES] == []
