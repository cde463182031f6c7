"""Files that never end, or would take all memory or time, are refused."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

import fecm
from fecm import FecmError, _inputs
from fecm._inputs import InputError, parsed_toml, read_input
from fecm.authoring.parameters import parameter_in_units
from fecm.mechanics.joints import coincident, representatives, sides_of_cells
from fecm.problem.plate_mesh import read_mesh
from fecm.studies.rod_test.filters import recorded
from fecm.sweeps.case_tables import parse_vary
from tests.calls import call
from tests.decks import LONG

SECONDS = 5


@pytest.fixture(autouse=True)
def alarm() -> Iterator[None]:
    """End a command that waits for a file, where the system has alarms."""
    if not hasattr(signal, "alarm"):
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise AssertionError(f"longer than {SECONDS} s")

    signal.signal(signal.SIGALRM, ring)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)


NEW = (
    "new", "-", "--layup", "[0/90]s", "--units", "mm-N-s", "--ply-thickness", 0.5,
    "--material", "AS/3501", "--support", "clamped", "--velocity", 1000, "--mesh",
)  # fmt: skip
COMMANDS = {
    "mesh": NEW,
    "measurement": ("identify", "--free", "k", LONG),
    "materials": ("materials",),
    "tolerances": ("diff", LONG, LONG, "--tol-file"),
    "history": ("rod", "filter", "--filter", "cfc:60"),
    "cases": ("sweep", LONG, "-o", "s.h5", "--cases"),
}


@pytest.mark.links
@pytest.mark.parametrize("name", COMMANDS)
def test_a_pipe_without_a_writer_is_no_file_to_read(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe.msh")
    done = call(*COMMANDS[name], "pipe.msh")
    assert done.exit_code == 2
    assert "pipe.msh is not a regular file" in done.stderr


@pytest.mark.links
@pytest.mark.parametrize("name", COMMANDS)
def test_a_device_is_no_file_to_read(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("zero.msh").symlink_to("/dev/zero")
    done = call(*COMMANDS[name], "zero.msh")
    assert done.exit_code == 2
    assert "zero.msh is not a regular file" in done.stderr


def test_a_file_larger_than_any_that_is_meant_is_refused_before_it_is_read(tmp_path: Path) -> None:
    vast = tmp_path / "vast.csv"
    with vast.open("wb") as file:
        file.truncate(_inputs.LARGEST + 1)  # takes no room on the disk
    done = call(*COMMANDS["measurement"], vast)
    assert done.exit_code == 2
    assert "vast.csv has 1 GB; no more than 1 GB are read" in done.stderr


def test_a_file_that_memory_does_not_hold_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm._machine.available_memory", lambda: 200_000_000)
    path = tmp_path / "large.csv"
    with path.open("wb") as file:
        file.truncate(20_000_000)
    with pytest.raises(MemoryError, match="240 MB of memory, and 200 MB are free"):
        read_input(path)


def test_a_file_of_plies_that_is_too_long_is_not_read_in_part(tmp_path: Path) -> None:
    plies = tmp_path / "plies.toml"
    plies.write_text("#" * 1_000_000 + '\n["X"]\n')
    done = call("materials", plies)
    assert done.exit_code == 2
    assert "no more than 1 MB are read" in done.stderr
    with pytest.raises(InputError):
        read_input(plies, 1_000_000)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (".".join("a" * 50_000) + " = 1", "line 1 has more than 100 dots"),
        ("b = 1\n[" + ".".join("a" * 50_000) + "]", "line 2 has more than 100 dots"),
        ("a = " + "[" * 50_000, "nested too deeply"),
        ("a = " + "{a = " * 20_000, "nested too deeply"),
    ],
    ids=["key", "header", "list", "table"],
)
@pytest.mark.parametrize("name", ["materials", "tolerances"])
def test_deeply_nested_toml_is_refused_at_once(
    text: str, message: str, name: str, tmp_path: Path
) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(text)
    done = call(*COMMANDS[name], path)
    assert done.exit_code == 2
    assert message in done.stderr


def test_toml_as_people_write_it_is_read() -> None:
    key = ".".join("a" * 100)
    assert parsed_toml(f'source = "Tab. 3.1, p. 12, cf. ref. 4."\n{key} = 1.5')["source"]


LONG_RUNS: dict[
    str, tuple[str, str, Callable[[Path], object]]
] = {  # a reader of quadratic time takes minutes
    "blank lines": ("a.msh", "\n" * 100_000, read_mesh),
    "digits": ("a.bdf", "GRID,1,," + "1" * 3_000 + "x,0.,0.", read_mesh),
    "blanks in a name": ("a.bdf", "INCLUDE a" + " " * 100_000 + "b", read_mesh),
    "commas": ("a.inp", "*Node\n1" + "," * 100_000 + "x\n*Element, type=S4\n1, 1", read_mesh),
    "words": ("a.inp", "*Nset, nset=a" + ", generate" * 20_000, read_mesh),
    "brackets": ("a.csv", "time," + "(" * 100_000 + "\n0,0\n1,x\n", recorded),
    "nested list": ("a.toml", "[" * 500_000, fecm.materials),
}


@pytest.mark.parametrize("name", LONG_RUNS)
def test_a_file_of_one_repeated_character_is_refused_at_once(name: str, tmp_path: Path) -> None:
    file, text, read = LONG_RUNS[name]
    (tmp_path / file).write_text(text)
    with pytest.raises((FecmError, ValueError), match=file):
        read(tmp_path / file)


def test_a_physical_group_with_a_long_name_is_refused_before_meshio_reads_it(
    tmp_path: Path,
) -> None:
    text = '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 1 "' + "a" * 20_000
    (tmp_path / "a.msh").write_text(text)
    with pytest.raises(FecmError, match=r"a\.msh has a physical group with a name of more than"):
        read_mesh(tmp_path / "a.msh")


@pytest.mark.parametrize(
    "read",
    [
        lambda: parse_vary("velocity=" + "," * 100_000 + "x"),
        lambda: parse_vary("velocity=1:2:" + "9" * 5000),
        lambda: parameter_in_units("length", "1" * 100_000 + "!", "length", "mm-N-s"),
    ],
    ids=["commas", "digits of a count", "digits of a value"],
)
def test_a_long_value_is_refused_at_once(read: Callable[[], object]) -> None:
    with pytest.raises(FecmError):
        read()


def test_many_nodes_in_one_place_take_no_pair_for_each_two_of_them() -> None:
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    places = np.concatenate([corners, np.tile(corners[2], (30_000, 1)), [(1.0, 1.0 + 1e-6)]])
    pairs = coincident(places, sides_of_cells(np.array([[0, 1, 2, 3]]), 4))
    assert len(pairs) == 30_001
    assert representatives(len(places), pairs).tolist() == [0, 1, 2, 3] + [2] * 30_001
