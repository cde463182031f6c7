"""Results in Python: compared, looked for, indexed, joined with the caller's tables, printed."""

from __future__ import annotations

import copy
import importlib
import json
import pickle
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.results.metrics import METRICS, MetricAttributes
from fecm.sweeps.execute import SchedulerError
from tests.decks import DATA_CARDS, DISC, PLY_PROGRAM, ROOT, small
from tests.printed import text_of

UNITS = "UNIT\nin lbf s\n"
DECK = small(data=UNITS + DATA_CARDS)
SPEEDS: dict[str, list[float]] = {"velocity": [50.0, 115.0]}
MADE: dict[str, Callable[[], Any]] = {
    "run": lambda: fecm.run_one(DECK),
    "metrics": lambda: fecm.run_one(DECK).metrics,
    "sweep": lambda: fecm.sweep(DECK, SPEEDS, history=True),
    "random": lambda: fecm.sweep(DECK, random={"k": "normal:2e6,1e5"}, samples=16).random,
    "check": lambda: fecm.check(DECK),
    "problem": lambda: fecm.check(DECK).problems[0],
    "waves": lambda: fecm.waves(DECK),
    "fronts": lambda: fecm.waves(DECK).fronts([0.0, 45.0]),
    "dispersion": lambda: fecm.waves(DECK).dispersion(0.0, [1.0, 2.0]),
    "fit": lambda: fecm.fit_indentation(fecm.examples.path("indentation-test")),
    "pulse": lambda: fecm.pulse_test(DECK, ([0.0, 1e-4, 2e-4], [0.0, 100.0, 0.0])),
}


@pytest.mark.parametrize("kind", MADE)
@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_results_are_compared_and_looked_for_in_lists(kind: str) -> None:
    one, other = MADE[kind](), MADE[kind]()
    assert one == one
    assert (one == other) is not (one != other)
    assert [other, one].index(one) in (0, 1)
    assert one in [one]


def test_classes_of_the_api_that_hold_arrays_are_equal_only_to_themselves() -> None:
    page = text_of("api*.md")
    held = 0
    for name in re.findall(r"autoclass:: (\S+)", page):
        module, _, attribute = name.rpartition(".")
        kind = getattr(importlib.import_module(module), attribute)
        fields = {
            n: str(t) for k in kind.__mro__ for n, t in vars(k).get("__annotations__", {}).items()
        }
        if any(re.search(r"Floats|Array|Column|Bools|Ints", text) for text in fields.values()):
            held += 1
            assert kind.__eq__ is object.__eq__, name
            assert kind.__hash__ is object.__hash__, name
    assert held > 10


OBJECTS: dict[str, Callable[[], Any]] = {
    "text": lambda: fecm.Laminate("[0/90]s", "T300/5208"),
    "array": lambda: fecm.Laminate(np.array([0, 90, 90, 0]), "T300/5208", np.float64(0.125)),
    "generator": lambda: fecm.Laminate((angle for angle in (0, 90)), "T300/5208"),
    "tuples": lambda: fecm.Laminate([0, (90, "IM7/8552", 0.2)], "T300/5208"),
    "dictionaries": lambda: fecm.Laminate("[0C/90C]", {"C": "T300/5208"}, {"C": 0.125}),
    "plate": lambda: fecm.Plate.rectangle(tuple(np.array([100, 80])), (4, 4)),
    "fixture": lambda: fecm.Plate.on_fixture("D7136"),
    "contact": lambda: fecm.Contact(np.float64(2e6)),
    "sphere": lambda: fecm.Contact.estimate(radius=8),
    "named ply": lambda: fecm.materials()["T300/5208"],
    "named contact": lambda: fecm.contacts()["report-0.5"],
    "ply": lambda: fecm.Ply(1.6e-9, 0.3, 140e3, 9e3, 5e3, 5e3, 3e3),
    "mass": lambda: fecm.RigidMass(1e-3),
    "rod": lambda: fecm.Rod.cylinder(10.0, 0.5, 3e7, 7e-4),
    "deck": lambda: fecm.read_one(DECK),
}


@pytest.mark.parametrize("kind", OBJECTS)
def test_objects_of_a_deck_are_values(kind: str) -> None:
    one, other = OBJECTS[kind](), OBJECTS[kind]()
    copies = copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))
    for again in (other, *copies):
        assert again == one
        assert hash(again) == hash(one)
    assert one != 0
    assert len({one, other, *copies}) == 1


def test_a_laminate_of_a_sequence_of_any_kind_is_the_laminate_of_its_angles() -> None:
    angles = [0.0, 45.0, 90.0]
    asked = fecm.Laminate(tuple(angles), "T300/5208")
    held = np.array(angles)
    laminate = fecm.Laminate(held, "T300/5208")
    held[0] = 30.0
    for other in (
        laminate,
        *(fecm.Laminate(kind, "T300/5208") for kind in (angles, range(0, 91, 45))),
    ):
        assert other == asked
        assert repr(other).startswith("Laminate(layup=(0.0, 45.0, 90.0), ply=")
    inner = fecm.Laminate([[0, "IM7/8552"], [90, "IM7/8552", 0.2]])  # as JSON has it
    assert inner == fecm.Laminate([(0, "IM7/8552"), (90, "IM7/8552", 0.2)])
    with pytest.raises(ValueError, match="`layup` has the angle nan"):
        fecm.Laminate([float("nan")])


def test_an_angle_with_a_unit_is_refused() -> None:
    unit = pytest.importorskip("pint").UnitRegistry()
    with pytest.raises(
        ValueError, match="`layup` has the angle 45 degree; give a number of degrees"
    ):
        fecm.Laminate([unit.Quantity(45, "degree")])


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_jobs_and_results_are_copied_hashed_and_printed_in_a_line() -> None:
    sweep = fecm.Sweep(DECK, SPEEDS)
    for again in (copy.deepcopy(sweep), pickle.loads(pickle.dumps(sweep))):
        assert str(again) == str(sweep)
    result = fecm.run_one(DECK)
    held = [kind() for kind in MADE.values()]
    held += [fecm.estimate(DECK), fecm.diff(result, result), fecm.plate_model(DECK)]
    for one in held:
        if not isinstance(one, dict):
            assert isinstance(hash(one), int)
            assert pickle.loads(pickle.dumps(one)) is not one
    for one in (held[list(MADE).index("fit")], held[list(MADE).index("pulse")], held[-1]):
        assert re.fullmatch(r"<fecm .{20,80}>", repr(one))


def test_a_table_of_cases_keeps_the_index_of_the_caller() -> None:
    pandas = pytest.importorskip("pandas")
    tests = pandas.DataFrame({"name": ["A", "B", "C"], "velocity": [50.0, 75.0, 100.0]})
    tests = tests.sort_values("velocity", ascending=False)
    swept = fecm.sweep(DECK, cases=tests[["velocity"]])
    table = swept.to_dataframe()
    assert table.index.equals(tests.index)
    joined = tests.assign(at=table["velocity"], force=table["peak_force"])
    assert joined["at"].tolist() == joined["velocity"].tolist() == [100.0, 75.0, 50.0]
    named = fecm.sweep(DECK, cases=tests.set_index("name")).to_dataframe()
    assert named.index.name == "name"
    assert named.loc["A", "velocity"] == 50.0
    plain = fecm.sweep(DECK, cases=tests[["velocity"]].reset_index(drop=True)).to_dataframe()
    assert (plain.index.name, plain.index.tolist()) == ("case", [0, 1, 2])


def test_metrics_are_attributes_with_units() -> None:
    result = fecm.run_one(DECK)
    metrics = result.metrics
    assert tuple(MetricAttributes.__annotations__) == tuple(METRICS)
    for name, value in metrics.items():
        np.testing.assert_equal(getattr(metrics, name), value)
        np.testing.assert_equal(getattr(result, name), value)
        assert metrics.unit(name) == result.unit(name)
        assert name in dir(result)
    assert result.metrics.unit("impulse") == "lbf*s"
    assert json.loads(json.dumps(metrics)).keys() == dict(metrics).keys()
    for again in (pickle.loads(pickle.dumps(metrics)), copy.deepcopy(metrics)):
        assert again.units == metrics.units
        assert type(again) is type(metrics)
    shown = str(metrics).splitlines()
    assert re.fullmatch(r"max_indentation +not known +largest indentation", shown[8])
    assert re.search(r"impulse +not known", str(metrics))
    over = fecm.run_one(fecm.examples.path("impact-patch"))
    assert re.search(r"peak_force +85.01 lbf +largest contact force", str(over.metrics))
    modes = fecm.run_one(over.deck.with_program("LMAS\nEIGE,,1"))
    assert str(modes.metrics) == "no impact metrics: the run has no impact steps"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("peakforce", "did you mean peak_force or"),
        ("max_force", "did you mean peak_force or"),
        ("peak", "did you mean first_peak or peak_contact or peak_force or time_of_peak?"),
        ("absorbed_energy", "did you mean energy_absorbed?"),
        ("first_failure", "did you mean first_failures or"),
        ("metric", "did you mean metrics?"),
        ("forse", "did you mean history/force or"),
        ("threshold_force", "add DELA to the deck"),
        ("failure", "add FAIL to the deck's program"),
    ],
)
def test_an_unknown_attribute_of_a_result_gets_the_names_that_it_may_mean(
    asked: str, message: str
) -> None:
    with pytest.raises(AttributeError, match=re.escape(message)):
        getattr(fecm.run_one(DECK), asked)


def test_results_say_that_they_are_used_by_names() -> None:
    result, sweep = fecm.run_one(DECK), fecm.sweep(DECK, SPEEDS)
    with pytest.raises(TypeError, match=r"fecm\.run_one returns one result, and fecm\.run a list"):
        result[0]  # type: ignore[index]
    with pytest.raises(TypeError, match=r"columns by name; rows are in to_dataframe\(\)"):
        sweep[0:2]  # type: ignore[index]
    with pytest.raises(KeyError, match=r"peak_force is a metric, .* write result\.peak_force"):
        result["peak_force"]
    with pytest.raises(KeyError, match="did you mean first_peak or peak_contact or peak_force"):
        result.metrics["peak"]
    with pytest.raises(AttributeError, match="did you mean contact_time"):
        sweep.contact_tim  # type: ignore[attr-defined]  # noqa: B018
    np.testing.assert_array_equal(sweep.contact_time, sweep["contact_time"])  # type: ignore[attr-defined]
    assert pickle.loads(pickle.dumps(sweep)).keys() == sweep.keys()
    assert "peak_force" in dir(sweep)


def test_printed_waves_have_the_velocities_of_their_fronts() -> None:
    waves = fecm.waves(fecm.Laminate("[0/90]s", "AS4/8552", 0.13))
    lines = str(waves).splitlines()
    assert lines[0] == "waves in a laminate of 0.52 mm"
    assert lines[1].split()[:4] == ["front", "normal", "at", "0"]
    velocity = waves.fronts([0.0]).velocity[0, 0]
    assert lines[2].split()[:3] == ["extension", f"{velocity:.4g}", "mm/s"]
    assert repr(waves) == "<fecm waves in a laminate of 0.52 mm>"


def test_forces_of_a_sweep_have_times_where_all_cases_have_one_time_step() -> None:
    pytest.importorskip("xarray")
    arrays = fecm.sweep(DECK, SPEEDS, history=True).to_xarray()
    np.testing.assert_allclose(arrays.time, fecm.run_one(DECK).time, rtol=1e-12)
    assert arrays.force.sel(step=3).time == pytest.approx(1.5e-6)
    assert arrays.time.attrs["units"] == "s"
    steps = {"dt": [4e-7, 5e-7]}
    assert "time" not in fecm.sweep(DECK, steps, history=True).to_xarray().coords


def test_statistics_without_varied_values_are_numbers(tmp_path: Path) -> None:
    laws = {"k": "normal:2e6,1e5"}
    swept = fecm.sweep(DECK, random=laws, samples=16, output=tmp_path / "s.h5")
    for result in (swept, fecm.load_sweep(tmp_path / "s.h5")):
        assert result.random is not None
        statistics = result.random.statistics["impulse"]
        assert np.isscalar(statistics.mean)
        assert np.isscalar(statistics.draws)


class BreakingPool(Executor):
    """Pool that breaks after some tasks, as one does whose processes can't import the script."""

    def __init__(self, tasks: int) -> None:
        self.tasks = tasks

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future[Any]:  # type: ignore[override]
        """Compute the first tasks."""
        future: Future[Any] = Future()
        self.tasks -= 1
        if self.tasks < 0:
            future.set_exception(BrokenProcessPool("a process was terminated abruptly"))
        else:
            future.set_result(function(*arguments))
        return future


PLATES = {"layup": ["[0/90]", "[90/0]", "[0]"]}  # a task each


def test_a_pool_that_breaks_ends_a_sweep_without_a_file(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with pytest.raises(SchedulerError, match=r"broke .*: call|broke .* under `if __name__"):
        fecm.sweep(DECK, PLATES, executor=BreakingPool(0), output=path)
    assert not list(tmp_path.iterdir())


def test_a_sweep_whose_pool_breaks_keeps_the_cases_that_are_done(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with pytest.raises(SchedulerError, match=r"after 1 of 3 cases; the same call resumes"):
        fecm.sweep(DECK, PLATES, executor=BreakingPool(1), output=path)
    assert not path.exists()
    with pytest.raises(SchedulerError, match=r"after 2 of 3 cases"):
        fecm.sweep(DECK, PLATES, executor=BreakingPool(1), output=path)
    resumed = fecm.sweep(DECK, PLATES, output=path)
    np.testing.assert_array_equal(resumed["impulse"], fecm.sweep(DECK, PLATES)["impulse"])
    assert [file.name for file in tmp_path.iterdir()] == ["s.h5"]


SCRIPT = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
import fecm
with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
    fecm.sweep("small.inp", {"velocity": [50.0, 115.0]}, executor=pool, output="s.h5")
"""


@pytest.mark.long
def test_a_script_with_a_pool_and_without_a_guard_fails_with_the_guard_in_its_message(
    tmp_path: Path,
) -> None:
    (tmp_path / "small.inp").write_text(DECK)
    (tmp_path / "script.py").write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert 'calls fecm under `if __name__ == "__main__":`' in done.stderr
    assert not (tmp_path / "s.h5").exists()


def test_the_package_is_imported_from_a_zip_file(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "fecm.zip", "w") as packed:
        for file in (ROOT / "fecm").rglob("*.py*"):
            if file.suffix in (".py", ".pyi"):
                packed.write(file, file.relative_to(ROOT))
    code = "import fecm; print(fecm.__file__, fecm.Ply.__name__, 'run_one' in dir(fecm))"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, 'fecm.zip'); {code}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [str(Path("fecm.zip") / "fecm" / "__init__.py"), "Ply", "True"]


ENERGY = "UNIT\nmm N s\n"
METRIC = small(data=ENERGY + DATA_CARDS)


def test_ranges_and_units_are_read_alike_in_python_and_on_the_command_line() -> None:
    text = fecm.sweep(METRIC, ["velocity=50:115:3", "mass=1kg,2kg"])
    mapping = fecm.sweep(METRIC, {"velocity": "50:115:3", "mass": "1kg,2kg"})
    assert text["velocity"].tolist() == mapping["velocity"].tolist()
    assert text["mass"].tolist() == mapping["mass"].tolist() == [1e-3, 2e-3] * 3
    energies = fecm.Sweep(METRIC, {"energy": "1J:5J:5"}).all_cases
    assert [case["energy"] for case in energies] == [1000.0, 2000.0, 3000.0, 4000.0, 5000.0]
    mixed = fecm.Sweep(METRIC, {"energy": ["1J:5J:3", "8J", 9.0]}).all_cases
    assert [case["energy"] for case in mixed] == [1000.0, 3000.0, 5000.0, 8000.0, 9.0]
    layups = fecm.Sweep(METRIC, {"layup": "[0/90],[90/0]"}).all_cases
    assert [case["layup"] for case in layups] == ["[0/90]", "[90/0]"]
    dense = fecm.Sweep(METRIC, {"density": ["1.6g/cm^3"], "k": ["2e4N/mm^1.5"]}).all_cases
    assert dense == ({"density": 1.6e-9, "k": 2e4},)


@pytest.mark.parametrize(
    "until", ["0.006kN", {"peak_force": "6N"}, {"peak_force": 6.0}, {"peak_force": "6"}]
)
def test_levels_of_searches_have_units(until: Any) -> None:
    job = fecm.Sweep(METRIC, {"k": [1e6]}, until=until)
    assert job.plan.settings.search is not None
    assert job.plan.settings.search.level == 6.0


def test_levels_of_probabilities_have_units() -> None:
    job = fecm.Sweep(METRIC, random={"k": "normal:2e6,1e5"}, samples=16, exceed="peak_force=0.1kN")
    assert job.plan.limits[0].value == 100.0
    with pytest.raises(ValueError, match="not a number or one with a unit, as in 6kN"):
        fecm.Sweep(METRIC, {"k": [1e6]}, until={"peak_force": "6kg"})


def test_thicknesses_of_plies_have_units() -> None:
    thin = fecm.Laminate("[0/90]s", "AS4/8552", "131um")
    assert thin.thickness == fecm.Laminate("[0/90]s", "AS4/8552", 0.131).thickness == 0.524
    assert fecm.Laminate([(0, "AS4/8552", "0.2mm")]).thickness == 0.2
    with pytest.raises(ValueError, match="`ply_thickness` is '1kg', not a number or one with"):
        fecm.Laminate("[0/90]s", "AS4/8552", "1kg")


def test_several_values_are_not_one_value_of_a_deck() -> None:
    deck = fecm.read_one(METRIC)
    for values in ([50.0, 60.0], np.array([50.0, 60.0])):
        with pytest.raises(ValueError, match=r"velocity is one value, .* fecm\.sweep runs a"):
            deck.with_(velocity=values)  # type: ignore[arg-type]


def test_times_of_ply_stresses_have_units() -> None:
    result = fecm.run_one(small(PLY_PROGRAM, data=DISC + ENERGY + DATA_CARDS))
    assert result.plies(time="2.5us").step.tolist() == [5]
    assert result.plies(time=["2.5us", 5e-6]).step.tolist() == [5, 10]
    with pytest.raises(ValueError, match="`time` is '1kg'"):
        result.plies(time="1kg")
