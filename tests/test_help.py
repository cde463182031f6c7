"""Help pages, suggestions, completion in the shell, and progress without a terminal."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from fecm import examples
from fecm.cli import cli
from tests.calls import assert_unusable, call
from tests.decks import APPENDIX, small

CONTEXT = click.Context(cli, info_name="fecm")


def commands(group: click.Command = cli, names: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Names of all commands that are no groups."""
    if not isinstance(group, click.Group):
        yield names
        return
    for name in group.list_commands(CONTEXT):
        command = group.get_command(CONTEXT, name)
        assert command is not None
        yield from commands(command, (*names, name))


def found(names: tuple[str, ...]) -> click.Command:
    """A command by its names."""
    command: click.Command = cli
    for name in names:
        assert isinstance(command, click.Group)
        inner = command.get_command(CONTEXT, name)
        assert inner is not None
        command = inner
    return command


@pytest.mark.parametrize("names", list(commands()), ids=" ".join)
def test_a_help_page_ends_with_two_calls_that_the_command_takes(
    names: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in examples.names():
        (tmp_path / name).write_bytes(examples.path(name).read_bytes())
    ply = '["mine"]\ndensity = 1.6e-9\nnu12 = 0.3\nE1 = 14e4\nE2 = 9e3\nG12 = 5e3\n'
    (tmp_path / "own-plies.toml").write_text(ply)
    for name in ("impact-patch.h5", "impact-patch-sweep.h5"):
        (tmp_path / name).write_text("")  # must only exist
    command = found(names)
    _, _, calls = call(*names, "--help").stdout.partition("Typical calls:\n")
    lines = [line.strip() for line in calls.splitlines()]
    assert len(lines) >= 2
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "fecm"
        inner = len(names) if tuple(arguments[: len(names)]) == names else 1  # rod for rod pulse
        with command.make_context(" ".join(names), arguments[inner:], parent=CONTEXT):
            pass


@pytest.mark.parametrize("name", ["new", "run", "sweep"])
def test_a_command_of_many_options_shows_them_in_groups(name: str) -> None:
    page = call(name, "--help").stdout
    last = page.partition("\nOther options:\n")[2].partition("Typical calls:")[0]
    ungrouped = {line.split()[0].strip(",") for line in last.splitlines() if line[:4].strip()}
    assert "\nOptions:" not in page
    assert len(ungrouped) <= 3
    for option in found((name,)).params:
        assert option.opts[-1] in page or isinstance(option, click.Argument)


@pytest.mark.parametrize("group", ["indent", "waves", "rod"])
def test_a_group_lists_whole_sentences(group: str) -> None:
    assert "..." not in call(group, "--help").stdout.partition("Commands:")[2]


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (("chek",), "there is no command 'chek'; did you mean check? (see fecm --help)"),
        (("plot", APPENDIX, "--kind", "forse"), "did you mean force?"),
        (("run", APPENDIX, "--slip", "tape"), "did you mean tapes?"),
        (("sweep", APPENDIX, "--vary", "velosity=1"), "did you mean velocity?"),
        (("sweep", APPENDIX, "--vary", "k=1e6", "--measure", "deflection"), "max_deflection?"),
        (("example", "impct-patch"), "did you mean impact-patch"),
        (("indent", "contacts", "report0.5"), "did you mean report-0.5?"),
    ],
)
def test_an_unknown_name_gets_the_most_similar_one(
    arguments: tuple[str, ...], hint: str, tmp_path: Path
) -> None:
    done = call(*arguments, cwd=tmp_path)
    assert_unusable(done)
    assert hint in done.stderr


def test_a_name_like_no_other_gets_no_hint_but_the_choices() -> None:
    assert call("zzzz").stderr == "fecm: error: there is no command 'zzzz'; see fecm --help\n"
    assert "'loop', 'energy'" in call("plot", APPENDIX, "--kind", "zzzz").stderr


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ("plot r.h5 --kind fo", {"force"}),
        ("plot r.h5 --quantity max_d", {"max_deflection"}),
        (
            "sweep d.inp --vary rod_",
            {f"rod_{n}=" for n in ("mass", "length", "modulus", "density")},
        ),
        ("sweep d.inp --vary velo", {"velocity=FROM:TO:N", "velocity=A,B,C"}),
        ("sweep d.inp --vary velocity=", {"velocity=FROM:TO:N", "velocity=A,B,C"}),
        ("sweep d.inp --random velo", {"velocity=normal:MEAN,SD", "velocity=uniform:A,B"}),
        ("sweep d.inp --correlation mass,velo", {"mass,velocity"}),
        ("new --material IM", {"IM7/8552", "IM7/8551-7"}),
        ("identify d.inp m.csv --free mass,velo", {"mass,velocity"}),
        ("example imp", {"impact-patch.inp"}),
    ],
)
def test_the_shell_completes_values(
    words: str, values: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_FECM_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", f"fecm {words}")
    monkeypatch.setenv("COMP_CWORD", str(len(words.split())))
    completed = {line.partition(",")[2] for line in call().stdout.splitlines()}
    assert values <= completed
    assert all(value.startswith(words.split()[-1]) for value in completed)


@pytest.mark.parametrize(
    "words", ["--vary velocity=50", "--vary velocity=50,", "--random velocity=5", "--exceed velo"]
)
def test_the_shell_proposes_no_name_inside_or_in_place_of_a_value(
    words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_FECM_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", f"fecm sweep d.inp {words}")
    monkeypatch.setenv("COMP_CWORD", "4")
    assert call().stdout.strip() == ""


@pytest.mark.parametrize("arguments", [("info",), ("plot",), ("tapes",), ("export", "--to", "csv")])
def test_a_deck_in_place_of_a_result_is_told_to_be_run(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "d.inp").write_text(f"! a comment\n{small()}")
    done = call(*arguments, "d.inp", cwd=tmp_path)
    assert_unusable(done)
    assert "d.inp is a deck, not a result; `fecm run d.inp` makes one" in done.stderr
