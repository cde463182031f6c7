"""Commands for programs: many decks at once, JSON by its schemas, SARIF, hooks and action."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator, FormatChecker

import fecm
from tests import schemas
from tests.calls import Done, assert_unusable, call
from tests.decks import APPENDIX, DATA, LONG, PLY_PROGRAM, ROOT, small

SCHEMAS = ROOT / "docs" / "schemas"
WRONG = small().replace("     115.0", "     1l5.0")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in: a deck without findings, one with warnings, one with errors."""
    monkeypatch.chdir(tmp_path)
    assert call("fmt", ROOT / "decks" / "pulse-load.inp", "-o", "sound.inp").exit_code == 0
    Path("doubtful.inp").write_text(small())
    Path("wrong.inp").write_text(WRONG)
    return tmp_path


class Piped(io.BytesIO):
    """Bytes on standard input."""

    name = "<stdin>"


def typed(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    """Put a text on standard input."""
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(Piped(text.encode())))


def closed(schema: Any) -> Any:
    """The schema with no other keys than it names, so that it names all of them."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    by_name = {key: closed(value) for key, value in schema.items()}
    if schema.get("type") == "object" and "properties" in schema:
        by_name.setdefault("additionalProperties", False)
    return by_name


def validate(name: str, *outputs: str) -> None:
    """Compare lines of JSON with a schema."""
    schema = json.loads((SCHEMAS / f"{name}.json").read_text())
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(closed(schema))
    for output in outputs:
        lines = [json.loads(line) for line in output.splitlines()]
        assert lines
        for line in lines:
            validator.validate(line)


@pytest.mark.parametrize(
    ("decks", "status"),
    [
        (("sound.inp", "doubtful.inp"), 0), (("wrong.inp", "sound.inp"), 1),
        (("wrong.inp", "result.h5", "sound.inp"), 2), (("--strict", "sound.inp"), 0),
        (("--strict", "sound.inp", "doubtful.inp"), 1), (("--strict", "doubtful.inp"), 1),
    ],
)  # fmt: skip
@pytest.mark.few(2)  # of 6, 0.08 s each
def test_check_reads_all_decks_and_exits_with_the_worst_status(
    folder: Path, decks: tuple[str, ...], status: int
) -> None:
    Path("result.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    for form in ("json", "sarif"):
        assert call("check", *decks, "--format", form).exit_code == status
    done = call("check", *decks)
    assert done.exit_code == status
    if "sound.inp" in decks and len(decks) > 2:
        assert "sound.inp: no findings\n" in done.stdout
    assert ("wrong.inp: the deck has 1 error" in done.stderr) == ("wrong.inp" in decks)
    assert ("result.h5 is an HDF5 file" in done.stderr) == ("result.h5" in decks)


def test_check_and_fmt_read_standard_input(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    typed(monkeypatch, WRONG)
    done = call("check", "-", "sound.inp", "--format", "json")
    assert done.exit_code == 1
    assert json.loads(done.stdout.splitlines()[0])["file"] == "<stdin>"
    typed(monkeypatch, small())
    aligned = call("fmt", "-")
    assert aligned.exit_code == 0
    assert call("fmt", "doubtful.inp", "-o", "-").stdout == aligned.stdout != small()
    assert fecm.read_deck(aligned.stdout) == fecm.read_deck(small())
    typed(monkeypatch, small())
    assert call("fmt", "--check", "-").exit_code == 1
    for text in ("", "FECM"):
        typed(monkeypatch, text)
        assert call("check", "-").exit_code == 1
    monkeypatch.setattr("sys.stdin", None)
    assert call("check", "-").exit_code == 1
    assert sorted(path.name for path in folder.iterdir()) == [
        "doubtful.inp",
        "sound.inp",
        "wrong.inp",
    ]


def test_fmt_aligns_every_deck_that_it_can_read(folder: Path) -> None:
    sound = Path("sound.inp").stat()
    done = call("fmt", "wrong.inp", "doubtful.inp", "sound.inp")
    assert done.exit_code == 2
    assert "wrong.inp: the deck can't be read; nothing was written" in done.stderr
    assert Path("wrong.inp").read_text() == WRONG
    assert call("fmt", "--check", "doubtful.inp", "sound.inp").exit_code == 0
    assert Path("sound.inp").stat().st_mtime_ns == sound.st_mtime_ns
    assert_unusable(call("fmt", "doubtful.inp", "sound.inp", "-o", "new.inp"))


def test_findings_as_sarif_are_valid_and_have_their_place(folder: Path) -> None:
    Path("a folder").mkdir()
    Path("wrong.inp").rename("a folder/wrong.inp")
    done = call("check", "a folder/wrong.inp", folder / "doubtful.inp", "--format", "sarif")
    log = json.loads(done.stdout)
    schema = json.loads((DATA / "sarif-2.1.0-subset.json").read_text())
    Draft202012Validator(schema, format_checker=FormatChecker()).validate(log)
    (run,) = log["runs"]
    rules = [rule["id"] for rule in run["tool"]["driver"]["rules"]]
    first = run["results"][0]
    place = first["locations"][0]["physicalLocation"]
    assert (first["ruleId"], first["level"], rules[first["ruleIndex"]]) == ("E101", "error", "E101")
    assert run["tool"]["driver"]["rules"][first["ruleIndex"]]["shortDescription"] == {
        "text": "A field is not a number, or a whole number has a decimal point."
    }
    assert place["artifactLocation"]["uri"] == "a%20folder/wrong.inp"
    line = WRONG.splitlines()[place["region"]["startLine"] - 1]
    assert place["region"]["snippet"]["text"] == line
    columns = slice(place["region"]["startColumn"] - 1, place["region"]["endColumn"] - 1)
    assert line[columns].strip() == "1l5.0"
    assert first["message"]["text"].endswith("Hint: it has a letter in place of a digit.")
    uris = {
        r["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] for r in run["results"][1:]
    }
    assert uris == {(folder / "doubtful.inp").as_uri()}
    page = (ROOT / "docs" / "findings.md").read_text()
    for rule in run["tool"]["driver"]["rules"]:
        assert f"{{#{rule['helpUri'].partition('#')[2]}}}" in page
        assert rule["fullDescription"]["text"].startswith(rule["shortDescription"]["text"])
        assert rule["help"]["text"]
    broken = call("check", "sound.inp", "/dev/null", "--format", "sarif")
    Draft202012Validator(schema).validate(json.loads(broken.stdout))
    assert_unusable(call("check", "sound.inp", "--mesh-error", "--format", "sarif"))


def test_a_hint_that_is_a_question_has_no_full_stop_in_sarif(folder: Path) -> None:
    Path("wrong.inp").write_text(small().replace("EXPE", "EXPR"))
    (run,) = json.loads(call("check", "wrong.inp", "--format", "sarif").stdout)["runs"]
    texts = [result["message"]["text"] for result in run["results"]]
    assert "`EXPR` is not a keyword here. Hint: did you mean EXPE?" in texts


def test_outputs_of_check_run_info_and_diff_are_as_their_schemas_say(folder: Path) -> None:
    def output_of(*arguments: object, status: int = 0) -> str:
        done: Done = call(*arguments, "--format", "json")
        assert done.exit_code == status, done.stderr
        return done.stdout

    Path("plies.inp").write_text(small(PLY_PROGRAM, stop=False) + small("LMAS\nDT        .5E-6\n"))
    validate("check", output_of("check", LONG, "wrong.inp", "sound.inp", "plies.inp", status=1))
    validate("check", output_of("check", "doubtful.inp", "--mesh-error"))
    runs = output_of("run", "plies.inp", "-o", "a.h5"), output_of("run", "sound.inp", "-o", "b.h5")
    validate("run", *runs, output_of("run", "doubtful.inp", "-o", "c.h5", "--print", "c.txt"))
    swept = call("sweep", "doubtful.inp", "--vary", "velocity=50,100", "-o", "s.h5")
    assert swept.exit_code in (0, 1), swept.stderr
    results = ("a.h5", "a-2.h5", "b.h5", "c.h5", "s.h5")
    validate("info", *(output_of("info", result) for result in results))
    shutil.copy("c.h5", "d.h5")
    Path("slow.inp").write_text(small().replace("115.0", "100.0"))
    assert call("run", "slow.inp", "-o", "e.h5").exit_code == 0
    own = ("--tol", "history=1e-6,1", "--exclude", "tape3")
    validate(
        "diff", output_of("diff", "c.h5", "d.h5"), output_of("diff", "c.h5", "e.h5", *own, status=1)
    )
    validate("modes", output_of("modes", "sound.inp"))
    validate("diff", output_of("diff", "a.h5", "c.h5", status=1), output_of("diff", "s.h5", "s.h5"))


def test_the_schemas_are_those_of_the_types_of_the_outputs() -> None:
    # Write them anew by: python -m tests.schemas docs/schemas
    assert sorted(path.stem for path in SCHEMAS.iterdir()) == sorted(schemas.OUTPUTS)
    for name in schemas.OUTPUTS:
        assert (SCHEMAS / f"{name}.json").read_text(encoding="utf-8") == schemas.text_of(name)


def test_a_schema_refuses_what_the_command_does_not_print(folder: Path) -> None:
    said = json.loads(call("check", "wrong.inp", "--format", "json").stdout.splitlines()[0])
    schema = json.loads((SCHEMAS / "check.json").read_text())
    validator = Draft202012Validator(schema)
    assert validator.is_valid(said)
    for change in ({"severity": "fatal"}, {"line": "3"}, {"code": "X1"}, {"kind": "thing"}):
        assert not validator.is_valid(said | change)
    for key in said:
        assert not validator.is_valid({k: v for k, v in said.items() if k != key})


FECM = f'exec "{sys.executable}" -m fecm "$@"'


def shell_step(
    number: int, folder: Path, *, program: str = FECM, **inputs: str
) -> subprocess.CompletedProcess[str]:
    """Run a shell step of the action as a runner does, with `program` as ``fecm`` of its venv."""
    steps = [
        s for s in yaml.safe_load((ROOT / "action.yml").read_text())["runs"]["steps"] if "run" in s
    ]
    tool = folder / "fecm-venv" / "bin" / "fecm"
    tool.parent.mkdir(parents=True, exist_ok=True)
    tool.write_text(f"#!/bin/sh\n{program}\n")
    tool.chmod(0o755)
    (tool.parent / "activate").write_text(f'PATH="{tool.parent}:$PATH"\n')
    assert inputs.keys() == steps[number]["env"].keys()
    return subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", steps[number]["run"]],
        cwd=folder,
        text=True,
        env=os.environ | {"RUNNER_TEMP": str(folder)} | inputs,
        capture_output=True,
        check=False,
    )


def commands_in(log: str) -> list[str]:
    """Workflow commands of a log that a runner would obey."""
    obeyed, token = [], ""
    for line in log.splitlines():
        stop = re.fullmatch("::stop-commands::([0-9a-f]{32})", line)
        if stop and not token:
            token = stop[1]
        elif token and line == f"::{token}::":
            token = ""
        elif not token and re.match(r"\s*::|.*##\[", line):
            obeyed.append(line)
    assert not token
    return obeyed


@pytest.mark.posix
@pytest.mark.long
def test_no_name_and_no_title_of_a_deck_is_a_command_to_the_runner_of_the_action(
    folder: Path,
) -> None:
    text = small().replace(small().splitlines()[0], "FECM ::error::title")
    for name, deck in (("::error::x.inp", text), ("##[error]y.inp", WRONG)):
        Path(name).write_text(deck)
    names = "::error::x.inp ##[error]y.inp"
    done = shell_step(1, folder, DECKS=names, STRICT="true", SARIF="f.sarif")
    assert done.returncode == 1
    assert "\n::error::x.inp:" in done.stdout
    assert done.stderr == ""
    assert commands_in(done.stdout) == []
    expected = {"EXPECTED": "::error::missing.h5", "OPTIONS": ""}
    done = shell_step(2, folder, RESULT="::error::x.inp", **expected)
    assert done.returncode == 2
    assert "\n::error::title\n" in done.stdout
    assert done.stderr == ""
    assert commands_in(done.stdout) == []


@pytest.mark.long
@pytest.mark.posix
def test_the_steps_of_the_action_fail_for_a_wrong_deck_and_for_another_result(folder: Path) -> None:
    def check(decks: str, strict: str = "false") -> int:
        return shell_step(1, folder, DECKS=decks, STRICT=strict, SARIF="f.sarif").returncode

    assert check("sound.inp doubtful.inp") == 0
    assert check("*.inp") == 1
    assert len(json.loads((folder / "f.sarif").read_text())["runs"][0]["results"]) > 1
    assert check("sound.inp\ndoubtful.inp", "true") == 1
    fecm.run(APPENDIX, output="trusted.h5")
    shutil.copy(APPENDIX, "plate.inp")
    Path("slow.inp").write_text(APPENDIX.read_text().replace("     115.0", "     114.9"))
    for result, status in (("trusted.h5", 0), ("plate.inp", 0), ("slow.inp", 1)):
        done = shell_step(2, folder, EXPECTED="trusted.h5", RESULT=result, OPTIONS="--rtol 1e-6")
        assert done.returncode == status, done.stdout


CRASH = "echo 'Traceback: a crash' >&2; exit 1"


@pytest.mark.posix
@pytest.mark.parametrize(
    ("program", "status"),
    [
        (f"case $* in *sarif*) {CRASH};; esac", 1),  # in the second call alone
        (CRASH, 1),
        ("case $* in *sarif*) echo '{';; esac", 1),  # cut off with status 0
        ("case $* in *sarif*) echo '{}';; esac", 0),
        ("echo '{}'; exit 2", 2),
    ],
)
@pytest.mark.few(2)  # of 5, 0.2 s each
def test_a_crash_while_the_action_writes_sarif_is_shown_and_leaves_no_file(
    tmp_path: Path, program: str, status: int
) -> None:
    inputs = {"DECKS": "d.inp", "STRICT": "false", "SARIF": "f.sarif"}
    done = shell_step(1, tmp_path, program=program, **inputs)
    assert done.returncode == status
    whole = "'{}'" in program
    assert (tmp_path / "f.sarif").exists() == whole
    assert len(commands_in(done.stdout)) == (not whole)
    assert ("Traceback" in done.stdout) == ("Traceback" in program)


def test_hooks_and_action_call_commands_with_options_that_exist() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    for hook in hooks:
        name, *words = hook["entry"].split()
        assert name == "fecm"
        assert call(*words, "--help").exit_code == 0
        assert hook["files"] == r"\.inp$"
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    script = "\n".join(step.get("run", "") for step in action["runs"]["steps"])
    for command, option in (("check", "--strict"), ("check", "--format"), ("run", "--overwrite")):
        assert f"fecm {command}" in script
        assert option in script
        assert option in call(command, "--help").stdout
    values = {value for step in action["runs"]["steps"] for value in step.get("env", {}).values()}
    used = {value.split(".")[1].rstrip(" }") for value in values if "inputs." in value}
    assert used == action["inputs"].keys()


def test_the_page_of_the_package_index_has_absolute_links_only() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["metadata"]
    text = readme = (ROOT / "README.md").read_text()
    for change in build["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"], text)
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", text)
    assert len(links) == len(re.findall(r"\]\(", readme)) > 15
    for picture, link in links:
        where = "raw.githubusercontent.com/fecm/fecm" if picture else "github.com/fecm/fecm/blob"
        assert link.startswith(f"https://{where}/main/")
        assert (ROOT / link.partition("/main/")[2]).exists()
