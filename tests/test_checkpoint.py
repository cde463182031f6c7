"""Stopped runs go on from their checkpoints to the same bytes, or say why not."""

from __future__ import annotations

import contextlib
import json
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from fecm.mechanics import kernels
from fecm.problem.loading import load_deck
from fecm.results import hdf5_writer
from fecm.results.sinks import RowBuffer
from fecm.simulation.checkpoint import Checkpointer, CheckpointError, checkpoint_of, spool_of
from fecm.simulation.run import run_program as simulate_run
from fecm.simulation.simulation import Simulation
from tests.calls import call
from tests.decks import DATA_CARDS, MESH, small
from tests.stopped_runs import StoppedError, run, stop_at_once

# Two problems' worth of words in one: nested loops, loads, a change of the time step, gages.
WORDS = """\
LMAS
DT        .5E-6
PROP          1
LOOP          3
LOOP         50
TIME
RODP          7
DISP          5
NEXT
REAC
STRE
DT        .4E-6
NEXT
CHEC
LOOP         40
TIME
EXCD
NEXT
"""
TABLE = "    1    1       0.0       1.0     100.0\n"
LOADED = (
    "FORC\n    8    0       0.0       0.0       1.0\n\n"
    "GAGE\n1, 0.5, 0.5, 0.053, 45.\n\nPROJ\n3, 0, 1.0, 30.E6, .0006875\n1, 1, 0.2\n3, 0, 0.6\n\n"
)


def deck(program: str = WORDS) -> str:
    """A small deck that uses many words."""
    text = small(program, data=LOADED + DATA_CARDS, stop=False)
    return f"{text}{TABLE}STOP\n" if "PROP" in program else f"{text}STOP\n"


@pytest.mark.parametrize(
    ("slips", "stops"),
    [
        ("", [1, 97, 190]),
        ("rod-dt tapes reload", [50]),
        ("counter prop-contact rod-force", [150]),
        *(pytest.param(slips, range(1, 191, 3), marks=pytest.mark.long)
          for slips in ("", "rod-dt tapes reload", "counter prop-contact rod-force")),
    ],
)  # fmt: skip
@pytest.mark.few(1)  # of 3, 0.6 s each
def test_a_run_stopped_anywhere_goes_on_to_the_same_bytes(
    tmp_path: Path, slips: str, stops: Sequence[int]
) -> None:
    whole = tmp_path / "whole.h5"
    looks = run(deck(), whole, slips=slips)
    assert looks == 3 * 50 + 40
    for stop in stops:
        path = tmp_path / "stopped.h5"
        with pytest.raises(StoppedError):
            run(deck(), path, stop, slips=slips)
        assert not path.exists()
        # StoppedError once more on the way, and then not any more.
        if stop < looks - 3:
            with pytest.raises(StoppedError):
                run(deck(), path, 3, resume=True, slips=slips)
        run(deck(), path, resume=True, slips=slips)
        assert path.read_bytes() == whole.read_bytes(), f"stopped at {stop}"
        assert sorted(p.name for p in tmp_path.iterdir()) == ["stopped.h5", "whole.h5"]
        path.unlink()


@pytest.mark.parametrize(
    ("cure", "first"),
    [("", 6), ("CURE\n-9.,\n,1.E-6,2.E-5\n\n", 1)],
    ids=["", "cure"],
)
@pytest.mark.few(1)  # of 2, 1 s each
def test_a_stopped_run_with_a_patch_and_stresses_goes_on_to_the_same_bytes(
    cure: str, first: int, tmp_path: Path
) -> None:
    words = f"PATC\nHERT,.3\nSHEA MITC\nALLO\n2e5,2e5,7e3,28e3,13e3\n\n{cure}"
    program = "LMAS\nDT,,.5E-6\nLOOP,,12\nTIME\nRODP,,4\nPLYS,,3,2\nFAIL,,2\nNEXT\n"
    text = small(program, data=DATA_CARDS + words)
    looks = run(text, tmp_path / "whole.h5")
    for stop in range(first, looks + 1, 4):
        path = tmp_path / "stopped.h5"
        with pytest.raises(StoppedError):
            run(text, path, stop)
        run(text, path, resume=True)
        assert path.read_bytes() == (tmp_path / "whole.h5").read_bytes(), f"stopped at {stop}"
        path.unlink()


# The corners hold the plate, so that it has a static displacement.
LAST = "   25    0    1    1    0    0    0\n"
HELD = MESH.replace(
    LAST, LAST + "".join(f"{node:5d}    0    1    1    1    0    0\n" for node in (1, 5, 21, 25))
)

# Passes of loops that step, solve, leave early or do nothing.
STATIC = """\
TANG
LOOP          2
LOOP          4
FORM
SOLV
CONV
DISP
NEXT
LOOP          2
NEXT
REAC
NEXT
LMAS
DT        .5E-6
LOOP          2
TIME
RODP          2
NEXT
"""


@pytest.mark.long
def test_a_run_stopped_between_any_two_macros_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    text = small(STATIC, mesh=HELD, data=LOADED + DATA_CARDS)
    whole, path = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    looks = run(text, whole, macros=True)
    # 2 passes of a static loop, left in its second pass by CONV, of 2 empty ones and of REAC; LMAS
    # and DT; 4 macros in steps; the loops themselves. CONV that leaves is the end of its loop, and
    # so is the last of the empty passes.
    first = 4 + 2
    assert looks == 1 + (first + 1 + 2 + 1) + (2 + 1 + 2 + 1) + 1 + 2 + 4 + 1
    for stop in range(1, looks + 1):
        with pytest.raises(StoppedError):
            run(text, path, stop, macros=True)
        run(text, path, resume=True, macros=True)
        assert path.read_bytes() == whole.read_bytes(), f"stopped at {stop}"
        path.unlink()


def test_a_checkpoint_of_another_run_is_refused_and_says_why(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    for text, slips, why in (
        (deck(WORDS.replace(".5E-6", ".3E-6")), "", "another deck"),
        (deck(), "density", "another mode or other slips"),
    ):
        with pytest.raises(CheckpointError, match=why):
            run(text, path, resume=True, slips=slips)
    stored = checkpoint_of(path).read_bytes()
    checkpoint_of(path).write_bytes(stored[: len(stored) // 2])
    with pytest.raises(CheckpointError, match="damaged"):
        run(deck(), path, resume=True)
    checkpoint_of(path).write_bytes(stored)
    spool_of(path).write_bytes(spool_of(path).read_bytes()[:-9])
    with pytest.raises(CheckpointError, match="damaged, or was written by another run"):
        run(deck(), path, resume=True)
    checkpoint_of(path).unlink()
    with pytest.raises(CheckpointError, match="there is no checkpoint"):
        run(deck(), path, resume=True)
    assert not path.exists()


def test_a_checkpoint_of_another_solver_says_which_one_continues_it(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5, solver="numpy")
    with pytest.raises(CheckpointError, match=r"numpy, not csr\): --solver numpy continues it"):
        run(deck(), path, resume=True, solver="csr")


@pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")
def test_a_checkpoint_of_the_kernels_says_that_an_installation_lacks_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    monkeypatch.setattr(kernels, "LIBRARY", None)
    with pytest.raises(CheckpointError, match="compiled kernels, which this installation lacks"):
        run(deck(), path, resume=True)


@pytest.mark.parametrize("place", [0.02, 0.5, 0.999])
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_a_spool_with_one_other_bit_is_refused(tmp_path: Path, place: float) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 60)
    spool = bytearray(spool_of(path).read_bytes())
    spool[int(place * len(spool))] ^= 1
    spool_of(path).write_bytes(spool)
    with pytest.raises(CheckpointError, match="damaged, or was written by another run"):
        run(deck(), path, resume=True)
    assert not path.exists()


@pytest.mark.parametrize("lost", ["about", "identity", "values", "plate", "length", "recorder"])
@pytest.mark.few(2)  # of 6, 0.1 s each
def test_a_checkpoint_that_lacks_something_is_refused(tmp_path: Path, lost: str) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    with np.load(checkpoint_of(path)) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(arrays.pop("about").tobytes())
    about.pop(lost, None)
    about["spool"].pop(lost, None)
    kept = {name: array for name, array in arrays.items() if lost not in name}
    if lost != "about":
        kept["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with checkpoint_of(path).open("wb") as file:
        np.savez(file, **kept)
    with pytest.raises(CheckpointError, match="damaged"):
        run(deck(), path, resume=True)


def altered(path: Path, change: str) -> None:
    """Write a checkpoint that fits its spool and its run, but for one value or array."""
    with np.load(checkpoint_of(path)) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(arrays.pop("about").tobytes())
    text = ""
    match change:
        case "deep":
            text = "[" * 100_000
        case "stored":
            about["values"]["recorder/rows/energy/stored"] = -1
        case "place":
            about["values"]["state/position"] = [[0, 1]]
        case "words":
            about["values"]["state/dt"] = "soon"
        case "shape":
            arrays["state/plate/padded"] = arrays["state/plate/padded"][:1]
        case "type":
            arrays["state/plate/padded"] = arrays["state/plate/padded"].astype("S8")
        case "spool":
            line = b'{"do": "write", "path": "tape3/w", "start": -1, "rows": 1, "dtype": "<f8", '
            line += b'"shape": [-1]}\n' + b"[" * 100_000 + b"\n"
            spool_of(path).write_bytes(line)
            about["spool"] = {"length": len(line), "checksum": zlib.crc32(line)}
    message = np.frombuffer((text or json.dumps(about)).encode(), np.uint8)
    pack = np.savez_compressed if change == "compressed" else np.savez
    with checkpoint_of(path).open("wb") as file:
        pack(file, about=message, **arrays)


@pytest.mark.parametrize(
    "change", ["deep", "stored", "place", "words", "shape", "type", "spool", "compressed"]
)
@pytest.mark.few(3)  # of 8, 0.1 s each
def test_a_checkpoint_that_was_made_up_is_refused_in_one_line(
    tmp_path: Path, change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = deck()
    Path("d.inp").write_text(text)
    problem = load_deck(text).problems[0]
    with pytest.raises(StoppedError):
        stop_at_once(problem, Path("d.h5"))
    altered(Path("d.h5"), change)
    done = call("run", "d.inp", "--resume")
    assert done.exit_code == 2
    assert re.search(r"d\.h5\.(checkpoint|spool).*--overwrite without --resume", done.stderr)
    assert not Path("d.h5").exists()


@pytest.mark.links
@pytest.mark.parametrize(
    "name", ["run.h5.spool", "run.h5.checkpoint", ".run.h5.partial.checkpoint"]
)
@pytest.mark.few(1)  # of 3, 0.2 s each
def test_a_planted_link_leads_no_checkpoint_elsewhere(tmp_path: Path, name: str) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / name).symlink_to(victim)
    with pytest.raises(StoppedError):
        run(deck(), tmp_path / "run.h5", 5)
    assert victim.read_text() == "precious"
    run(deck(), tmp_path / "run.h5", resume=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "victim"]


def test_a_spool_without_a_checkpoint_is_gone_once_the_next_run_begins(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    with hdf5_writer.result_writing(path, overwrite=True) as sink:
        Checkpointer(path, sink)
        assert spool_of(path).exists()  # its checkpoint may be resumed
        checkpoint_of(path).unlink()
        Checkpointer(path, sink)
        assert not spool_of(path).exists()


@pytest.mark.links
def test_a_spool_that_became_a_link_is_not_followed(tmp_path: Path) -> None:
    with pytest.raises(StoppedError):
        run(deck(), tmp_path / "run.h5", 5)
    spool = spool_of(tmp_path / "run.h5")
    spool.rename(tmp_path / "elsewhere")
    spool.symlink_to("elsewhere")
    with pytest.raises(OSError, match=r"run\.h5\.spool"):
        run(deck(), tmp_path / "run.h5", resume=True)


def test_a_checkpoint_that_can_not_be_written_leaves_the_one_before_in_force(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RowBuffer, "BYTES", 1)  # so that rows are stored all the time
    whole, path = tmp_path / "whole.h5", tmp_path / "run.h5"
    run(deck(), whole)
    looks: list[str] = []

    def savez(*arguments: object, **arrays: object) -> None:
        raise OSError(28, "No space left on device")

    def look(simulation: Simulation) -> None:
        looks.append("")
        if len(looks) in (20, 60):
            checkpointer.write(simulation)
        if len(looks) == 40:  # the spool is written, the checkpoint is not
            with monkeypatch.context() as patch:
                patch.setattr(np, "savez", savez)
                with pytest.raises(OSError, match="No space"):
                    checkpointer.write(simulation)
        if len(looks) == 70:
            raise StoppedError

    with contextlib.suppress(StoppedError), hdf5_writer.result_writing(path) as sink:
        checkpointer = Checkpointer(path, sink)
        simulation = Simulation(load_deck(deck()).problems[0], sink, observers=(look,))
        simulation.interval = 1
        simulate_run(simulation)
    assert len(looks) == 70
    run(deck(), path, resume=True)
    assert path.read_bytes() == whole.read_bytes()


def test_a_checkpoint_of_another_version_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    monkeypatch.setattr("fecm.simulation.checkpoint.__version__", "99.0")
    with pytest.raises(CheckpointError, match="another version"):
        run(deck(), path, resume=True)
