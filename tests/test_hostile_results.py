"""Damaged result files end in one line, whatever HDF5 makes of them."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

import fecm
from fecm.cli.isolation import GB, limits_for
from fecm.results import ResultFileError
from tests.calls import assert_unusable, call
from tests.decks import PROGRAM as PROGRAM_CARDS
from tests.decks import small

PROGRAM = """
import collections, ctypes, itertools, os, signal, sys, time
from pathlib import Path
import click
from fecm.cli import COMMANDS, LazyCommand, isolation, main
from fecm._files import partial_of

def short_calls(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.01)

COMMANDS["act"] = LazyCommand("__main__", "", isolated=True)

@click.command("act")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("what")
@isolation.reads("file")
def act_command(file, what):
    if what == "crash":
        partial_of(Path("out.h5")).write_text("half")
        os.write(2, b"malloc(): corrupted top size\\n")
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "hang":  # in C, where no signal handler is carried out
        print("hanging", file=sys.stderr, flush=True)
        collections.deque(map(ctypes.PyDLL(None).usleep, itertools.repeat(10_000)), maxlen=0)
    if what == "wait":  # in C, which takes a signal for nothing to stop at
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        print("hanging", file=sys.stderr, flush=True)
        ctypes.PyDLL(None).sleep(600)
    if what == "write":  # until somebody reads
        for _ in range(20_000):
            print("line", flush=True)
    if what == "swallow":
        bytearray(10**12)
    if what == "work":
        short_calls(1.1)
    if what == "no":
        raise SystemExit(1)
    click.echo("done")

main()
"""


def start(folder: Path, what: str, patience: str = "0.4") -> subprocess.Popen[str]:
    """Start a command that does something to itself while it reads a file."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "act", "x.h5", what],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, "FECM_PATIENCE": patience, "PYTHONPATH": str(Path.cwd())},
    )


def ended(folder: Path, what: str, patience: str = "0.4") -> tuple[int, str, str]:
    """How such a command ends."""
    program = start(folder, what, patience)
    out, err = program.communicate(timeout=60)
    return program.returncode, out, err


@pytest.mark.posix
def test_death_by_a_signal_is_one_line_and_leaves_no_partial_file(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "crash")
    assert (status, out) == (2, "")
    assert err == (
        "fecm: error: x.h5 can't be read: the HDF5 library crashed (SIGSEGV), as happens with "
        "damaged files\n"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.posix
def test_a_call_that_never_comes_back_is_one_line(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "hang")
    assert (status, out) == (2, "")
    told = err.removeprefix("hanging\n")
    assert told.startswith("fecm: error: x.h5 can't be read: the HDF5 library did not return")
    assert told.count("\n") == 1


@pytest.mark.posix
def test_a_call_that_waits_for_ever_is_one_line(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "wait")
    assert (status, out) == (2, "")
    assert err == (
        "hanging\nfecm: error: x.h5 can't be read: the HDF5 library did not return within 0.4 s, "
        "as happens with damaged files and with disks that hang (FECM_PATIENCE=SECONDS allows "
        "more)\n"
    )


@pytest.mark.posix
def test_waiting_for_a_reader_of_the_output_has_no_limit(tmp_path: Path) -> None:
    program = start(tmp_path, "write", "1")
    with pytest.raises(subprocess.TimeoutExpired):
        program.wait(timeout=1.6)
    out, err = program.communicate(timeout=60)
    assert (program.returncode, out.count("line"), err) == (0, 20_000, "")


@pytest.mark.linux
def test_a_child_ends_with_its_parent(tmp_path: Path) -> None:
    program = start(tmp_path, "wait")
    assert program.stderr is not None
    assert program.stderr.readline().startswith("hanging")
    program.kill()
    program.communicate(timeout=10)  # the child holds the other ends of both pipes


@pytest.mark.linux
def test_more_memory_than_is_free_is_one_line(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "swallow", "20")
    assert (status, out) == (2, "")
    assert err.startswith("fecm: error: x.h5: this takes more memory than the ")
    assert err.count("\n") == 1


@pytest.mark.posix
def test_honest_work_may_take_longer_than_one_call(tmp_path: Path) -> None:
    assert ended(tmp_path, "work", "1") == (0, "done\n", "")


@pytest.mark.posix
def test_the_exit_status_of_the_child_is_the_programs(tmp_path: Path) -> None:
    assert ended(tmp_path, "no", "20") == (1, "", "")


@pytest.mark.posix
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGINT, marks=pytest.mark.long), signal.SIGTERM]
)
def test_a_signal_ends_a_command_whose_child_hangs(tmp_path: Path, number: signal.Signals) -> None:
    program = start(tmp_path, "hang", patience="50")
    assert program.stderr is not None
    assert program.stderr.readline() == "hanging\n"
    begin = time.monotonic()
    program.send_signal(number)
    assert program.wait(timeout=20) == 128 + number
    assert time.monotonic() - begin < 10.0
    program.communicate()


def test_limits_grow_with_the_files() -> None:
    few, many = limits_for(10**5, None), limits_for(10 * GB, None)
    assert (few.memory, round(few.call), round(few.total)) == (4 * GB + 5 * 10**6, 30, 601)
    assert (many.memory, round(many.call), round(many.total)) == (504 * GB, 2030, 100_600)
    assert limits_for(10 * GB, 8 * GB).memory == 6 * GB


@pytest.mark.posix
def test_patience_that_is_no_number_is_one_line(tmp_path: Path) -> None:
    program = start(tmp_path, "work", patience="-3")
    out, err = program.communicate(timeout=60)
    assert (program.returncode, out) == (2, "")
    assert err == "fecm: error: FECM_PATIENCE is `-3`; it must be a number of seconds\n"


@pytest.fixture
def result(runs: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(runs / "small.h5", tmp_path / "sound.h5"))


@pytest.mark.parametrize(
    "command",
    [["export", "--to", "vtkhdf", "-o", "x.vtkhdf"], ["plot", "--kind", "line"], ["tapes"]],
)
def test_a_result_without_its_mesh_is_one_line(
    result: Path, command: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(result.parent)
    with h5py.File(result, "r+") as file:
        del file["mesh"], file["tape3/w"]
    done = call(command[0], result, *command[1:])
    if command != ["tapes"]:
        assert_unusable(done)
    assert "Traceback" not in done.stderr


def test_a_missing_dataset_is_a_missing_key_and_a_missing_attribute(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        del file["mesh/elements"]
    loaded = fecm.load(result)
    with pytest.raises(KeyError, match="there is no mesh/elements"):
        loaded["mesh/elements"]
    with pytest.raises(AttributeError, match="there is no mesh/elements"):
        _ = loaded.mesh.elements
    assert not hasattr(loaded.mesh, "elements")


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result with every group that has attributes of its own."""
    path = tmp_path_factory.mktemp("complete") / "complete.h5"
    cards = (
        "PATC\nDISC,.2\nALLO\n   200000.   200000.     7000.    28000.    13000.\n\nDELA\n  2.,\n"
    )
    program = PROGRAM_CARDS.replace("DISP          5", "DISP          5\nFAIL")
    fecm.run(small(program).replace("EXPE", f"{cards}\nEXPE"), output=path)
    assert call("info", path).exit_code == 0
    return path


OTHER_TYPES = ["text", b"\xff", [1.0, 2.0], True]
# Each type in one attribute, and each attribute with one type; the long tests have all pairs.
ATTRIBUTES = [
    pytest.param(
        name, value, marks=() if name == "threshold/force" or value == "text" else pytest.mark.long
    )
    for name in ("history/unsettled_steps", "energy/initial", "threshold/force",
                 "threshold/time", "threshold/margin", "patch/x",
                 "patch/radius", "failure/modes")
    for value in OTHER_TYPES
]  # fmt: skip


@pytest.mark.parametrize(("attribute", "value"), ATTRIBUTES, ids=repr)
def test_an_attribute_of_another_type_is_one_line(
    complete: Path, attribute: str, value: object, tmp_path: Path
) -> None:
    path = Path(shutil.copy(complete, tmp_path / "crafted.h5"))
    group, _, name = attribute.partition("/")
    with h5py.File(path, "r+") as file:
        assert name in file[group].attrs
        file[group].attrs[name] = value
    for options in ([], ["--format", "json"]):
        done = call("info", path, *options)
        assert_unusable(done)
        assert f"the attribute {name} of {group} is " in done.stderr
    with pytest.raises(ResultFileError, match=f"attribute {name} of {group}"):
        fecm.load(path)


@pytest.mark.parametrize("attribute", ["threshold/force", "threshold/time", "threshold/margin"])
def test_a_lacking_attribute_is_one_line(complete: Path, attribute: str, tmp_path: Path) -> None:
    path = Path(shutil.copy(complete, tmp_path / "crafted.h5"))
    group, _, name = attribute.partition("/")
    with h5py.File(path, "r+") as file:
        del file[group].attrs[name]
    done = call("info", path)
    assert_unusable(done)
    assert f"{group} has no attribute {name}" in done.stderr


def test_a_threshold_without_any_attribute_is_one_line(complete: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(complete, tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        for name in ("force", "time", "margin"):
            del file["threshold"].attrs[name]
    done = call("info", path)
    assert_unusable(done)
    assert "threshold has no attribute force" in done.stderr


@pytest.mark.parametrize("code", [-1, 100])
def test_a_mode_of_failure_without_a_name_is_one_line(
    complete: Path, code: int, tmp_path: Path
) -> None:
    path = Path(shutil.copy(complete, tmp_path / "crafted.h5"))
    with h5py.File(path, "r+") as file:
        file["failure/hashin/mode"][...] = code
    done = call("info", path)
    assert_unusable(done)
    assert f"failure/hashin/mode has the mode {code}, which has no name" in done.stderr


def test_what_a_file_says_of_itself_does_not_reach_the_terminal_raw(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        file.attrs["format_version"] = "\n\x1b[31m"
    done = call("info", result)
    assert_unusable(done)
    assert "format version \\n\\x1b[31m is not 1" in done.stderr


def fuzz(*arguments: object, patience: str) -> str:
    """Put mutated files through `info` and `diff`; fails where one of them ends badly."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz_results", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "FECM_PATIENCE": patience},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.long
def test_mutated_results_end_in_one_line() -> None:
    told = fuzz("--count", 120, "--seed", 1, patience="0.25")
    assert "broken 0" in told
    assert "'info 2'" in told
    assert "'diff 1'" in told


@pytest.mark.long
def test_ten_thousand_mutated_results_end_in_one_line() -> None:
    assert "broken 0" in fuzz("--count", 10_000, "--seed", 100_000, patience="1")


@pytest.mark.long
def test_mutated_results_of_sweeps_end_in_one_line() -> None:
    told = fuzz("--count", 16, "--seed", 70, "--sweep", patience="0.25")
    assert "broken 0" in told
    assert "'plot map 0'" in told


def test_a_sweep_whose_cases_are_single_numbers_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    fecm.sweep(small(), {"velocity": [50.0, 100.0]}, output=path)
    with h5py.File(path, "r+") as file:
        del file["cases/velocity"]
        file["cases/velocity"] = 1.0
    done = call("plot", path, "-o", tmp_path / "x.png")
    assert_unusable(done)
    assert "the data of this sweep do not match in type or number of cases" in done.stderr


def test_elements_of_nodes_that_the_mesh_has_not_are_one_line(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        file["mesh/elements"][0, 0] = 188
    for command, output in (
        (["export", "--to", "vtkhdf"], "x.vtkhdf"),
        (["plot", "--kind", "line"], "x.png"),
    ):
        done = call(command[0], result, *command[1:], "-o", result.with_name(output))
        assert_unusable(done)
        assert "mesh/elements names nodes outside 1 to 25" in done.stderr
    assert [path.name for path in result.parent.iterdir()] == [result.name]


def in_another_file(file: h5py.File) -> None:
    secret = Path(file.filename).with_name("secret")
    secret.write_text("top secret")
    file.create_dataset("mesh/extra", (10,), "u1", external=[(str(secret), 0, 10)])


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


ELSEWHERE: dict[Callable[[h5py.File], None], str] = {
    in_another_file: "has external storage",
    in_another_dataset: "is a virtual dataset",
    soft_link: "is a soft link",
    external_link: "is an external link",
    references: "holds references",
    regions: "holds references",
}


@pytest.mark.parametrize("edit", ELSEWHERE, ids=lambda edit: edit.__name__)
def test_what_leads_to_another_object_is_refused_by_name(
    result: Path, edit: Callable[[h5py.File], None]
) -> None:
    with h5py.File(result, "r+") as file:
        edit(file)
    reason = f"{result}: mesh/extra {ELSEWHERE[edit]}"
    for arguments in (
        ["info", result],
        ["diff", result, result],
        ["tapes", result, "-d", result.parent],
        ["export", result, "--to", "csv", "--dataset", "mesh/extra", "-o", "-"],
        ["plot", result, "--kind", "mesh", "-o", result.with_name("x.png")],
    ):
        done = call(*arguments)
        assert_unusable(done)
        assert reason in done.stderr
        assert done.stdout == ""
    with pytest.raises(ResultFileError, match="mesh/extra"):
        fecm.load(result)


def test_a_sweep_whose_cases_are_in_another_file_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    fecm.sweep(small(), {"velocity": [50.0, 100.0]}, output=path)
    with h5py.File(path, "r+") as file:
        del file["cases/velocity"]
        file.create_dataset("cases/velocity", (2,), "f8", external=[("/dev/zero", 0, 16)])
    with pytest.raises(ResultFileError, match="cases/velocity has external storage"):
        fecm.load_sweep(path)


@pytest.mark.links
def test_a_pipe_in_a_folder_of_tapes_is_refused(result: Path) -> None:
    os.mkfifo(result.with_name("tape3"))
    done = call("diff", result, result.parent)
    assert_unusable(done)
    assert "tape3: not a regular file" in done.stderr
