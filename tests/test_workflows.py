"""Workflows, the action and the files that other services read."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.decks import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
PINNED = re.compile(r"[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def loaded(name: str) -> Any:
    """The contents of a YAML file of the repository."""
    return yaml.safe_load((ROOT / name).read_text())


def test_every_action_is_pinned_by_commit_and_version_and_has_one_of_each() -> None:
    pins: set[str] = set()
    for path in [*WORKFLOWS, ROOT / "action.yml"]:
        used = re.findall(r"uses: *(.*)", path.read_text())
        assert used
        pins.update(used)
    assert [pin for pin in pins if not PINNED.fullmatch(pin)] == []
    assert len({pin.partition("@")[0] for pin in pins}) == len(pins)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_may_only_read_can_be_started_by_hand_and_end(path: Any) -> None:
    workflow = yaml.safe_load(path.read_text())
    assert workflow["permissions"] == {"contents": "read"}
    assert "workflow_dispatch" in workflow[True]  # YAML 1.1 reads the key "on" as true
    assert all("timeout-minutes" in job for job in workflow["jobs"].values())
    for script in re.findall(r"bash (\.ci/\w+)", path.read_text()):
        assert (ROOT / script).is_file()


def test_every_tool_that_ci_installs_by_name_has_a_version_that_dependabot_watches() -> None:
    installing = [*WORKFLOWS, *(path for path in (ROOT / ".ci").iterdir() if not path.suffix)]
    calls = [
        call
        for path in installing
        for call in re.findall(r"(?<!uv )pip\"? install ([^&\n]+)", path.read_text())
    ]
    assert len(calls) > 5
    folders = loaded(".github/dependabot.yml")["updates"][0]["directories"]
    for call in calls:
        (versions,) = re.findall(r"-[cr] (\S+)", call) or [""]
        names = [word for word in call.split() if re.fullmatch(r"\w[\w-]*", word)]
        text = (ROOT / versions).read_text() if versions else ""
        assert [name for name in names if f"\n{name}==" not in text] == [], call
        assert not versions or f"/{Path(versions).parent}" in folders


@pytest.mark.posix
def test_a_tag_without_a_section_of_the_changelog_is_not_released(tmp_path: Path) -> None:
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "release", tmp_path / ".ci" / "release")
    (tmp_path / "CHANGELOG.md").write_text("## [Unreleased]\n\n## [0.1.0] - 2026-11-22\n")
    git = ["git", "-c", "user.name=x", "-c", "user.email=x@example.org"]
    for words in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "x"], ["tag", "v0.2.0"]):
        subprocess.run([*git, *words], cwd=tmp_path, check=True)
    release = ["bash", ".ci/release", "dist"]
    done = subprocess.run(release, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "CHANGELOG.md has no section [0.2.0] for the tag v0.2.0\n"
    assert not (tmp_path / "dist").exists()


def test_the_site_is_built_of_files_and_extras_that_exist() -> None:
    site = loaded(".readthedocs.yaml")
    (install,) = site["python"]["install"]
    assert {*install["extra_requirements"]} <= {*PROJECT["optional-dependencies"]}
    assert (ROOT / site["sphinx"]["configuration"]).is_file()
    assert PROJECT["urls"]["Documentation"] == "https://fecm.readthedocs.io"


def test_citation_and_package_have_the_same_authors() -> None:
    assert loaded("CITATION.cff")["authors"] == PROJECT["authors"]


@pytest.mark.parametrize(
    ("tag", "commits", "expected"),
    [("v9.8.7", 1, "9.8.7"), ("v9.8.7", 2, "9.8.8.dev1"), ("another", 1, "3.2.1")],
)
def test_an_archive_without_a_repository_has_the_version_of_its_tag_or_the_fallback(
    tag: str, commits: int, expected: str, tmp_path: Path
) -> None:
    setuptools_scm = pytest.importorskip("setuptools_scm")
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    repository, copy = tmp_path / "repository", tmp_path / "copy"
    repository.mkdir()
    copy.mkdir()

    def git(*words: str) -> bytes:
        command = ["git", "-c", "user.name=x", "-c", "user.email=x@example.org", *words]
        return subprocess.run(command, cwd=repository, check=True, capture_output=True).stdout

    for name in (".gitattributes", ".git_archival.txt"):
        shutil.copy(ROOT / name, repository)
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "first")
    git("tag", tag)
    for _ in range(commits - 1):
        git("commit", "-qm", "next", "--allow-empty")
    with tarfile.open(fileobj=io.BytesIO(git("archive", "HEAD"))) as archive:
        archive.extractall(copy, filter="data")
    (version, _, _) = setuptools_scm.get_version(copy, fallback_version="3.2.1").partition("+")
    assert version == expected
