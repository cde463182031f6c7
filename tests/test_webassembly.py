"""The kernel of sweeps as WebAssembly: compiled from these sources, and equal to the library."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.case import Case
from fecm.mechanics import kernels
from fecm.mechanics.kernels import stamp
from fecm.mechanics.kernels.webassembly import PATH, sources_of
from fecm.sweeps import reduced, responses
from tests.test_kernels import compiled
from tests.test_reduced_sweeps import DECK as STRETCHING
from tests.test_reduced_sweeps import ENOUGH, SPEEDS
from tests.test_sweep_kernels import ANY, DECK, FIRM, LAW, RIGID, RODS

BLOWS: list[Case] = [{"velocity": speed} for speed in SPEEDS]
ACR = DECK.replace(LAW, "EXPE ACR\n  1912000. 0.0006564")


def test_the_module_is_compiled_from_these_sources() -> None:
    assert sources_of(PATH.read_bytes()) == stamp(Path(kernels.__file__).parent)


def test_a_change_of_a_source_makes_the_module_stale(tmp_path: Path) -> None:
    for source in Path(kernels.__file__).parent.glob("*.[ch]"):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    with (tmp_path / "sweep.h").open("a") as file:
        file.write("/* another line */\n")
    assert sources_of(PATH.read_bytes()) != stamp(tmp_path)


@compiled
@pytest.mark.parametrize(
    ("deck", "cases", "options"),
    [
        (DECK, ANY, {}),
        (RIGID, ANY, {}),
        (DECK, RODS, {}),
        (ACR, FIRM, {}),
        (STRETCHING, BLOWS, {"model": "reduced", "modes": ENOUGH}),
    ],
    ids=["rod", "rigid-mass", "rods", "yang-sun", "stretching"],
)
def test_webassembly_gives_the_forces_of_the_library(
    deck: str, cases: list[Case], options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("wasmtime")
    from fecm.verification.webassembly import WasmKernel

    wanted = fecm.sweep(deck, cases=cases, history=True, **options)
    kernel, calls = WasmKernel(), 0

    def swept(*given: Any) -> None:
        nonlocal calls
        calls += 1
        (kernel.sweep_reduced if options else kernel.sweep_linear)(*given)

    monkeypatch.setattr(responses, "sweep_linear", swept)
    monkeypatch.setattr(reduced, "sweep_reduced", swept)
    actual = fecm.sweep(deck, cases=cases, history=True, **options)
    assert calls > 0
    assert actual.force is not None
    assert wanted.force is not None
    peaks = np.nanmax(wanted.force, axis=1)  # NaN after the end of a case
    assert (peaks > 1.0).all()
    np.testing.assert_allclose(actual.force, wanted.force, rtol=0.0, atol=1e-13 * peaks.max())
    for name in ("peak_force", "impulse", "max_indentation", "permanent_indentation"):
        np.testing.assert_allclose(actual[name], wanted[name], rtol=1e-11)
