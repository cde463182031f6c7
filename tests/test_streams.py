"""Streams that are closed, full or of few characters, and signals at any time."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import fecm
from fecm.authoring.values import VARIABLES
from fecm.cli import COMMANDS, GROUPED
from tests.calls import call, program
from tests.decks import small

FECM = f"{sys.executable} -m fecm"


def long(*values: object) -> object:
    """Values of a test that runs only with ``-m long``."""
    return pytest.param(*values, marks=pytest.mark.long)


def shell(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command line of the shell; ``F`` is the program."""
    return subprocess.run(
        ["bash", "-c", f'F="{FECM}"; {command}'],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )


@pytest.mark.parametrize(
    "arguments",
    [
        "run d.inp -o -",
        "run -",
        "run d.inp --print -",
        "sweep d.inp -o -",
        "estimate -",
        "info -",
        "diff d.inp -",
        "plot d.h5 --kind force -o -",
        "tapes d.h5 -d -",
        "report d.h5 -o -",
        "locate d.inp d.inp -o -",
    ],
)
def test_a_dash_is_a_stream_and_never_a_file(arguments: str, tmp_path: Path) -> None:
    for name in ("d.inp", "d.h5"):
        (tmp_path / name).write_text(small())
    done = call(*arguments.split(), cwd=tmp_path)
    assert done.exit_code == 2
    assert "- is a standard stream, and this needs a file; give its name" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d.h5", "d.inp"]


def test_python_writes_no_file_of_the_name_dash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fecm.errors.OutputError, match="- is a standard stream"):
        fecm.run(small(), output="-")
    assert list(tmp_path.iterdir()) == []


def python(code: str, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run Python code."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a deck."""
    (tmp_path / "d.inp").write_text(small())
    return tmp_path


@pytest.mark.linux
@pytest.mark.parametrize(
    ("streams", "status"),
    [long(">&-", 2), long("2>&-", 0), long(">&- 2>&-", 2), ("<&- >&- 2>&-", 2), (">/dev/full", 2),
     long("2>/dev/full", 0), long(">/dev/full 2>/dev/full", 2), long("| true", 2)],
)  # fmt: skip
@pytest.mark.few(1)  # of 2, 0.5 s each
def test_a_run_is_done_whatever_becomes_of_its_streams(
    folder: Path, streams: str, status: int
) -> None:
    (folder / "d.inp").write_text(small(stop=False) + small())  # the second one prints as well
    done = shell(f"$F run d.inp {streams}; exit ${{PIPESTATUS[0]}}", folder)
    assert done.returncode == status
    assert "Traceback" not in done.stderr
    assert all(h5py.is_hdf5(folder / name) for name in ("d.h5", "d-2.h5"))
    assert sorted(p.name for p in folder.iterdir()) == ["d-2.h5", "d.h5", "d.inp"]
    if "2>" not in streams and streams != "| true":
        assert done.stderr.splitlines()[-1].startswith("fecm: error: standard output: ")


@pytest.mark.posix
@pytest.mark.parametrize(
    ("command", "streams", "status"),
    [long("info d.h5", ">&-", 2), long("info d.h5", "2>&-", 0), long("check d.inp", ">&-", 2),
     ("tapes d.h5 -d t", ">&-", 2), long("--help", ">&-", 2), ("--help", "2>&-", 0)],
)  # fmt: skip
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_other_commands_end_with_2_when_they_can_not_print(
    folder: Path, runs: Path, command: str, streams: str, status: int
) -> None:
    shutil.copy(runs / "small.h5", folder / "d.h5")
    done = shell(f"$F {command} {streams}", folder)
    assert (done.returncode, "Traceback" in done.stderr) == (status, False)
    if "tapes" in command:
        assert len(list((folder / "t").iterdir())) == 3


@pytest.mark.linux
@pytest.mark.parametrize(
    ("command", "streams"),
    [long("info none.h5", "2>&-"), ("info none.h5", "2>&1 | true"), ("run none.inp", "2>/dev/full"),
     long("run none.inp", "2>&-")],
)  # fmt: skip
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_a_message_that_nobody_reads_changes_no_exit_status(
    folder: Path, command: str, streams: str
) -> None:
    assert shell(f"$F {command} {streams}; exit ${{PIPESTATUS[0]}}", folder).returncode == 2


@pytest.mark.posix
@pytest.mark.parametrize("encoding", [long("latin-1"), "ascii"])
def test_characters_that_a_stream_lacks_are_escaped(folder: Path, encoding: str) -> None:
    text = small().replace("FECM small plate", "FECM plate α")
    (folder / "d.inp").write_text(text)
    done = shell("$F run d.inp", folder, PYTHONIOENCODING=encoding)
    assert done.returncode == 0
    # click writes UTF-8 where a stream claims to know no more than ASCII.
    assert done.stdout.splitlines()[0] in ("plate \\u03b1", *["plate α"] * (encoding == "ascii"))


@pytest.mark.posix
def test_control_characters_of_a_title_and_a_name_reach_no_terminal(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    Path("\x1b[31m.inp").write_text(small().replace("FECM small", "FECM \x1b[2J\x9b31m"))
    for arguments in (
        ("check", "\x1b[31m.inp"),
        ("run", "\x1b[31m.inp"),
        ("sweep", "\x1b[31m.inp", "--vary", "velocity=90,91"),
        ("info", "\x1b[31m.h5"),
        ("tapes", "\x1b[31m.h5", "-d", "\x1b[31m"),
        ("export", "\x1b[31m.h5", "--to", "csv"),
        ("fmt", "\x1b[31m.inp", "-o", "\x1b[31m.out"),
        ("run", "\x1b[31m.inp"),
    ):
        done = call(*arguments)
        assert done.exit_code == (2 if "exists" in done.stderr else 0), done.stderr
        shown = done.stdout + done.stderr
        assert [c for c in shown if c != "\n" and not c.isprintable()] == []
        assert (
            "\\x1b[2J\\x9b31m" in done.stdout
            or arguments[0] not in ("run", "check", "sweep")
            or (done.exit_code == 2)
        )


@pytest.mark.linux
def test_a_line_end_in_a_name_does_not_break_the_line(folder: Path) -> None:
    (folder / "d.inp").rename(folder / "a\nb.inp")
    ran = call("run", "a\nb.inp", cwd=folder)
    assert ran.stdout.splitlines()[-1] == "  result            a\\nb.h5"
    swept = call("sweep", "a\nb.inp", "--vary", "k=1e6", "-o", "c\nd.h5", cwd=folder)
    assert "  result            c\\nd.h5" in swept.stdout.splitlines()
    shutil.copy(folder / "a\nb.inp", folder / "c.inp")
    several = call("check", "c.inp", "a\nb.inp", cwd=folder)
    assert several.stdout.splitlines()[-1].startswith("a\\nb.inp: 2 warnings")
    written = call("export", "a\nb.h5", "--to", "csv", cwd=folder)
    assert written.stdout.startswith("a\\nb")


def test_a_long_error_keeps_its_begin_and_its_end(folder: Path) -> None:
    done = call("sweep", "d.inp", "--vary", f"{'x' * 5000}=1", cwd=folder)
    assert done.exit_code == 2
    assert done.stderr.startswith("fecm: error: ")
    assert done.stderr.endswith(f"{', '.join(list(VARIABLES)[-3:])}\n")
    assert " … " in done.stderr
    assert len(done.stderr) < 1100


@pytest.mark.linux
@pytest.mark.parametrize("arguments", ["example drop-weight.inp", long("run {deck}")])
def test_an_error_in_a_folder_that_was_removed_says_so(arguments: str, folder: Path) -> None:
    gone = folder / "gone"
    gone.mkdir()
    deck = folder / "d.inp"
    done = shell(f"cd {gone} && rmdir {gone} && $F {arguments.format(deck=deck)}", folder)
    assert done.returncode == 2
    assert done.stderr == (
        "fecm: error: the current folder does not exist any more; change to another one\n"
    )


@pytest.mark.linux
@pytest.mark.long
def test_a_picture_is_drawn_without_a_word_where_the_home_folder_is_missing(folder: Path) -> None:
    pytest.importorskip("matplotlib")
    assert call("run", "d.inp", cwd=folder).exit_code == 0
    environment = {"HOME": "/proc", "XDG_CONFIG_HOME": "", "MPLCONFIGDIR": ""}
    done = shell("$F plot d.h5", folder, **environment)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.linux
def test_names_that_are_not_utf_8_work_in_every_command(folder: Path) -> None:
    deck, first, second = "\udcff.inp", "\udcff1.h5", "\udcff2.h5"
    (folder / "d.inp").rename(folder / deck)
    for arguments in (
        ("check", deck),
        ("run", deck, "-o", first, "--print", "\udcff.txt"),
        ("run", deck, "-o", second),
        ("diff", first, second),
        ("tapes", first, "-d", "\udcff"),
        ("export", first, "--to", "csv"),
        ("export", first, "--to", "vtkhdf"),
        ("fmt", deck),
    ):
        done = call(*arguments, cwd=folder)
        assert done.exit_code == 0, done.stderr
    done = program("info", first, cwd=folder)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "\\udcff1.h5" in done.stdout


@pytest.mark.linux
def test_two_results_whose_names_are_not_utf_8_are_drawn(
    folder: Path, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(folder)
    for name in ("\udcff1.h5", "\udcff2.h5"):
        shutil.copy(runs / "small.h5", name)
    assert call("plot", "\udcff1.h5", "\udcff2.h5", "-o", "out.svg").exit_code == 0
    assert "udcff1" in Path("out.svg").read_text()


# Signals -----------------------------------------------------------------------------------------

IMPACT = "LMAS\nDT        .1E-6\nLOOP      99999\nTIME\nRODP\nNEXT\n"
STATIC = "TANG\nLOOP,,3000000\nFORM\nSOLV\nNEXT\n"
EMPTY = "LMAS\nLOOP,,30000\nLOOP,,30000\nNEXT\nNEXT\n"
LAST = "   25    0    1    1    0    0    0\n"
HELD = LAST + "".join(f"{node:5d}    0    1    1    1    0    0\n" for node in (1, 5, 21, 25))

# The program, which gets a signal from itself after a hundred macros.
SIGNALLED = """
import os, signal, sys
from fecm.__main__ import main
from fecm.simulation.interpreter import Interpreter

number, plain = int(sys.argv.pop(1)), Interpreter.run
signal.signal(number, signal.SIG_DFL)  # nohup ignores SIGHUP

def run(self, bind, start, on_macro, bind_loop):
    macros = iter(range(100))
    def counted():
        if next(macros, None) == 99:
            os.kill(os.getpid(), number)
        on_macro()
    plain(self, bind, start, counted, bind_loop)

Interpreter.run = run
main()
"""


@pytest.mark.posix
@pytest.mark.parametrize(
    ("macros", "name", "step"),
    [(IMPACT, "SIGTERM", 49), long(IMPACT, "SIGINT", 49), long(STATIC, "SIGHUP", 0),
     (EMPTY, "SIGINT", 0)],
)  # fmt: skip
@pytest.mark.few(1)  # of 2, 0.4 s each
def test_the_first_signal_ends_a_loop_at_its_next_macro(
    folder: Path, macros: str, name: str, step: int
) -> None:
    number = signal.Signals[name]
    (folder / "d.inp").write_text(small(macros).replace(LAST, HELD))
    done = python(SIGNALLED, str(int(number)), "run", "d.inp", "--solver", "numpy", cwd=folder)
    assert done.returncode == 128 + number
    last = f"fecm: stopped after step {step}; the same command with --resume continues d.h5"
    assert done.stderr.splitlines()[-1] == last
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in folder.iterdir()) == ["d.h5.checkpoint", "d.h5.spool", "d.inp"]


# The program, which gets a signal from itself in a callback of HDF5 that writes a file.
SIGNALLED_IN_HDF5 = """
import os, signal, sys
from fecm.__main__ import main
from fecm.results import (hdf5_writer)

number, name, plain = int(sys.argv.pop(1)), sys.argv.pop(1), hdf5_writer._Guarded.write
signal.signal(number, signal.SIG_DFL)
sent = []

def write(self, data):
    if not sent and self.name.name == name:
        sent.append(number)
        os.kill(os.getpid(), number)
    return plain(self, data)

hdf5_writer._Guarded.write = write
main()
"""


@pytest.mark.posix
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.long
def test_a_signal_stops_a_case_that_is_run_in_full_and_keeps_the_sweep(
    folder: Path, number: signal.Signals
) -> None:
    (folder / "d.inp").write_text(small())
    command = ("sweep", "d.inp", "--vary", "k=1e6", "--full", "0", "-o", "s.h5")
    arguments = (SIGNALLED_IN_HDF5, str(int(number)), ".s-0.partial.h5", *command)
    done = python(*arguments, cwd=folder)
    assert done.returncode == 128 + number
    assert "case 0 was not run in full: a signal stopped the program" in done.stderr
    assert "Traceback" not in done.stderr
    assert "error" not in done.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["d.inp", "s.h5"]


@pytest.mark.posix
@pytest.mark.long
def test_a_signal_while_a_sweep_is_written_ends_the_program_after_it(folder: Path) -> None:
    (folder / "d.inp").write_text(small())
    command = ("sweep", "d.inp", "--vary", "k=1e6", "-o", "s.h5")
    done = python(SIGNALLED_IN_HDF5, "2", ".s.partial.h5", *command, cwd=folder)
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1] == "fecm: interrupted"
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["d.inp", "s.h5"]


# A callback in which Python drops an exception, as those of imports are.
IN_A_CALLBACK = """
import os, signal, sys, weakref
import {module} as module
from fecm.__main__ import main

number = int(sys.argv.pop(1))
signal.signal(number, signal.SIG_DFL)

class Thing:
    pass

def function(*arguments, **options):
    thing = Thing()
    reference = weakref.ref(thing, lambda _: os.kill(os.getpid(), number))
    del thing
    print("lost")

module.{name} = function
main()
"""


@pytest.mark.posix
@pytest.mark.parametrize(
    ("module", "name", "arguments"),
    [
        ("fecm.cli.report", "check_page", ("report", "d.h5")),
        ("fecm.cli.export", "read", ("export", "d.h5", "--to", "vtkhdf")),
        ("fecm.simulation.job", "check_outputs", ("run", "d.inp")),  # in the program's own process
    ],
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.few(1)  # of 9, 0.4 s each
def test_a_signal_in_a_callback_is_not_lost(
    module: str, name: str, arguments: tuple[str, ...], number: signal.Signals, folder: Path
) -> None:
    (folder / "d.inp").write_text(small())
    (folder / "d.h5").touch()
    code = IN_A_CALLBACK.format(module=module, name=name)
    done = python(code, str(int(number)), *arguments, cwd=folder)
    assert done.returncode == 128 + number
    said = done.stderr.splitlines()
    assert [line for line in said if line.startswith(("fecm", "Exception", "Traceback"))] == (
        ["fecm: interrupted"] if number == signal.SIGINT else []
    )
    assert done.stdout == ""


@pytest.mark.posix
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_program_starts_gives_its_exit_status(number: signal.Signals) -> None:
    done = python(
        "import os, fecm.cli, fecm.__main__\n"
        f"fecm.cli.main = lambda: os.kill(os.getpid(), {int(number)})\n"
        "fecm.__main__.main()"
    )
    assert (done.returncode, done.stderr) == (128 + number, "")


@pytest.mark.posix
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_while_the_program_ends_changes_no_exit_status(name: str) -> None:
    done = python(
        "import atexit, os, signal, sys, fecm.__main__\n"
        f"atexit.register(os.kill, os.getpid(), signal.{name})\n"
        "sys.argv = ['fecm', '--version']\n"
        "fecm.__main__.main()"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("fecm, version ")


def test_a_profiler_sees_the_end_of_the_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "cProfile", "-m", "fecm", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("fecm, version ")
    assert "function calls" in done.stdout


def test_what_is_registered_for_the_end_of_the_program_is_called() -> None:
    done = python(
        "import atexit, sys, fecm.__main__\n"
        "atexit.register(print, 'the end')\n"
        "sys.argv = ['fecm', '--version']\n"
        "fecm.__main__.main()"
    )
    assert done.stdout.splitlines()[1:] == ["the end"]


@pytest.mark.posix
def test_nohup_keeps_a_run_from_ending_at_a_hangup() -> None:
    code = (
        "import os, signal, sys\n"
        "from fecm.cli.interrupts import signals\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "signals.install()\n"
        "os.kill(os.getpid(), signal.SIGHUP)\n"
        "print(bool(signals.received))"
    )
    assert python(code).stdout == "False\n"


@pytest.mark.linux
@pytest.mark.parametrize("megabytes", [60, 200, 250])
def test_too_little_address_space_ends_in_one_line(folder: Path, megabytes: int) -> None:
    def limit() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (megabytes * 10**6, megabytes * 10**6))

    done = subprocess.run(
        [sys.executable, "-m", "fecm", "run", "d.inp"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limit,
        timeout=20,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("fecm: error: ")
    assert done.stderr.count("\n") == 1


def test_no_line_of_the_list_of_commands_is_cut() -> None:
    page = call("--help").stdout
    lines = [line.split() for line in page.splitlines()]
    for name, command in COMMANDS.items():
        assert [name, *command.summary.split()] in lines
    assert [heading for heading in GROUPED if f"\n{heading}:\n" not in page] == []
