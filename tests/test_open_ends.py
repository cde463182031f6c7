"""A run that ends in contact says so everywhere, and shows nothing that depends on its end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.results.summary import run_summary
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, small

# The small plate is hit and released within 315 steps.
CLOSED = small(program=PROGRAM.replace(" 10\n", "330\n"))


@pytest.mark.parametrize(
    ("force", "still"), [([], False), ([0.0], False), ([0.0, 2.0], True), ([2.0, 0.0], False)]
)
def test_a_contact_is_open_where_the_last_force_is_above_zero(
    force: list[float], still: bool
) -> None:
    result = Result({"history/force": np.array(force)}, {}, {})
    assert result.still_in_contact is still


def test_a_summary_shows_no_end_of_a_contact_that_has_none() -> None:
    open_, closed = fecm.run_one(small()), fecm.run_one(CLOSED)
    assert (open_.still_in_contact, closed.still_in_contact) == (True, False)
    text = "\n".join(run_summary(open_))
    assert "contact           from 5e-07, still in contact at the end" in text
    assert text.count("permanent open") == 1
    text = "\n".join(run_summary(closed))
    assert "still in contact" not in text
    assert "open" not in text


def test_run_and_info_say_that_a_run_ends_in_contact(tmp_path: Path) -> None:
    for name, deck, still in (("open", small(), True), ("closed", CLOSED, False)):
        (tmp_path / f"{name}.inp").write_text(deck)
        path = tmp_path / f"{name}.h5"
        done = call("run", tmp_path / f"{name}.inp", "-o", path)
        assert done.exit_code == 0
        assert ("note: the run ends in contact" in done.stderr) is still
        assert ("still in contact at the end" in done.stdout) is still
        assert ("still in contact at the end" in call("info", path).stdout) is still
        said = json.loads(call("info", path, "--format", "json").stdout)
        assert said["still_in_contact"] is still
        (history,) = (group for group in said["groups"] if group["name"] == "history")
        assert (history["attributes"]["permanent_indentation"] == "NaN") is still


def test_a_run_without_impact_never_ends_in_contact() -> None:
    program = "LMAS\nDT        .5E-6\nLOOP          2\nTIME\nDISP\nNEXT\n"
    result = fecm.run_one(small(program, data=DATA_CARDS[DATA_CARDS.index("MATE") :]))
    assert not result.still_in_contact
    assert run_summary(result) == ["largest w         0: nothing moved the plate"]
