"""Workflows, the action and the files that other services read."""

from __future__ import annotations

import re
import tomllib
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


def test_the_site_is_built_of_files_and_extras_that_exist() -> None:
    site = loaded(".readthedocs.yaml")
    (install,) = site["python"]["install"]
    assert {*install["extra_requirements"]} <= {*PROJECT["optional-dependencies"]}
    assert (ROOT / site["sphinx"]["configuration"]).is_file()
    assert PROJECT["urls"]["Documentation"] == "https://fecm.readthedocs.io"


def test_citation_and_package_have_the_same_authors() -> None:
    assert loaded("CITATION.cff")["authors"] == PROJECT["authors"]
