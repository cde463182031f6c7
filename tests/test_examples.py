"""The example files of the package, and ``fecm example``."""

from __future__ import annotations

import csv
import warnings
from pathlib import Path

import pytest

import fecm
from fecm import examples
from fecm.problem.loading import load_deck
from tests.calls import assert_unusable, call

DECKS = [name for name in examples.names() if name.endswith(".inp")]
NOTES = {
    "drop-weight-held.inp": ("the supports pull the plate",),
    "panel-with-gages.inp": ("the run ends without contact, but the projectile leaves so slowly",),
}


def test_every_example_file_is_listed_with_one_line() -> None:
    folder = Path(examples.__file__).parent
    files = {path.name for path in folder.iterdir() if path.suffix in (".inp", ".csv", ".msh")}
    assert set(examples.names()) == files
    lines = call("example").stdout.splitlines()
    assert [line.split()[0] for line in lines] == examples.names()
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize("name", DECKS)
def test_example_decks_name_units_and_projectile_and_have_no_findings(name: str) -> None:
    assert load_deck(examples.path(name)).findings == []
    deck = fecm.read_one(examples.path(name))
    assert {type(segment).__name__ for segment in deck.segments} >= {"Units", "Projectile"}
    assert call("fmt", "--check", examples.path(name)).exit_code == 0


@pytest.mark.long
@pytest.mark.parametrize("name", DECKS)
def test_example_decks_run_with_the_notes_that_their_pages_explain(name: str) -> None:
    with warnings.catch_warnings(action="error"):
        warnings.simplefilter("ignore", fecm.FecmWarning)
        result = fecm.run_one(examples.path(name))
    assert not result.still_in_contact
    for note, part in zip(result.notes, NOTES.get(name, ()), strict=True):
        assert part in note


@pytest.mark.parametrize("name", [name for name in examples.names() if name.endswith(".csv")])
def test_rows_of_example_tables_have_as_many_values_as_names(name: str) -> None:
    text = examples.path(name).read_text(encoding="utf-8")
    rows = list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))
    assert len(rows) > 5
    assert {len(row) for row in rows} == {len(rows[0])}


def test_an_example_is_written_as_it_is_in_the_package(tmp_path: Path) -> None:
    for arguments in (("pulse.csv",), ("pulse", "-o", "other.csv"), ("pulse", "--overwrite")):
        assert call("example", *arguments, cwd=tmp_path).exit_code == 0
    for name in ("pulse.csv", "other.csv"):
        assert (tmp_path / name).read_bytes() == examples.path("pulse").read_bytes()
    assert call("example", "pulse", "-o", "-").stdout == examples.path("pulse").read_text()


def test_an_unknown_example_and_an_existing_file_are_refused(tmp_path: Path) -> None:
    assert_unusable(call("example", "pulses"))
    assert_unusable(call("example", "--overwrite"))
    (tmp_path / "pulse.csv").write_text("mine\n")
    assert_unusable(call("example", "pulse.csv", cwd=tmp_path))
    assert_unusable(call("example", "pulse", "-o", examples.path("pulse"), "--overwrite"))
    assert (tmp_path / "pulse.csv").read_text() == "mine\n"
    with pytest.raises(ValueError, match="did you mean pulse"):
        examples.path("pulses")
