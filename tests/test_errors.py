"""Errors of the package, wherever they are raised: here, or in another process."""

from __future__ import annotations

import copy
import importlib
import inspect
import multiprocessing
import pickle
import pkgutil
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor

import pytest

import fecm
from fecm import DeckError, DivergenceError
from fecm.deck.findings import CardPlace, Finding
from tests.decks import small

FINDING = Finding(
    "E013", "The deck has no FECM.", CardPlace(1, 1, 8, "nonsense", "FECM"), "Begin so."
)
# Arguments of the classes that do not take one text.
ARGUMENTS: dict[type[BaseException], tuple[object, ...]] = {
    DeckError: ([FINDING], "plate.inp"),
    DivergenceError: (7, "w is not finite"),
}


def error_classes() -> Iterator[type[BaseException]]:
    """Every class of an error or a warning that a module of the package defines."""
    for module in pkgutil.walk_packages(fecm.__path__, "fecm."):
        if module.name == "fecm.__main__" or module.name.endswith(".libfecm"):
            continue
        for value in vars(importlib.import_module(module.name)).values():
            is_error = inspect.isclass(value) and issubclass(value, BaseException)
            if is_error and value.__module__ == module.name:
                yield value


CLASSES = list(error_classes())


def test_the_errors_of_all_rooms_are_found() -> None:
    rooms = {kind.__module__.split(".")[1] for kind in CLASSES}
    assert rooms >= {"_errors", "_files", "cli", "deck", "mechanics", "plot", "results", "sweeps"}
    assert set(CLASSES) >= {fecm.FecmError, fecm.FecmWarning, *ARGUMENTS}


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__qualname__)
@pytest.mark.parametrize("protocol", [0, pickle.HIGHEST_PROTOCOL])
def test_every_error_is_the_same_after_pickling(kind: type[BaseException], protocol: int) -> None:
    error = kind(*ARGUMENTS.get(kind, ("what is wrong",)))
    error.add_note("in case 3")
    for again in (pickle.loads(pickle.dumps(error, protocol)), copy.copy(error)):
        assert type(again) is kind
        assert (str(again), again.args) == (str(error), error.args)
        assert vars(again) == vars(error)


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__qualname__)
def test_every_error_is_made_by_its_own_new_as_dask_does(kind: type[BaseException]) -> None:
    assert type(kind.__new__(kind, "what is wrong")) is kind


def test_every_error_of_a_public_function_has_a_name_in_fecm_errors() -> None:
    public = [
        kind
        for kind in CLASSES
        if issubclass(kind, fecm.FecmError) and not kind.__module__.startswith("fecm.cli")
    ]
    assert {getattr(fecm.errors, kind.__name__, None) for kind in public} == set(public)
    assert {kind.__name__ for kind in public} == set(fecm.errors.__all__)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: fecm.run(small(), mode="lsiting"), "OptionsError"),  # type: ignore[arg-type]
        (lambda: fecm.run(small(), solver="kernel"), "OptionsError"),  # type: ignore[arg-type]
        (lambda: fecm.run(small(), threads=-1), "OptionsError"),
        (lambda: fecm.run(small(), rod_mass="heavy"), "OptionsError"),  # type: ignore[arg-type]
        (lambda: fecm.examples.path("impact-116"), "OptionsError"),
        (lambda: fecm.sweep(small(), {"velocty": [1.0]}), "CasesError"),
        (lambda: fecm.run_one(small())["tape4/w"], "NotStoredError"),
        (lambda: fecm.Laminate("[0]", "IM7/8551", 0.1), "ObjectError"),
        (lambda: fecm.Plate.from_mesh(([[0, 0]], [[0, 1, 2]])), "MeshError"),
    ],
)
def test_a_wrong_argument_raises_an_error_that_can_be_named(
    call: Callable[[], object], name: str
) -> None:
    with pytest.raises(getattr(fecm.errors, name)) as caught:
        call()
    assert isinstance(caught.value, fecm.FecmError)


def test_the_error_of_a_mesh_is_public() -> None:
    # The estimate of a mesh's error had its name: `except` took it for no exception.
    try:
        fecm.Plate.from_mesh("no-such.msh")
    except fecm.MeshError:
        pytest.fail("a missing file is not a bad mesh")
    except (OSError, ImportError):
        pass
    assert fecm.MeshError is fecm.errors.MeshError


def test_an_object_can_be_compared_with_the_protocols() -> None:
    class Linear:
        def start(self) -> None: ...
        def trial(self, memory: None, last: object, indentation: float) -> None: ...
        def accept(self, memory: None, last: object, indentation: float) -> None: ...
        def permanent(self, memory: None, last: object) -> None: ...

    assert isinstance(Linear(), fecm.Law)
    assert not isinstance(Linear(), fecm.LinearProjectile)
    assert not isinstance(3.0, fecm.Law | fecm.FailureCriterion)


def test_a_bad_deck_leaves_the_other_tasks_of_a_process_pool_alone() -> None:
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        bad = pool.submit(fecm.run_one, "nonsense\n")
        good = pool.submit(fecm.run_one, small())
        with pytest.raises(fecm.DeckError) as caught:
            bad.result()
        assert good.result().force.max() == fecm.run_one(small()).force.max()
    with pytest.raises(fecm.DeckError) as here:
        fecm.run_one("nonsense\n")
    assert caught.value.findings == here.value.findings
    assert caught.value.source == here.value.source
