"""Contact laws, failure criteria and projectiles of users."""

from __future__ import annotations

import pickle
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib import invalidate_caches
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import trapezoid

import fecm
from fecm.authoring.case import CasesError
from fecm.cli.interrupts import signals
from fecm.judge.criteria import ALL_CRITERIA
from fecm.mechanics.failure import puck
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.projectile import OwnProjectile
from fecm.problem.parts import build_law, build_projectile
from fecm.simulation.job import Solver
from tests.calls import assert_unusable, call
from tests.decks import LONG, PROGRAM, small
from tests.test_first_failure import failing

Floats = NDArray[np.float64]
Trial = Callable[[Any, fecm.ContactPoint, float], Any]
# The small plate until the force has passed its peak.
CONTACT = small(PROGRAM.replace("LOOP         10", "LOOP        240"))
SOLVERS: list[Solver] = ["numpy"] if LIBRARY is None else ["numpy", "kernels"]


class Dented:
    """F = k a^1.5 up to the largest indentation, and from a dent on below it."""

    k, share = 1.9e6, 0.1

    def start(self) -> tuple[float, None]:
        """The largest indentation, and nothing else."""
        return 0.0, None

    def trial(
        self, memory: tuple[float, None], last: fecm.ContactPoint, indentation: float
    ) -> tuple[float, tuple[float, None]]:
        """First loading, or the curve from the dent on."""
        largest, a = memory[0], max(indentation, 0.0)
        if a >= largest:
            return self.k * a**1.5, memory
        dent = self.share * largest
        return self.k * (largest * max(a - dent, 0.0) / (largest - dent)) ** 1.5, memory

    def accept(
        self, memory: tuple[float, None], last: fecm.ContactPoint, indentation: float
    ) -> tuple[float, None]:
        """Remember the largest."""
        return max(memory[0], indentation), None

    def permanent(self, memory: tuple[float, None], last: fecm.ContactPoint) -> float:
        """The dent."""
        return self.share * memory[0]


class Wrapped:
    """The law of a deck, as one of a user."""

    def __init__(self, deck: fecm.Deck) -> None:
        law = build_law(deck)
        self.start, self.accept, self.permanent = law.start, law.accept, law.permanent
        self.trial: Trial = law.trial


class Faulty(Dented):
    """A law whose force is that of a function beyond an indentation."""

    def __init__(self, force: Callable[[float], Any], beyond: float = 1e-4) -> None:
        self.force, self.beyond = force, beyond

    def trial(self, memory: Any, last: fecm.ContactPoint, indentation: float) -> Any:
        """The force of the function."""
        if indentation <= self.beyond:
            return super().trial(memory, last, indentation)
        return self.force(indentation), memory


def norris(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Floats:
    """Square root of a quadratic criterion."""
    x, y = np.where(s1 > 0.0, ply.xt, ply.xc), np.where(s2 > 0.0, ply.yt, ply.yc)
    square = (s1 / x) ** 2 - s1 * s2 / (x * y) + (s2 / y) ** 2 + (tau / ply.s12) ** 2
    return np.asarray(np.sqrt(square))


def copied_puck(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Mapping[str, Floats]:
    """The exposures of a built-in criterion."""
    return dict(puck(ply, s1, s2, tau))


class Bodies:
    """A projectile of these matrices."""

    def __init__(self, mass: ArrayLike, stiffness: ArrayLike) -> None:
        self.m, self.k = mass, stiffness

    def mass(self) -> ArrayLike:
        """Masses."""
        return self.m

    def stiffness(self) -> ArrayLike:
        """Springs."""
        return self.k


@pytest.fixture(scope="module")
def deck() -> fecm.Deck:
    """An impact past its peak force."""
    return fecm.read_one(CONTACT)


@pytest.fixture(scope="module")
def damaged() -> fecm.Deck:
    """A small plate with FAIL."""
    return fecm.read_one(failing())


# Contact laws -------------------------------------------------------------------------------------


def forces(deck: fecm.Deck, law: Any, *velocities: float) -> Floats:
    """Contact forces of a sweep, (velocities, steps)."""
    swept = fecm.sweep(deck, {"velocity": list(velocities)}, history=True, law=law)
    assert swept.force is not None
    return swept.force


def test_a_sweep_gives_the_cases_of_a_users_law_as_runs_do(deck: fecm.Deck) -> None:
    actual = forces(deck, Dented(), 50.0, 115.0)
    for velocity, force in zip([50.0, 115.0], actual, strict=True):
        alone = fecm.run_one(deck.with_(velocity=velocity), law=Dented()).force
        np.testing.assert_allclose(force, alone, rtol=1e-9, atol=1e-9)


def test_the_law_of_the_deck_gives_the_same_as_a_users_law(deck: fecm.Deck) -> None:
    own, of_deck = (forces(deck, law, 50.0, 115.0) for law in (Wrapped(deck), None))
    np.testing.assert_allclose(own, of_deck, rtol=1e-9, atol=1e-9)


class Counting(Dented):
    """A law whose memory counts the trials, on which the force depends."""

    def start(self) -> Any:
        """No trial yet."""
        return 0

    def trial(self, memory: Any, last: fecm.ContactPoint, indentation: float) -> Any:
        """A force that grows with each trial."""
        return (self.k + 100.0 * memory) * max(indentation, 0.0) ** 1.5, memory + 1

    def accept(self, memory: Any, last: fecm.ContactPoint, indentation: float) -> Any:
        """The trials so far."""
        return memory

    def permanent(self, memory: Any, last: fecm.ContactPoint) -> float:
        """The law is elastic."""
        return 0.0


def test_a_sweep_asks_no_more_trials_of_a_case_than_its_own_run(deck: fecm.Deck) -> None:
    # The iterations of both cases take different numbers of passes.
    actual = forces(deck, Counting(), 115.0, 600.0)
    np.testing.assert_allclose(actual[0], fecm.run_one(deck, law=Counting()).force, rtol=1e-9)


@pytest.mark.parametrize(
    ("law", "fault"),
    [
        (object(), "law object has no method start, trial, accept, permanent"),
        (Dented, "law Dented is a class; pass an object of it: law=Dented()"),
        (Faulty(lambda a: np.nan), "law Faulty: the force is nan at the indentation"),
        (Faulty(lambda a: 10**400), "law Faulty: the force is inf at the indentation"),
        (Faulty(lambda a: (-a) ** 1.5), r"the force is \(.*j\), not a real number at"),
        (Faulty(lambda a: 1.0 / 0.0), "trial failed with ZeroDivisionError: .* at the indentation"),
        (Faulty(lambda a: np.zeros(2)), r"the force is array\(\[0., 0.\]\), not a real number"),
        (Faulty(lambda a: -a, -1.0), ""),
    ],
)
def test_a_faulty_law_is_blamed_by_its_name_and_indentation(
    deck: fecm.Deck, law: Any, fault: str
) -> None:
    if not fault:  # a force of any sign is a law
        assert fecm.run_one(deck, law=law).attributes["law"] == "Faulty"
        return
    with pytest.raises(fecm.LawError, match=fault):
        fecm.run_one(deck, law=law)


def test_a_law_without_a_pair_is_refused_before_the_run(deck: fecm.Deck) -> None:
    with pytest.raises(fecm.LawError, match=r"trial returned 0\.0, not a pair"):
        fecm.run_one("no deck at all\n", law=_without_memory())


def _without_memory() -> Any:
    law = Dented()
    law.trial = lambda memory, last, indentation: 0.0  # type: ignore[assignment,method-assign,return-value]
    return law


def test_a_law_that_fails_in_one_case_fails_that_case_alone(deck: fecm.Deck) -> None:
    law = Faulty(lambda a: np.nan, 9e-4)
    swept = fecm.sweep(deck, {"velocity": [20.0, 115.0]}, law=law)
    assert swept.completed.tolist() == [True, False]
    assert "contact law Faulty: the force is nan at the indentation 0.0009" in swept["status"][1]
    assert np.isnan(swept["peak_force"][1])


def test_a_law_too_stiff_for_the_time_step_diverges_and_is_named() -> None:
    law = Faulty(lambda a: 1e14 * a**1.5, 0.0)
    with pytest.raises(fecm.DivergenceError, match="the stiffness of the contact law Faulty"):
        fecm.run_one(fecm.read_one(LONG).with_(duration=2e-4), law=law)


@pytest.mark.parametrize("name", ["k", "alpha_p", "s_p", "q"])
def test_constants_that_a_users_law_replaces_can_neither_vary_nor_be_fitted(
    deck: fecm.Deck, name: str
) -> None:
    fault = f"Dented takes the place of EXPE, so that {name} would change nothing"
    with pytest.raises(CasesError, match=fault):
        fecm.sweep(deck, {name: [0.1, 0.2]}, law=Dented())
    with pytest.raises(CasesError, match=fault):
        fecm.identify(deck, [0.0, 1e-5, 2e-5], [0.0, 1.0, 2.0], [name], law=Dented())


@pytest.mark.long
def test_a_fit_under_a_users_law_finds_the_velocity_it_was_computed_with(deck: fecm.Deck) -> None:
    measured = fecm.run_one(deck.with_(velocity=100.0), law=Dented())
    fit = fecm.identify(deck, measured.time, measured.force, ["velocity"], law=Dented())
    assert fit.values["velocity"] == pytest.approx(100.0, rel=1e-4)
    assert fit.law == "Dented"
    with pytest.raises(fecm.FecmError, match="contact law Faulty: the force is nan"):
        fecm.identify(
            deck, measured.time, measured.force, ["velocity"], law=Faulty(lambda a: np.nan)
        )


def test_a_result_says_which_law_it_has(deck: fecm.Deck, tmp_path: Path) -> None:
    path = tmp_path / "own.h5"
    fecm.run_one(deck, law=Dented(), output=path)
    assert fecm.load(path).attributes["law"] == "Dented"
    assert "contact law       Dented, instead of EXPE" in call("info", path).stdout
    fecm.sweep(deck, {"velocity": [115.0]}, law=Dented(), output=tmp_path / "sweep.h5")
    assert fecm.load_sweep(tmp_path / "sweep.h5").law == "Dented"
    assert "contact law       Dented, instead of EXPE" in call("info", tmp_path / "sweep.h5").stdout


# Failure criteria ---------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.few(1)  # of 2, 0.4 s each
def test_fail_evaluates_a_users_criterion_as_its_own(damaged: fecm.Deck, solver: Solver) -> None:
    result = fecm.run_one(damaged, criteria=[norris, copied_puck], solver=solver)
    own, known = (result[f"failure/{name}/exposure"] for name in ("copied_puck", "puck"))
    np.testing.assert_allclose(own, known, rtol=1e-12, atol=1e-18)
    at = np.unravel_index(np.nanargmax(known), known.shape)
    modes = result.attributes_of("failure")["modes"]
    own_mode, mode = (result[f"failure/{n}/mode"][at] for n in ("copied_puck", "puck"))
    assert modes[own_mode] == modes[mode] == "inter-fibre A"
    assert modes[result["failure/norris/mode"].max()] == "norris"
    rows = result["exposures/exposure"]
    count = len(ALL_CRITERIA)
    assert rows.shape[1] == count + 2
    np.testing.assert_allclose(rows[:, -1], rows[:, ALL_CRITERIA.index("puck")], rtol=1e-12)
    before = fecm.run_one(damaged, solver=solver)
    np.testing.assert_array_equal(before["exposures/exposure"], rows[:, :count])


def test_a_users_criterion_is_in_the_file_and_in_the_summary(
    damaged: fecm.Deck, tmp_path: Path
) -> None:
    path = tmp_path / "own.h5"
    fecm.run_one(damaged, criteria=[norris], output=path)
    answer = call("info", path, "--format", "json")
    assert answer.exit_code == 0
    again = fecm.load(path)
    assert again["failure/norris/exposure"].shape == again["failure/puck/exposure"].shape
    assert "norris" in call("info", path).stdout
    again.save(tmp_path / "copy.h5")
    assert call("diff", path, tmp_path / "copy.h5").exit_code == 0


def _zero(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Floats:
    return np.asarray(s1 / s2)


def _scalar(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return 1.0


def _other_modes(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return {"late" if s1.any() else "early": s1}


def _raising(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    raise KeyError("xt")


def _complex(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return np.abs(s1) / ply.xt + 1j


def _boolean(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return s1 > ply.xt


def _huge(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return np.full(s1.shape, 10**400, dtype=object)


def _negative(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return {"fibre": s1 / ply.xt - 1.0, "matrix": s2 / ply.yt - 2.0}


def _many_modes(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return {f"mode {number}": np.abs(s1) for number in range(300)}


def _with_nul(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
    return {"a\0b": np.abs(s1)}


def _five() -> list[Any]:
    """Criteria that together have more modes than codes."""

    def named(name: str) -> Any:
        def criterion(ply: fecm.Strengths, s1: Floats, s2: Floats, tau: Floats) -> Any:
            return {f"{name} {number}": np.abs(s1) for number in range(32)}

        criterion.__name__ = name
        return criterion

    return [named(f"own_{number}") for number in range(5)]


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ([_zero], "_zero returned nan for sigma_1 = 0, sigma_2 = 0, tau_12 = 0"),
        ([_scalar], r"_scalar returned an array of the shape \(\) for stresses of \(1, 1\)"),
        ([_other_modes], "returned the mode 'late', and without stress early"),
        ([_complex], r"_complex returned array\(\[\[0.\+1.j\]\]\), not real numbers"),
        ([_boolean], r"_boolean returned array\(\[\[False\]\]\), not real numbers"),
        ([_huge], "_huge returned .*, not real numbers"),
        ([_negative], "returned -1 for sigma_1 = 0, .*; return 0 where the criterion does not"),
        ([_many_modes], "_many_modes returned 300 modes; at most 32 are allowed"),
        ([_with_nul], r"returned the mode 'a\\x00b'; the names of modes are printable texts"),
        (_five(), "the failure criteria have 171 modes; at most 127 are allowed"),
        ([_raising], "_raising failed with KeyError: 'xt'"),
        ([lambda *a: 1.0], "a function with a name is needed"),
        ([norris, norris], "norris: there is another one of this name"),
        ([puck], "puck: there is another one of this name"),
        ([5], "int is 5, not a function"),
        ("norris", "criteria is 'norris'; pass a list"),
    ],
)
def test_a_faulty_criterion_is_named_with_its_fault(
    damaged: fecm.Deck, given: Any, fault: str
) -> None:
    with pytest.raises(fecm.CriterionError, match=fault):
        fecm.run_one(damaged, criteria=given)


def test_criteria_need_a_program_that_evaluates_them(deck: fecm.Deck) -> None:
    with pytest.raises(ValueError, match="criteria norris: the program of the deck has no FAIL"):
        fecm.run_one(deck, criteria=[norris])


# Projectiles --------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_projectile_of_one_mass_moves_as_a_rigid_mass(deck: fecm.Deck, solver: Solver) -> None:
    mass = 2e-4
    by_card = fecm.run_one(_rigid(deck, mass), solver=solver)
    result = fecm.run_one(deck, projectile=Bodies([mass], [[0.0]]), solver=solver)
    known = fecm.run_one(deck, projectile=fecm.RigidMass(mass), solver=solver)
    np.testing.assert_array_equal(known.force, by_card.force)
    np.testing.assert_allclose(result.force, by_card.force, rtol=1e-9, atol=1e-9)
    own_energy, energy = result.energy.projectile_kinetic, by_card.energy.projectile_kinetic
    np.testing.assert_allclose(own_energy, energy, rtol=1e-9)
    assert result.attributes["projectile"] == "Bodies"
    assert known.attributes["projectile"] == "RigidMass"


def _rigid(deck: fecm.Deck, mass: float) -> fecm.Deck:
    text = deck.to_text().replace("\nEXPE", f"\nPROJ\n{0:5d}{0:5d}{mass:10.3g}\nEXPE")
    return fecm.read_one(text)


@pytest.mark.parametrize("solver", SOLVERS)
def test_two_masses_and_a_spring_keep_energy_and_momentum(deck: fecm.Deck, solver: Solver) -> None:
    m, k = 1e-4, 1e6
    result = fecm.run_one(deck, projectile=Bodies([m, m], [[k, -k], [-k, k]]), solver=solver)
    energy = result.energy
    initial = 0.5 * 2.0 * m * 115.0**2
    assert result.attributes_of("energy")["initial"] == pytest.approx(initial, rel=1e-12)
    assert np.abs(energy.balance_error).max() < 1e-4 * initial
    assert energy.projectile_strain.max() > 1e-3 * initial
    # The impulse of the force is the change of the momentum of both masses.
    bodies = result.energy.projectile_kinetic[-1]
    impulse = trapezoid(result.force, result.time)
    mean = impulse / (2.0 * m) - 115.0  # of both velocities at the end
    assert bodies >= 0.5 * 2.0 * m * mean**2


def test_a_rod_replaces_that_of_a_deck_with_its_own_transducer() -> None:
    short = fecm.Rod.cylinder(1.0, 0.6, 3e7, 7e-4, elements=4)
    long, by_card = (_with_rod(elements, node) for elements, node in ((20, 21), (4, 3)))
    own, same = fecm.run_one(long, projectile=short), fecm.run_one(by_card)
    np.testing.assert_array_equal(own.force, same.force)
    np.testing.assert_array_equal(own.history.transducer, same.history.transducer)
    assert own.attributes["projectile"] == "Rod"


def _with_rod(elements: int, node: int) -> fecm.Deck:
    """A deck with a rod of these elements, whose transducer is at a node."""
    rod = f"PROJ\n{elements:5d}{node:5d}       1.0      3.E7     7.E-4\n"
    diameters = f"    1    1       0.6\n{elements:5d}    0       0.6\n\n"
    text = fecm.read_one(LONG).with_(duration=4e-5).to_text()
    return fecm.read_one(text.replace("\nEXPE", f"\n{rod}{diameters}EXPE"))


def test_kernels_and_numpy_move_a_users_projectile_alike(deck: fecm.Deck) -> None:
    springs = [[3e5, -3e5, 0.0], [-3e5, 5e5, -2e5], [0.0, -2e5, 2e5]]
    bodies = Bodies([[5e-5, 1e-6, 0.0], [1e-6, 6e-5, 0.0], [0.0, 0.0, 9e-5]], springs)
    first, *others = (fecm.run_one(deck, projectile=bodies, solver=s) for s in SOLVERS)
    for other in others:
        np.testing.assert_allclose(other.force, first.force, rtol=1e-8, atol=1e-8)


def test_the_rigid_motion_of_a_users_projectile_is_that_of_all_its_dofs(deck: fecm.Deck) -> None:
    own = OwnProjectile(Bodies([1.0, 2.0, 3.0], np.zeros((3, 3)) + _chain(3)))
    assert own.total_mass == 6.0
    assert build_projectile(deck).rigid.tolist() == [1.0, 0.0] * 21
    assert own.kinetic_energy(np.full((1, 3), 2.0)).tolist() == [12.0]


def _chain(n: int) -> Floats:
    """Springs of stiffness 1 between neighbours."""
    step = np.diff(np.eye(n), axis=0)
    return np.asarray(step.T @ step)


@pytest.mark.parametrize(
    ("mass", "stiffness", "fault"),
    [
        ([1.0, 2.0], [[1.0, -1.0], [-1.0, 2.0]], "has the force 1 per displacement at dof 2"),
        ([1.0], [[1.0]], "something holds it, and a projectile flies freely"),
        ([0.0, 1.0], _chain(2), "mass is not positive definite"),
        ([1.0, 1.0, 1.0], [[1, -1, 0], [-1, 1, 0], [0, 0, 0]], "two of its parts unconnected"),
        ([1.0, 1.0], -_chain(2), "stiffness has a negative eigenvalue"),
        ([1.0, 1.0], [[1.0, 2.0, 3.0]], r"stiffness has the shape \(1, 3\), not \(2, 2\)"),
        (3.0, [[0.0]], r"mass has the shape \(\), not \(n,\) or \(n, n\)"),
        ([[1.0, 0.5], [0.0, 1.0]], _chain(2), "mass is not symmetric"),
        ([np.nan], [[0.0]], "mass has an entry that is not finite"),
        ("heavy", [[0.0]], "mass failed with ValueError"),
    ],
)
def test_matrices_of_no_free_body_are_refused(
    deck: fecm.Deck, mass: Any, stiffness: Any, fault: str
) -> None:
    with pytest.raises(fecm.ProjectileError, match=f"projectile Bodies: .*{fault}"):
        fecm.run_one(deck, projectile=Bodies(mass, stiffness))


def test_a_mass_that_is_lost_beside_the_stiffness_is_refused(deck: fecm.Deck) -> None:
    fault = "the mass of the projectile is lost beside its stiffness in a time step of"
    with pytest.raises(fecm.ProjectileError, match=fault):
        fecm.run_one(deck, projectile=Bodies([1e-300, 1e-300], _chain(2)))


def test_a_projectile_that_is_none_is_refused(deck: fecm.Deck) -> None:
    given: Any
    for given, fault in ((object(), "it has no method mass"), (Bodies, "Bodies is a class")):
        with pytest.raises(fecm.ProjectileError, match=fault):
            fecm.run_one(deck, projectile=given)


# Names of installed packages ----------------------------------------------------------------------

PACKAGE = """
from tests.test_extensions import Dented, norris
made = Dented()
def broken(): raise RuntimeError("no licence")
"""
ENTRY_POINTS = """
[fecm.laws]
dented = installed_laws:Dented
made = installed_laws:made
broken = installed_laws:broken
missing = installed_laws:nothing
[fecm.criteria]
norris = installed_laws:norris
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package with entry points, as installers leave one."""
    site = tmp_path / "site"
    about = site / "installed_laws-1.0.dist-info"
    about.mkdir(parents=True)
    (site / "installed_laws.py").write_text(PACKAGE)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: installed-laws\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(site)
    invalidate_caches()
    (tmp_path / "deck.inp").write_text(CONTACT)
    (tmp_path / "damaged.inp").write_text(failing())
    yield tmp_path
    sys.modules.pop("installed_laws", None)


@pytest.mark.parametrize("name", ["dented", "made"])
def test_a_law_of_an_installed_package_has_a_name(installed: Path, name: str) -> None:
    result = fecm.run_one(CONTACT, law=name)
    np.testing.assert_array_equal(result.force, fecm.run_one(CONTACT, law=Dented()).force)
    assert result.attributes["law"] == name


def test_commands_take_laws_and_criteria_by_name(installed: Path) -> None:
    done = call("run", "deck.inp", "--law", "dented", cwd=installed)
    assert done.exit_code == 0
    assert "contact law       dented, instead of EXPE" in done.stdout
    swept = ("sweep", "deck.inp", "--vary", "velocity=50,115", "--history", "-o", "s.h5")
    done = call(*swept, "--law", "dented", cwd=installed)
    assert done.exit_code == 0
    forces, single = (
        fecm.load_sweep(installed / "s.h5").force,
        fecm.load(installed / "deck.h5").force,
    )
    assert forces is not None
    assert forces[1, : len(single)] == pytest.approx(single, rel=1e-9)
    given = ("--criterion", "norris", "--fail-limit", "1e-9")
    done = call("run", "damaged.inp", *given, cwd=installed)
    assert done.exit_code == 1
    assert "of norris" in done.stderr


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("dentde", "no installed package offers the contact law 'dentde'; .* did you mean dented"),
        ("missing", "'missing' of installed_laws:nothing can't be imported"),
        ("broken", r"nor makes one without arguments \(RuntimeError: no licence\)"),
    ],
)
def test_a_name_without_a_law_is_refused(installed: Path, name: str, fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        fecm.run_one(CONTACT, law=name)
    done = call("run", "deck.inp", "--law", name, cwd=installed)
    assert_unusable(done)
    assert not (installed / "deck.h5").exists()


@pytest.mark.long
def test_an_interrupted_run_with_a_law_and_criteria_resumes_to_the_same_bytes(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = ("--law", "dented", "--criterion", "norris")
    assert call("run", "damaged.inp", *own, "-o", "whole.h5", cwd=installed).exit_code == 0
    with monkeypatch.context() as patched:
        patched.setattr(signals, "received", signal.SIGINT)
        stopped = call("run", "damaged.inp", *own, "-o", "part.h5", cwd=installed)
    assert stopped.exit_code == 130
    other = call("run", "damaged.inp", "-o", "part.h5", "--resume", cwd=installed)
    assert "belongs to a run with another contact law" in other.stderr
    done = call("run", "damaged.inp", *own, "-o", "part.h5", "--resume", cwd=installed)
    assert done.exit_code == 0
    assert (installed / "part.h5").read_bytes() == (installed / "whole.h5").read_bytes()


@pytest.mark.parametrize(
    "error",
    [
        fecm.LawError("law"),
        fecm.CriterionError("criterion"),
        fecm.ProjectileError("projectile"),
        fecm.ExtensionError("name"),
    ],
)
def test_the_errors_survive_pickling(error: fecm.FecmError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), again.args) == (type(error), error.args)
