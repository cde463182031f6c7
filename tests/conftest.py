"""What several test files share: results that are made once."""

from __future__ import annotations

import gc
import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.browser import Browser, find_browser

# Threads of BLAS beside several workers wait for each other; NumPy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A busy machine fails no example.
settings.register_profile("fecm", deadline=None)
settings.load_profile("fecm")


def beyond(cases: list[pytest.Item], count: int) -> list[pytest.Item]:
    """Return the cases of a family but for `count`, at equal distances from first to last."""
    step = (len(cases) - 1) / max(count - 1, 1)
    kept = {int(n * step + 0.5) for n in range(count)}
    return [case for n, case in enumerate(cases) if n not in kept]


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave most cases of a family to the long run, and skip what the system can't do."""
    families: dict[tuple[str, int], list[pytest.Item]] = defaultdict(list)
    for item in items:
        if (few := item.get_closest_marker("few")) and not item.get_closest_marker("long"):
            families[item.nodeid.partition("[")[0], *few.args].append(item)
    for (_, count), family in families.items():
        for item in beyond(family, count):
            item.add_marker(pytest.mark.long)
    posix = hasattr(os, "fork")
    can = {"posix": posix, "links": posix, "linux": posix and sys.platform == "linux"}
    for item in items:
        for name in (name for name, there in can.items() if not there):
            if marker := item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=f"not {marker.name} here"))


def pytest_collection_finish() -> None:
    """Keep the garbage collector from looking at modules and tests again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _few_pixels() -> Iterator[None]:
    """Draw pictures with few pixels."""
    with pytest.MonkeyPatch.context() as patch:
        if "matplotlib" in sys.modules:  # not without the extra for plots
            patch.setattr("fecm.plot.style.RESOLUTION", 50)
        yield


@pytest.fixture(scope="session", autouse=True)
def _no_waiting_for_disks() -> Iterator[None]:
    """Sync no file: only a loss of power would show it. A handle that is closed still fails."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", os.fstat)
        yield


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A headless browser."""
    program = find_browser()
    if program is None:
        pytest.skip("no Chromium or Chrome found")
    with Browser(program, tmp_path_factory.mktemp("profile")) as actual:
        yield actual


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with results of the report's deck in both modes, and of a small deck; left alone."""
    import fecm  # not in the process that only hands the tests out
    from tests.decks import APPENDIX, small

    folder = tmp_path_factory.mktemp("runs")
    for mode in ("report", "listing"):
        fecm.run(APPENDIX, mode=mode, output=folder / f"{mode}.h5")
    fecm.run(small(), output=folder / "small.h5")
    return folder
