"""FAIL: the largest exposures over a run, what is printed and the exit status."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Ply, Strengths
from fecm._text import jsonable
from fecm.deck.model import Allowables
from fecm.judge.criteria import ALL_CRITERIA
from fecm.mechanics.elements import gauss
from fecm.mechanics.failure import CRITERIA, exposure_of
from fecm.mechanics.failure_monitor import FailureMonitor
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.laminate import laminate
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.problem.loading import load_deck
from fecm.problem.parts import strengths_of_deck
from fecm.results.exposures import largest_exposures
from fecm.results.sinks import MemorySink
from fecm.results.summary import about_run, run_summary
from fecm.simulation.job import Solver
from fecm.simulation.run import simulate
from fecm.sweeps.in_full import without_output
from tests.builders import nothing, rules, square, table, with_restraints
from tests.calls import call
from tests.decks import PROGRAM, small
from tests.patches import equilibrium
from tests.test_patch import rectangle

MODULI = {"e1": 181e9, "e2": 10.3e9, "nu12": 0.28, "g12": 7.17e9}
STRENGTHS = Strengths(1.5e9, 1.5e9, 40e6, 246e6, 68e6, 68e6, 68e6, **MODULI)
ALLO = "ALLO\n   200000.   200000.     7000.    28000.    13000.\n\nEXPE"


def failing(every: int = 1) -> str:
    program = PROGRAM.replace("DISP          5", f"DISP          1\nFAIL{every:11}")
    return small(program).replace("EXPE", f"PATC\nDISC,.2\n{ALLO}")


def of_fabric() -> str:
    """The same with plies of a fabric."""
    given = failing()
    changed = given.replace("17500000.  1150000.   800000.", "17500000. 17000000.   800000.")
    assert changed != given
    return changed


@pytest.mark.parametrize("solver", ["numpy", "auto"])
def test_a_run_of_fabrics_leaves_out_pucks_criterion_and_nothing_else(solver: Solver) -> None:
    result = fecm.run_one(of_fabric(), solver=solver)
    assert np.isnan(result["failure/puck/exposure"]).all()
    names = [one.criterion for one in largest_exposures(result)]
    assert names == [name for name in ALL_CRITERIA if name != "puck"]
    assert not any(line.startswith("puck") for line in run_summary(result))


@pytest.mark.parametrize("name", ["max stress", "Tsai-Wu"])
def test_the_first_ply_fails_at_the_load_of_the_exact_solution(name: str) -> None:
    ply = Ply(1.0, 0.28, 181e9, 10.3e9, 7.17e9, 7.17e9, 3.68e9)
    plate, mesh = laminate(ply, (0.0, 90.0, 90.0, 0.0), [0.0005] * 4), rectangle(16, 16, 0.2, 0.2)
    forces = np.zeros(mesh.equations.shape)
    for family in element_blocks(mesh.elements, mesh.coordinates):
        at = interpolate(family, gauss(3))
        x, y = np.einsum("pn,eni->iep", at.N, family.coordinates)
        load = at.jxw * np.sin(np.pi * x / 0.2) * np.sin(np.pi * y / 0.2)
        np.add.at(forces[:, 2], family.nodes, np.einsum("ep,pn->en", load, at.N))
    loaded = replace(mesh, forces=np.where(mesh.codes != 0, 0.0, forces))
    field = equilibrium(PlateModel(loaded, plate, replace(rules(), assumes_shear=True)))
    monitor = FailureMonitor(PlyStresses(mesh, plate, gauss(3)), STRENGTHS)
    envelope = monitor.start()
    monitor.update(envelope, field[None], [0.0])
    number = list(CRITERIA).index({"max stress": "max_stress", "Tsai-Wu": "tsai_wu"}[name])
    exposure = envelope.plies.exposure[number].reshape(256, 9, 4, 2)
    element, _, layer, face = np.unravel_index(int(exposure.argmax()), exposure.shape)
    (row,) = (row for row in table("first_ply_failure_chain.csv") if row["criterion"] == name)
    assert 1.0 / exposure.max() == pytest.approx(float(row["q0 at first failure (Pa)"]), rel=2e-3)
    assert (int(layer) + 1, int(face)) == (4, 1)
    centre = mesh.coordinates[mesh.elements[element, 8] - 1]
    assert np.abs(centre - 0.1).max() < 0.2 / 16


def test_exposures_are_the_largest_of_all_stored_displacements() -> None:
    result = fecm.run_one(failing())
    (problem,) = load_deck(failing()).problems
    stresses = PlyStresses(problem.mesh, problem.laminate, problem.rules[2])
    ((card, *_),) = strengths_of_deck(problem.deck)
    assert card is not None
    rows = [stresses.evaluate(field) for field in result["tape3/displacement"]]
    for name, criterion in CRITERIA.items():
        histories = np.array(
            [
                exposure_of(criterion(card, row["sigma_1"], row["sigma_2"], row["tau_12"]))
                for row in rows
            ]
        )
        np.testing.assert_allclose(
            result[f"failure/{name}/exposure"], histories.max(axis=0), rtol=1e-12
        )
        assert set(np.unique(result[f"failure/{name}/time"])) <= {0.0, *result["tape3/time"]}


def test_exposures_of_a_run_have_a_row_for_every_nth_step_and_none_at_rest() -> None:
    assert fecm.run_one(failing(every=2))["exposures/step"].tolist() == [2, 4, 6, 8, 10]


def test_the_summary_names_criterion_mode_ply_place_and_time(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(failing())
    done = call("run", "d.inp", cwd=tmp_path)
    assert done.exit_code == 0
    (line,) = (line for line in done.stdout.splitlines() if "tsai wu" in line)
    for words in ("interactive", "ply", "at (", "time"):
        assert words in line
    # The four elements share the node under the load.
    assert "left out          4 points under the load" in done.stdout


def test_an_exposure_beyond_the_limit_exits_1_and_keeps_the_result(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(failing())
    assert call("run", "d.inp", "--fail-limit", "1e9", cwd=tmp_path).exit_code == 0
    done = call("run", "d.inp", "--fail-limit", "1e-9", "--overwrite", cwd=tmp_path)
    assert done.exit_code == 1
    assert "more than the limit of 1e-09" in done.stderr
    assert (tmp_path / "d.h5").exists()
    (tmp_path / "d.inp").write_text(small())
    done = call("run", "d.inp", "--fail-limit", "1", "--overwrite", cwd=tmp_path)
    assert (done.exit_code, "needs the macro FAIL" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("card", "code"),
    [
        ("   200000.  -200000.     7000.    28000.    13000.", "E455"),
        ("   200000.   200000.     7000.    28000.", "E455"),
    ],
)
def test_strengths_are_positive(card: str, code: str) -> None:
    text = failing().replace("   200000.   200000.     7000.    28000.    13000.", card)
    assert code in [finding.code for finding in load_deck(text).errors()]


def test_blank_shear_strengths_and_constants_take_their_defaults() -> None:
    deck = fecm.read_deck(failing())
    assert not isinstance(deck, list)
    card = deck.require(Allowables)
    assert (card.s12, card.s13, card.s23) == (13000.0, 13000.0, 13000.0)
    assert (card.f12, card.p_plus, card.p_minus) == (-0.5, 0.35, 0.3)
    again = fecm.read_deck(deck.to_text())
    assert again == deck
    zero = fecm.read_deck(failing().replace("13000.\n\n", "13000.\n       0.0       .25\n"))
    assert not isinstance(zero, list)
    assert zero.require(Allowables).f12 == 0.0
    assert zero.require(Allowables).p_plus == 0.25


def test_fail_needs_strengths_and_report_mode() -> None:
    without = failing().replace(ALLO, "EXPE")
    assert "E203" in [f.code for f in load_deck(without).errors()]
    actual = load_deck(failing(), mode="listing").errors()
    assert {f.code for f in actual} >= {"E603"}


def test_a_single_ply_has_exposures_and_no_interface() -> None:
    one = failing().replace("    2  90.     0.053\n", "").replace("0.     0.053", "0.     0.106")
    result = fecm.run_one(one.replace("   25    4    2", "   25    4    1"))
    assert result["failure/puck/exposure"].shape[2] == 1
    assert result["failure/puck/exposure"].max() > 0.0
    assert result["failure/interlaminar/exposure"].shape == (4, 0)


def test_interlaminar_exposures_of_elements_without_nine_nodes_are_nan() -> None:
    coordinates, elements = square(2, 2, 8)
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    plate = laminate(Ply(1.0, 0.3, 20.0, 1.0, 0.5, 0.5, 0.5), (0.0, 90.0), [0.1, 0.1])
    monitor = FailureMonitor(PlyStresses(mesh, plate, gauss(2)), STRENGTHS)
    envelope = monitor.start()
    field = np.random.default_rng(2).normal(size=(1, len(coordinates), 5))
    monitor.update(envelope, field, [1.0])
    assert np.isnan(envelope.interfaces.exposure).all()
    assert (envelope.plies.exposure > 0.0).any()


def test_a_sweep_evaluates_no_criteria_in_its_cases() -> None:
    (problem,) = load_deck(failing()).problems
    sink = MemorySink()
    simulate(without_output(problem), sink)
    groups = {name.split("/")[0] for name in sink.arrays}
    assert "history" in groups
    assert not groups & {"failure", "tape3", "tape8"}


def test_the_printed_summary_is_that_of_the_file(tmp_path: Path) -> None:
    text = failing().replace("ALLO\n", "DELA\n1.0E-3,\nALLO\n")
    (tmp_path / "d.inp").write_text(text.replace("         10", "        150"))
    done = call("run", "d.inp", "--format", "json", cwd=tmp_path)
    printed = json.loads(done.stdout)
    stored = json.loads(json.dumps(jsonable(about_run(fecm.load(tmp_path / "d.h5")))))
    assert {name: printed[name] for name in stored} == stored
    assert printed["metrics"]["failure"]["evaluations_in_contact"] > 20
    assert len(printed["summary"]) > 8
