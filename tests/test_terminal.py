"""Colours, quiet calls, help pages by name, completion scripts and names that people type."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

import fecm
from fecm._table import Part, Summary, Table, summary_lines, text_lines
from fecm.cli.terminal import terminal
from fecm.deck.findings import CardPlace, Finding
from tests.calls import call
from tests.decks import small
from tests.schemas import text_of

STYLED = re.compile(r"\x1b\[[0-9;]*m")
UNKNOWN = ("run", "unknown.inp")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A small deck, whose run has notes."""
    (tmp_path / "d.inp").write_text(small())
    return tmp_path


# Colours -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("variables", "options", "is_colored"),
    [
        ({}, (), False),
        ({"FORCE_COLOR": "1"}, (), True),
        ({"FORCE_COLOR": "0"}, (), False),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, (), False),
        ({"NO_COLOR": "1"}, ("--color", "always"), True),
        ({"FORCE_COLOR": "1"}, ("--color", "never"), False),
        ({"FORCE_COLOR": "1"}, ("--color", "auto"), True),
    ],
)
def test_the_option_counts_before_the_variables_and_no_color_before_force_color(
    variables: dict[str, str],
    options: tuple[str, ...],
    is_colored: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    for arguments in ((*UNKNOWN, *options), (*options, *UNKNOWN)):
        assert bool(STYLED.search(call(*arguments).stderr)) is is_colored


def test_colors_change_no_text(folder: Path) -> None:
    plain = call("run", "d.inp", cwd=folder)
    colored = call("run", "d.inp", "--overwrite", "--color", "always", cwd=folder)
    for with_color, without in (
        (colored.stdout, plain.stdout),
        (colored.stderr, plain.stderr),
    ):
        assert with_color != without
        assert STYLED.sub("", with_color) == without


def test_json_has_no_colors(folder: Path) -> None:
    done = call("run", "d.inp", "--format", "json", "--color", "always", cwd=folder)
    assert json.loads(done.stdout)["answer"].startswith("Peak force ")


def test_the_choice_of_a_call_does_not_last() -> None:
    assert STYLED.search(call(*UNKNOWN, "--color", "always").stderr)
    assert not STYLED.search(call(*UNKNOWN).stderr)


# Width -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", [60, 100])
@pytest.mark.few(1)
def test_lines_on_a_terminal_are_not_longer_than_it_and_lose_no_word(
    columns: int, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ("d.inp", "--mode", "listing")  # with notes and a warning about a card
    commands = [("check", *arguments), ("run", *arguments, "--overwrite"), ("info", "d.h5")]
    piped = [call(*command, cwd=folder, is_mixed=True).stdout for command in commands]
    answers = [call(*command, "--format", "json", cwd=folder).stdout for command in commands]
    monkeypatch.setattr(terminal, "columns", lambda stream: columns)
    for command, text, answer in zip(commands, piped, answers, strict=True):
        shown = call(*command, cwd=folder, is_mixed=True).stdout
        assert max(map(len, shown.splitlines())) <= columns < max(map(len, text.splitlines()))
        assert shown.split() == text.split()
        assert call(*command, "--format", "json", cwd=folder).stdout == answer


@pytest.mark.posix
def test_the_width_is_that_of_the_terminal_unless_columns_says_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import fcntl  # Unix only, as are the others
    import pty
    import termios

    monkeypatch.delenv("COLUMNS", raising=False)
    parent, child = pty.openpty()
    with os.fdopen(child, "w") as stream, os.fdopen(parent, "rb"):
        assert terminal.columns(stream) is None  # not known
        fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 63, 0, 0))
        assert terminal.columns(stream) == 63
        monkeypatch.setenv("COLUMNS", "47")
        assert terminal.columns(stream) == 47
    assert terminal.columns(io.StringIO()) is None


def test_a_wide_table_is_printed_in_parts_that_begin_with_its_first_column() -> None:
    table = Table((("a", "one", "two"), ("b", "three", "four")), ("name", "first", "second"))
    assert text_lines(table) == [
        "name  first  second",
        "a     one    two",
        "b     three  four",
    ]
    assert text_lines(table, columns=15) == [
        "name  first",
        "a     one",
        "b     three",
        "name  second",
        "a     two",
        "b     four",
    ]


def test_of_a_card_beyond_the_terminal_the_part_around_the_field_is_shown() -> None:
    card = f"{'A' * 60} wrong {'B' * 60}"
    finding = Finding("E101", "Not a number.", CardPlace(7, 62, 66, card, "x1"))
    *_, shown, caret = finding.render("d.inp", 60).splitlines()
    assert len(shown) <= 60
    assert shown[caret.index("^") : caret.rindex("^") + 1] == "wrong"


def test_a_group_without_rows_has_no_heading() -> None:
    summary = Summary(
        "title", "answer", (Table((), title="empty"), Table((("a", "1"),), title="b"))
    )
    assert [line.text for line in summary_lines(summary) if line.part is Part.HEADING] == ["b"]


# Quiet calls -------------------------------------------------------------------------------------


def test_a_quiet_run_prints_its_warnings_only(folder: Path) -> None:
    loud = call("run", "d.inp", cwd=folder)
    quiet = call("run", "d.inp", "--overwrite", "-q", cwd=folder)
    assert loud.stdout
    assert (quiet.stdout, quiet.stderr) == ("", loud.stderr)
    assert "note: the run ends in contact" in quiet.stderr


def test_a_quiet_sweep_prints_neither_summary_nor_price(folder: Path) -> None:
    options = ("sweep", "d.inp", "--random", "k=normal:1.9e6,1e4", "--samples", "16")
    loud = call(*options, cwd=folder)
    quiet = call("-q", *options, "--overwrite", cwd=folder)
    assert "draws share 1 plate" in loud.stderr
    assert "draws share 1 plate" not in quiet.stderr
    assert quiet.stdout == ""


def test_a_quiet_call_prints_the_result_that_it_is_for(folder: Path) -> None:
    assert json.loads(call("run", "d.inp", "-q", "--format", "json", cwd=folder).stdout)
    assert call("materials", "-q").stdout == call("materials").stdout


# JSON of sweeps ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        ("--vary", "velocity=50,100"),
        ("--refine", "1,2"),
        ("--random", "k=normal:1.9e6,1e4", "--samples", "16", "--exceed", "peak_force=1"),
    ],
)
def test_json_of_a_sweep_is_as_its_schema_says_and_has_the_columns_of_the_file(
    options: tuple[str, ...], folder: Path
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    done = call("sweep", "d.inp", *options, "--format", "json", "-o", "s.h5", cwd=folder)
    document = json.loads(done.stdout)
    jsonschema.validate(document, json.loads(text_of("sweep")))
    swept = fecm.load_sweep(folder / "s.h5")
    assert document["results"]["status"] == swept["status"].tolist()
    assert document["values"] == {name: swept[name].tolist() for name in swept.cases}
    assert document["answer"] in call("info", "s.h5", cwd=folder).stdout
    assert (document["random"] is None) is ("--random" not in options)


# Help, completion, names -------------------------------------------------------------------------


@pytest.mark.parametrize("names", [(), ("run",), ("indent", "fit")])
def test_help_of_a_command_is_its_help_page(names: tuple[str, ...]) -> None:
    page = call("help", *names)
    assert (page.exit_code, page.stdout) == (0, call(*names, "--help").stdout)


def test_help_of_an_unknown_command_says_so() -> None:
    done = call("help", "simulate")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "did you mean run?" in done.stderr
    assert "fecm run has no command 'it'" in call("help", "run", "it").stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_a_script_that_its_shell_reads(shell: str) -> None:
    script = call("completion", shell).stdout
    assert f"_FECM_COMPLETE={shell}_complete" in script
    if program := shutil.which(shell):
        subprocess.run([program, "-n"], input=script, text=True, check=True)


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("simulate", "run"),
        ("plot-force", "plot"),
        ("run_deck", "run"),
        ("validate", "check"),
        ("Init", "new"),
        ("swep", "sweep"),
        ("find", "sweep"),
    ],
)
def test_a_name_that_people_type_is_answered_by_the_command(name: str, command: str) -> None:
    done = call(name, "deck.inp")
    assert done.exit_code == 2
    assert f"there is no command {name!r}; did you mean {command}?" in done.stderr
