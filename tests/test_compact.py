"""COMP: a file with fields in single precision, compressed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm.results import hdf5_writer
from tests.calls import call
from tests.stopped_runs import StoppedError, run
from tests.test_failure_runs import failing

PLAIN = failing().replace("DISP          1", "DISP          1\nSTRE          5\nPLYS          5")
COMPACT = PLAIN.replace("EXPE", "COMP\nEXPE")


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of which the small deck fills several."""
    monkeypatch.setattr(hdf5_writer, "CHUNK", 64)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_a_compact_file_has_fields_rounded_to_single_precision_and_everything_else_unchanged(
    tmp_path: Path,
) -> None:
    assert "COMP" in COMPACT
    plain, path = fecm.run_one(PLAIN), tmp_path / "compact.h5"
    compact = fecm.run_one(COMPACT, output=path)
    with h5py.File(path) as file:
        rounded = {name for name in plain if file[name].dtype == np.float32}
        assert rounded == {
            name
            for name in plain
            if name.startswith(("tape3/", "tape8/", "stresses/", "plies/"))
            and name not in ("plies/z", "plies/under_load", "stresses/x", "stresses/y")
            and plain[name].ndim > 1
        }
        for name in "tape3/displacement", "history/force", "failure/puck/time":
            assert (file[name].compression, file[name].shuffle) == ("gzip", True)
    for name in plain:
        values = plain[name]
        wanted = values.astype(np.float32) if name in rounded else values
        for result in compact, fecm.load(path):
            np.testing.assert_array_equal(result[name], wanted, name)
            assert result[name].dtype == values.dtype


@pytest.mark.usefixtures("small_chunks")
def test_a_stopped_run_goes_on_to_the_same_compact_file(tmp_path: Path) -> None:
    whole, path = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    looks = run(COMPACT, whole)
    with pytest.raises(StoppedError):
        run(COMPACT, path, looks // 2)
    run(COMPACT, path, resume=True)
    assert path.read_bytes() == whole.read_bytes()


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_a_result_in_memory_is_not_rounded_and_saved_as_the_file_of_its_run(tmp_path: Path) -> None:
    result, plain = fecm.run_one(COMPACT), fecm.run_one(PLAIN)
    for name in plain:
        np.testing.assert_array_equal(result[name], plain[name])
    result.save(tmp_path / "saved.h5")
    fecm.run_one(COMPACT, output=tmp_path / "run.h5")
    fecm.assert_same(fecm.load(tmp_path / "saved.h5"), fecm.load(tmp_path / "run.h5"))


def test_check_says_size_and_rows(tmp_path: Path) -> None:
    sizes = {}
    for name, text in (("plain", PLAIN), ("compact", COMPACT)):
        path = tmp_path / f"{name}.inp"
        path.write_text(text)
        answer = call("check", str(path))
        (size,) = (line for line in answer.stdout.splitlines() if "  output " in line)
        (rows,) = (line for line in answer.stdout.splitlines() if "  rows " in line)
        wanted = "2 of strains, 10 of displacements, 2 of stress resultants, 2 of ply stresses, "
        assert rows.split("rows", 1)[1].strip() == f"{wanted}10 of exposures"
        assert ("before compression" in size) == (name == "compact")
        (checked,) = fecm.check(text).problems
        sizes[name] = checked.output_bytes
    assert sizes["compact"] < 0.9 * sizes["plain"]
