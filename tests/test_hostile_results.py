"""Damaged and hostile result files end in one line, whatever HDF5 makes of them."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

import fecm
from fecm._errors import ResultFileError
from fecm.cli.isolation import limits_for
from tests.calls import assert_unusable, call
from tests.decks import PROGRAM as PROGRAM_CARDS
from tests.decks import small

# The program with a command that, instead of reading the file, does what damaged files do.
PROGRAM = """
import collections, ctypes, itertools, os, signal, sys
from pathlib import Path
import click
from fecm.cli import COMMANDS, LazyCommand, isolation, main
from fecm._files import beside

COMMANDS["act"] = LazyCommand("__main__", "")

@click.command("act")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("what")
@isolation.reads("file")
def act_command(file, what):
    with beside(Path("out.h5")):
        print("begins", file=sys.stderr, flush=True)
        os.write(2, b"noise of a library")
        if what == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if what == "hang":  # in C, where Python handles no signal
            collections.deque(map(ctypes.PyDLL(None).abs, itertools.repeat(1)), maxlen=0)
        if what == "swallow":
            bytearray(10**12)
        print("line\\n" * 20_000, flush=True)
        raise SystemExit(1)

main()
"""


def start(folder: Path, what: str, patience: str) -> subprocess.Popen[str]:
    """Start this program."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "act", "x.h5", what],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, "FECM_PATIENCE": patience, "PYTHONPATH": str(Path.cwd())},
    )


@pytest.mark.linux
@pytest.mark.parametrize(
    ("what", "message"),
    [
        (
            "crash",
            "x.h5 can't be read: a library crashed (SIGSEGV), as happens with damaged files",
        ),
        (
            "hang",
            "x.h5 can't be read: it takes more than 0.5 s of processor time, as happens with "
            "damaged files (FECM_PATIENCE=SECONDS allows more)",
        ),
        ("swallow", "x.h5: this takes more memory than the "),
    ],
)
def test_a_crash_a_hang_and_too_much_memory_are_one_line_and_leave_no_file(
    tmp_path: Path, what: str, message: str
) -> None:
    program = start(tmp_path, what, "0.5")
    out, err = program.communicate(timeout=60)
    assert (program.returncode, out) == (2, "")
    assert err.startswith(f"begins\nfecm: error: {message}")
    assert err.count("\n") == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.linux
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_signal_ends_a_command_that_hangs_and_leaves_no_file(
    tmp_path: Path, number: signal.Signals
) -> None:
    program = start(tmp_path, "hang", "50")
    assert program.stderr is not None
    assert program.stderr.readline() == "begins\n"
    program.send_signal(number)
    _, err = program.communicate(timeout=20)
    assert program.returncode == 128 + number
    assert err.split() == (["fecm:", "interrupted"] if number == signal.SIGINT else [])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.linux
def test_a_killed_command_leaves_no_process(tmp_path: Path) -> None:
    program = start(tmp_path, "hang", "50")
    assert program.stderr is not None
    assert program.stderr.readline() == "begins\n"
    program.kill()
    program.communicate(timeout=20)  # a child would hold the other ends of both pipes


@pytest.mark.linux
def test_a_slow_reader_of_the_output_sees_all_of_it_and_the_exit_status(tmp_path: Path) -> None:
    program = start(tmp_path, "write", "0.5")
    with pytest.raises(subprocess.TimeoutExpired):
        program.wait(timeout=1.5)
    out, err = program.communicate(timeout=60)
    assert (program.returncode, out.count("line"), err) == (1, 20_000, "begins\n")


def test_limits_grow_with_the_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FECM_PATIENCE", raising=False)
    assert limits_for([10**5], None) == (4_005_000_000, 121.0)
    assert limits_for([10**10, 0], None) == (504 * 10**9, 100_240.0)
    assert limits_for([10**10], 8 * 10**9)[0] == 6 * 10**9


@pytest.mark.linux
def test_patience_that_is_no_number_is_one_line(tmp_path: Path) -> None:
    program = start(tmp_path, "write", "-3")
    out, err = program.communicate(timeout=60)
    assert (program.returncode, out) == (2, "")
    assert err == "fecm: error: FECM_PATIENCE is `-3`; it must be a number of seconds\n"


@pytest.fixture
def result(runs: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(runs / "small.h5", tmp_path / "sound.h5"))


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result with every group that has attributes of its own."""
    path = tmp_path_factory.mktemp("complete") / "complete.h5"
    cards = (
        "PATC\nDISC,.2\nALLO\n   200000.   200000.     7000.    28000.    13000.\n\nDELA\n  2.,\n"
    )
    program = PROGRAM_CARDS.replace("DISP          5", "DISP          5\nFAIL")
    fecm.run(small(program).replace("EXPE", f"{cards}\nEXPE"), output=path)
    return path


ATTRIBUTES = ["history/unsettled_steps", "energy/initial", "threshold/force", "threshold/time",
              "threshold/margin", "patch/x", "patch/radius", "failure/modes"]  # fmt: skip


@pytest.mark.parametrize("attribute", ATTRIBUTES)
@pytest.mark.parametrize("value", ["text", b"\xff", [1.0, 2.0], True], ids=repr)
@pytest.mark.few(5)  # of 32, 0.04 s each
def test_an_attribute_of_another_type_is_one_line(
    complete: Path, attribute: str, value: object, tmp_path: Path
) -> None:
    path = Path(shutil.copy(complete, tmp_path / "crafted.h5"))
    group, _, name = attribute.partition("/")
    with h5py.File(path, "r+") as file:
        assert name in file[group].attrs
        file[group].attrs[name] = value
    done = call("info", path)
    assert_unusable(done)
    assert f"the attribute {name} of {group} is " in done.stderr


def without_mesh(file: h5py.File) -> None:
    del file["mesh"]


def foreign_nodes(file: h5py.File) -> None:
    file["mesh/elements"][0, 0] = 188


def no_force(file: h5py.File) -> None:
    del file["threshold"].attrs["force"]


def foreign_mode(file: h5py.File) -> None:
    file["failure/hashin/mode"][...] = 100


def longer_history(file: h5py.File) -> None:
    for name, dataset in list(file["history"].items()):
        del file["history"][name]
        file["history"].create_dataset(name, (len(dataset) + 2,), dataset.dtype)


def raw_version(file: h5py.File) -> None:
    file.attrs["format_version"] = "\n\x1b[31m"


@pytest.mark.parametrize(
    ("edit", "command", "reason"),
    [
        (without_mesh, "plot --kind line -o x.png", "mesh"),
        (without_mesh, "export --to vtkhdf -o x.vtkhdf", "mesh"),
        (foreign_nodes, "plot --kind line -o x.png", "mesh/elements names nodes outside 1 to 25"),
        (foreign_nodes, "export --to vtkhdf -o x.vtkhdf", "nodes outside 1 to 25"),
        (no_force, "info", "threshold has no attribute force"),
        (foreign_mode, "info", "failure/hashin/mode has the mode 100, which has no name"),
        (longer_history, "info", "but rows is 10 in energy/"),
        (raw_version, "info", "format version \\n\\x1b[31m is not 1"),
    ],
)
def test_an_inconsistent_result_is_one_line_and_leaves_no_file(
    complete: Path, edit: Callable[[h5py.File], None], command: str, reason: str, tmp_path: Path
) -> None:
    shutil.copy(complete, tmp_path / "bad.h5")
    with h5py.File(tmp_path / "bad.h5", "r+") as file:
        edit(file)
    name, *options = command.split()
    done = call(name, "bad.h5", *options, cwd=tmp_path)
    assert_unusable(done)
    assert reason in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["bad.h5"]


def test_a_missing_dataset_is_a_missing_key_and_a_missing_attribute(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        del file["mesh/elements"]
    loaded = fecm.load(result)
    with pytest.raises(KeyError, match="there is no mesh/elements"):
        loaded["mesh/elements"]
    assert not hasattr(loaded.mesh, "elements")


def in_another_file(file: h5py.File) -> None:
    file.create_dataset("mesh/extra", (10,), "u1", external=[("/etc/passwd", 0, 10)])


def in_another_dataset(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((10,), "f8")
    layout[...] = h5py.VirtualSource("other.h5", "history/force", (10,))
    file.create_virtual_dataset("mesh/extra", layout)


def soft_link(file: h5py.File) -> None:
    file["mesh/extra"] = h5py.SoftLink("/history/force")


def external_link(file: h5py.File) -> None:
    file["mesh/extra"] = h5py.ExternalLink("other.h5", "history/force")


def references(file: h5py.File) -> None:
    file.create_dataset("mesh/extra", data=[file["history/force"].ref], dtype=h5py.ref_dtype)


def regions(file: h5py.File) -> None:
    region = file["history/force"].regionref[:2]
    file.create_dataset("mesh/extra", data=[region], dtype=h5py.regionref_dtype)


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (in_another_file, "has external storage"),
        (in_another_dataset, "is a virtual dataset"),
        (soft_link, "is a soft link"),
        (external_link, "is an external link"),
        (references, "holds references"),
        (regions, "holds references"),
    ],
)
def test_what_leads_to_another_object_is_refused_by_name(
    result: Path, edit: Callable[[h5py.File], None], reason: str
) -> None:
    with h5py.File(result, "r+") as file:
        edit(file)
    for arguments in (
        ["info", result],
        ["diff", result, result],
        ["tapes", result, "-d", result.parent],
        ["export", result, "--to", "csv", "--dataset", "mesh/extra", "-o", "-"],
        ["plot", result, "--kind", "mesh", "-o", result.with_name("x.png")],
        ["report", result, "-o", result.with_name("x.html")],
    ):
        done = call(*arguments)
        assert_unusable(done)
        assert f"{result}: mesh/extra {reason}" in done.stderr
    with pytest.raises(ResultFileError, match="mesh/extra"):
        fecm.load(result)


def test_a_damaged_sweep_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    fecm.sweep(small(), {"velocity": [50.0, 100.0]}, output=path)
    with h5py.File(path, "r+") as file:
        del file["cases/velocity"]
        file["cases/velocity"] = 1.0
    done = call("plot", path, "-o", tmp_path / "x.png")
    assert_unusable(done)
    assert "the data of this sweep do not match in type or number of cases" in done.stderr
    with h5py.File(path, "r+") as file:
        del file["cases/velocity"]
        file.create_dataset("cases/velocity", (2,), "f8", external=[("/dev/zero", 0, 16)])
    with pytest.raises(ResultFileError, match="cases/velocity has external storage"):
        fecm.load_sweep(path)


def test_more_texts_than_a_file_has_bytes_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    fecm.sweep(small(), {"velocity": [50.0, 100.0]}, output=path)
    with h5py.File(path, "r+") as file:
        file.create_dataset("summary/extra", (200_000,), h5py.string_dtype(), chunks=(1000,))
    done = call("info", path)
    assert_unusable(done)
    assert "summary/extra has the shape (200000,), which is more than the file holds" in done.stderr


@pytest.mark.parametrize("group", ["/", "history"])
def test_more_attributes_than_any_result_has_are_refused(result: Path, group: str) -> None:
    with h5py.File(result, "r+") as file:
        for number in range(1001):
            file[group].attrs.create(f"a{number}", 0)
    done = call("info", result)
    assert_unusable(done)
    assert "has more than 1000 attributes" in done.stderr


def test_groups_nested_deeper_than_in_any_result_are_refused(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        file.create_group("/".join("abcdefghijk"))
    done = call("info", result)
    assert_unusable(done)
    assert "a/b/c/d/e/f/g/h/i/j/k is nested in 10 groups or more" in done.stderr


@pytest.mark.links
def test_a_pipe_in_a_folder_of_tapes_is_refused(result: Path) -> None:
    os.mkfifo(result.with_name("tape3"))
    done = call("diff", result, result.parent)
    assert_unusable(done)
    assert "tape3: not a regular file" in done.stderr


@pytest.mark.long
@pytest.mark.linux
@pytest.mark.parametrize(
    "options", ["--count 1000 --seed 0", "--count 1000 --seed 1000", "--count 16 --sweep"]
)
def test_mutated_results_end_in_one_line(options: str) -> None:
    command = [sys.executable, "-m", "tests.fuzz_results", *options.split()]
    environment = {**os.environ, "FECM_PATIENCE": "5"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
