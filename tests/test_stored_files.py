"""Files of runs, sweeps and locations hold what the schema says, and nothing else."""

from __future__ import annotations

import dataclasses
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm._errors import ResultFileError
from fecm.results.hdf5_reader import read
from fecm.results.hdf5_writer import result_writing
from fecm.results.schema import FILES, Form, dataset_of
from fecm.results.sinks import MemorySink
from tests.decks import LONG, small
from tests.panels import TIME, scatter, struck
from tests.test_reduced_strains import DECK as REDUCED

ROOT = Path(__file__).resolve().parents[1]
LAWS = {"velocity": "normal:100,5", "k": "lognormal:1.9e6,.15"}
ONE = {"velocity": "normal:100,5"}
SHARES = {"peak_force": [70.0, 85.0]}
Saved = fecm.Result | fecm.SweepResult | fecm.Location


def located() -> fecm.Location:
    """The impact of the small panel."""
    deck, strains, _ = struck()
    noisy = scatter(strains, 0.02, seed=1)[0]
    return fecm.locate(deck, (TIME, noisy), region=(40.0, 30.0, 80.0, 65.0), grid=20.0, basis=9e-6)


SWEEPS: dict[str, Callable[[], fecm.SweepResult]] = {
    "grid": lambda: fecm.sweep(LONG, {"velocity": [50.0, 115.0], "k": [1e6, 2e6]}, history=True),
    "cases": lambda: fecm.sweep(
        small(), cases=[{"size": "2x1", "Fmax (kN)": 1}, {"size": "2x2", "Fmax (kN)": 2}]
    ),
    "random": lambda: fecm.sweep(LONG, random=LAWS, samples=16, exceed=SHARES),
    "combined": lambda: fecm.sweep(LONG, {"k": [1e6]}, random=ONE, samples=16, exceed=SHARES),
    "sensitivity": lambda: fecm.sweep(
        LONG, random=LAWS, samples=16, design="sobol", sensitivity=True
    ),
    "find": lambda: fecm.sweep(LONG, {"k": [1e6]}, until={"peak_force": 60.0}),
    "refine": lambda: fecm.sweep(small(), refine=[1, 2]),
    "reduced": lambda: fecm.sweep(
        REDUCED, {"velocity": [300.0]}, model="reduced", modes=4, measure=("failure", "gages")
    ),
}
FORMS: dict[str, tuple[Form, Callable[[], Saved]]] = {
    "run": (Form.RUN, lambda: fecm.run_one(fecm.examples.path("impact-patch"))),
    **{name: (Form.SWEEP, made) for name, made in SWEEPS.items()},
    "location": (Form.LOCATION, located),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of each kind, by name."""
    folder = tmp_path_factory.mktemp("stored")
    paths = {name: folder / f"{name}.h5" for name in FORMS}
    for name, (_, made) in FORMS.items():
        made().save(paths[name])
    return paths


@pytest.mark.parametrize("name", FORMS)
def test_every_dataset_of_a_file_is_in_the_schema_of_its_form(
    files: dict[str, Path], name: str
) -> None:
    form, _ = FORMS[name]
    contents = read(files[name], form)
    assert contents.shapes
    for path, shape in contents.shapes.items():
        known = dataset_of(path, len(shape), form)
        assert known is not None, path
        assert len(known.shape) == len(shape), path
        attributes = contents.attributes_of(path)
        assert attributes["description"] == known.description, path
        if form is not Form.SWEEP or not path.startswith(
            ("cases/", "measured/")
        ):  # those follow the value
            assert attributes.get("dimension", "") == known.dimension, path
        if known.dtype not in ("any", "numbers", "texts"):
            assert contents.dtypes[path] == np.dtype(known.dtype), path
        assert (path in contents.lists) <= (known.dtype in ("any", "texts")), path


@pytest.mark.parametrize("form", [Form.SWEEP, Form.LOCATION])
def test_every_dataset_of_the_schema_is_in_some_file(files: dict[str, Path], form: Form) -> None:
    stored = {
        path
        for name, (own, _) in FORMS.items()
        if own is form
        for path in read(files[name], form).shapes
    }
    patterns = {
        f"{group}/*{rest}"
        for path in stored
        for group, _, tail in [path.partition("/")]
        for rest in [f"/{tail.partition('/')[2]}" if "/" in tail else ""]
    }
    assert FILES[form].datasets.keys() <= stored | patterns


@pytest.mark.parametrize("name", FORMS)
def test_every_group_of_a_file_is_described_as_in_the_schema(
    files: dict[str, Path], name: str
) -> None:
    form, _ = FORMS[name]
    with h5py.File(files[name]) as file:
        for path, description in FILES[form].groups.items():
            if path in file:
                assert file[path].attrs["description"] == description, path


@pytest.mark.parametrize(
    ("form", "path"),
    [
        (Form.RUN, "history/colour"),
        (Form.RUN, "cases/velocity"),
        (Form.RUN, "failure/mine/colour"),
        (Form.SWEEP, "history/colour"),
        (Form.SWEEP, "tape3/w"),
        (Form.SWEEP, "sensitivity/peak_force/second"),
        (Form.SWEEP, "cases"),
        (Form.LOCATION, "locate/colour"),
        (Form.LOCATION, "history/force"),
    ],
)
def test_a_dataset_that_is_not_in_the_schema_is_not_written(
    tmp_path: Path, form: Form, path: str
) -> None:
    target, known = tmp_path / "some.h5", next(iter(FILES[form].datasets.values()))
    message = rf"{path} is not in the schema of {form}"
    with pytest.raises(ValueError, match=message), result_writing(target, form) as sink:
        sink.store(path, np.zeros(3))
    with pytest.raises(ValueError, match=message), result_writing(target, form) as sink:
        sink.create(dataclasses.replace(known, path=path), (3,))
    assert not target.exists()


def test_a_result_in_memory_has_only_datasets_of_the_schema() -> None:
    known = FILES[Form.RUN].datasets["tape3/w"]
    with pytest.raises(ValueError, match="tape3/colour is not in the schema"):
        MemorySink().create(dataclasses.replace(known, path="tape3/colour"), (3, 2))


def test_the_page_of_datasets_is_that_of_the_schema() -> None:
    code = [sys.executable, "docs/datasets.py", "/dev/stdout"]
    page = subprocess.run(code, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert page == (ROOT / "docs/datasets.md").read_text("utf-8")
    # One row for each dataset of each form.
    assert page.count("\n| `/") == sum(len(file.datasets) for file in FILES.values())


@pytest.mark.parametrize(
    ("name", "path", "values"),
    [
        ("run", "history/force", np.ones(3)),
        ("run", "history/step", np.ones(3)),
        ("grid", "cases/velocity", np.ones(3)),
        ("grid", "summary/peak_force", np.ones((4, 1))),
        ("grid", "summary/validity", np.ones(4)),
        ("grid", "history/force", np.ones(4)),
        ("grid", "history/steps", np.ones(4)),
        ("grid", "history/dt", np.ones(4, dtype="i8")),
        ("location", "locate/place", np.ones(3)),
        ("location", "locate/strains/fitted", np.ones((3, 2))),
        ("location", "locate/gages/number", np.ones(3)),
    ],
)
def test_a_file_whose_dataset_has_another_shape_or_type_is_refused(
    files: dict[str, Path], tmp_path: Path, name: str, path: str, values: object
) -> None:
    damaged = tmp_path / "damaged.h5"
    shutil.copy(files[name], damaged)
    with h5py.File(damaged, "a") as file:
        del file[path]
        file[path] = values
    load = {"run": fecm.load, "location": fecm.load_location}.get(name, fecm.load_sweep)
    with pytest.raises(ResultFileError, match=rf"^{damaged}: "):
        load(damaged)


def test_a_name_takes_the_description_and_the_dimension_of_its_quantity() -> None:
    statistics = dataset_of("statistics/peak_force", 1, Form.SWEEP)
    assert statistics is not None
    assert statistics.description == (
        "draws with a value, and their statistics: largest contact force"
    )
    assert (statistics.dimension, statistics.shape) == ("force", ("statistics",))
    combined = dataset_of("statistics/peak_force", 2, Form.SWEEP)
    assert combined is not None
    assert combined.shape == ("combinations", "statistics")
    gage = dataset_of("summary/gage_3", 1, Form.SWEEP)
    assert gage is not None
    assert (gage.description, gage.dimension) == ("largest absolute strain of gage 3", "")


def test_a_dataset_of_another_version_is_kept_when_a_result_is_saved_anew(tmp_path: Path) -> None:
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    fecm.run(small(), output=first)
    with h5py.File(first, "a") as file:
        file["history/colour"] = np.array([1.5, 2.5])
    fecm.load(first).save(second)
    with h5py.File(second) as file:
        assert file["history/colour"][()].tolist() == [1.5, 2.5]
