"""Errors of the package, wherever they are raised: here, or in another process."""

from __future__ import annotations

import copy
import importlib
import inspect
import multiprocessing
import pickle
import pkgutil
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

import pytest

import fecm
from fecm.deck.findings import DeckError, Finding, Place
from fecm.mechanics.plate_motion import DivergenceError
from tests.decks import small

FINDING = Finding("E013", "The deck has no FECM.", Place(1, 1, 8, "nonsense", "FECM"), "Begin so.")
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
