"""The command line as its user sees it: output, files and exit status."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from fecm.listing import slips
from tests.calls import assert_unusable, call, program
from tests.decks import APPENDIX, DATA_CARDS, ROOT, small


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    """A small deck in a folder of its own."""
    path = tmp_path / "small.inp"
    path.write_text(small())
    return path


@pytest.mark.long
def test_a_call_in_this_process_gives_what_the_program_gives(deck: Path) -> None:
    deck.write_text(small(stop=False) + small(data=DATA_CARDS.replace("115.0", " 90.0")))
    for status, *arguments in (
        (0, "run", "small.inp", "--overwrite"),
        (1, "diff", "small.h5", "small-2.h5"),
        (2, "tapes", "small.inp"),
    ):
        done = program(*arguments, cwd=deck.parent)
        assert done.exit_code == status
        assert call(*arguments, cwd=deck.parent) == done


def test_a_run_writes_its_result_beside_the_user_and_says_what_came_out(tmp_path: Path) -> None:
    done = call("run", APPENDIX, cwd=tmp_path)
    assert done.exit_code == 0
    assert re.findall(r"(error|warning|note)\[(\w+)\]", done.stderr) == [
        ("note", "N414"),
        ("warning", "W415"),
    ]
    assert [p.name for p in tmp_path.iterdir()] == ["appendix.h5"]
    for words in (
        "peak force",
        "6.19 ",
        "contact",
        "largest indent",
        "energy  ",
        "appendix.h5",
    ):
        assert words in done.stdout


def test_the_file_has_the_promised_layout(tmp_path: Path) -> None:
    call("run", APPENDIX, cwd=tmp_path)
    with h5py.File(tmp_path / "appendix.h5") as file:
        attributes = dict(file.attrs)
        assert attributes["format"] == "fecm"
        assert attributes["format_version"] == 1
        assert attributes["mode"] == "report"
        assert list(attributes["slips"]) == []
        assert file["deck"].asstr()[()].startswith("FECM **LOW")
        assert file["deck"].asstr()[()].endswith("\nSTOP\n")
        shapes = {
            "mesh/coordinates": (609, 2), "mesh/elements": (140, 9), "mesh/equations": (609, 5),
            "laminate/A": (3, 3), "laminate/shear": (2, 2), "tape3/w": (2, 609),
            "tape3/displacement": (2, 609, 5), "tape8/kappa_xy": (2, 140, 9), "tape9/force": (2,),
            "history/plate_w": (10,), "energy/balance_error": (10,),
        }  # fmt: skip
        for path, shape in shapes.items():
            assert file[path].shape == shape
        assert file["mesh/elements"].dtype == np.int32
        assert file["history/step"].dtype == np.int64
        assert file["tape8"].attrs["location"] == "nodes"
        assert file["energy"].attrs["initial"] == pytest.approx(1.19659, rel=1e-5)
        descriptions: list[str] = []
        file.visititems(
            lambda name, item: (
                descriptions.append(item.attrs.get("description", ""))
                if isinstance(item, h5py.Dataset)
                else None
            )
        )
        assert all(descriptions)
        assert file["history/acceleration"].attrs["dimension"] == "length/time^2"


def test_the_deck_in_a_result_runs_again_to_the_same_numbers(deck: Path) -> None:
    call("run", deck, cwd=deck.parent)
    with h5py.File(deck.parent / "small.h5") as file:
        (deck.parent / "again.inp").write_text(file["deck"].asstr()[()])
        force = file["history/force"][()]
    assert call("run", "again.inp", cwd=deck.parent).exit_code == 0
    with h5py.File(deck.parent / "again.h5") as file:
        np.testing.assert_array_equal(file["history/force"][()], force)


def test_an_existing_result_is_kept_unless_told_otherwise(deck: Path) -> None:
    target = deck.parent / "small.h5"
    target.write_text("precious")
    refused = call("run", deck, cwd=deck.parent)
    assert refused.exit_code == 2
    assert "--overwrite" in refused.stderr
    assert target.read_text() == "precious"
    assert call("run", deck, "--overwrite", cwd=deck.parent).exit_code == 0
    assert h5py.is_hdf5(target)


def test_every_output_is_checked_before_the_first_run(deck: Path) -> None:
    deck.write_text(small(stop=False) + small())
    (deck.parent / "small-2.h5").write_text("precious")
    refused = call("run", deck, cwd=deck.parent)
    assert refused.exit_code == 2
    assert not (deck.parent / "small.h5").exists()
    (deck.parent / "small-2.h5").unlink()
    assert call("run", deck, cwd=deck.parent).exit_code == 0
    assert h5py.is_hdf5(deck.parent / "small-2.h5")


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "nothing.inp"),
        ("run",),
        ("run", "small.inp", "--mode", "other"),
        ("run", "small.inp", "--slip", "other"),
        ("run", "small.inp", "--mode", "listing", "--slip", "density"),
        ("run", "small.inp", "-o", "no/such/folder.h5"),
        ("run", "small.inp", "-o", "."),
        ("tapes", "small.inp"),
        ("tapes", "nothing.h5"),
        ("nonsense",),
        ("--nonsense",),
    ],
)
def test_an_unusable_call_exits_2_with_a_message_and_no_traceback(
    deck: Path, arguments: tuple[str, ...]
) -> None:
    done = call(*arguments, cwd=deck.parent)
    assert done.exit_code == 2
    assert "rror" in done.stderr
    assert "Traceback" not in done.stderr
    assert [p.name for p in deck.parent.iterdir()] == ["small.inp"]


def test_a_deck_with_errors_is_not_run(deck: Path) -> None:
    deck.write_text(small(data=DATA_CARDS.replace("     115.0", "     1l5.0")))
    done = call("run", deck, cwd=deck.parent)
    assert done.exit_code == 2
    assert re.search(r"small\.inp:\d+:11: error\[E101\]: `1l5.0` is not a number\.", done.stderr)
    assert not (deck.parent / "small.h5").exists()


@pytest.mark.parametrize("mode", ["report", "listing"])
def test_a_run_that_diverges_exits_1_names_step_and_cause_and_leaves_no_file(
    deck: Path, mode: str
) -> None:
    program = "LMAS\nDT        .5E-5\nLOOP       2000\nTIME\nRODP\nNEXT\n"
    deck.write_text(small(program))
    refused = call("run", deck, "--mode", mode, cwd=deck.parent)
    assert refused.exit_code == 2
    assert "error[E508]" in refused.stderr
    done = call("run", deck, "--mode", mode, "--force", cwd=deck.parent)
    assert done.exit_code == 1
    assert re.search(r"diverged at step \d+", done.stderr)
    assert "DT = 5e-06 is above the plate's critical time step" in done.stderr
    assert [p.name for p in deck.parent.iterdir()] == ["small.inp"]


def test_tapes_go_to_the_folder_that_is_asked_for(deck: Path) -> None:
    call("run", deck, cwd=deck.parent)
    done = call("tapes", "small.h5", "-d", "new/tapes", cwd=deck.parent)
    assert done.exit_code == 0
    names = sorted(p.name for p in (deck.parent / "new" / "tapes").iterdir())
    assert names == ["tape3", "tape8", "tape9"]
    assert len((deck.parent / "new/tapes/tape3").read_text().splitlines()) == 2 * 5


@pytest.mark.posix
def test_a_result_that_cannot_be_written_ends_in_one_line_and_leaves_what_was_there(
    deck: Path,
) -> None:
    target = deck.parent / "small.h5"
    target.write_text("precious")

    def limit() -> None:
        import resource

        # As a full disk does: every byte beyond these is refused.
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    done = subprocess.run(
        [sys.executable, "-m", "fecm", "run", str(deck), "--overwrite"],
        cwd=deck.parent,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limit,
    )
    assert done.returncode == 2
    assert "small.h5 can't be written: File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert target.read_text() == "precious"
    assert sorted(path.name for path in deck.parent.iterdir()) == ["small.h5", "small.inp"]


def test_help_names_every_slip(tmp_path: Path) -> None:
    text = re.sub(r"\s+", "", call("run", "--help", cwd=tmp_path).stdout)
    for name in slips.NAMES:
        assert name in text


def test_the_errata_page_has_a_row_for_every_slip() -> None:
    rows = re.findall(r"^\| `(.+?)` \|", (ROOT / "docs" / "errata.md").read_text(), re.MULTILINE)
    assert rows == list(slips.NAMES)


def test_listing_mode_is_all_slips_and_report_mode_none() -> None:
    assert slips.active_slips("report") == frozenset()
    assert slips.active_slips("listing") == frozenset(slips.NAMES)
    assert slips.active_slips("report", ["target"]) == {"target"}
    assert len(slips.NAMES) == len(set(slips.NAMES))


@pytest.mark.parametrize("arguments", [("--help",), ("diff", "small.h5", "small.h5")])
@pytest.mark.few(1)  # of 2, 0.4 s each
def test_a_reader_that_leaves_is_no_answer(arguments: tuple[str, ...], runs: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as gone:
        done = subprocess.run(
            [sys.executable, "-m", "fecm", *arguments],
            stdout=gone,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            cwd=runs,
        )
    assert (done.returncode, done.stderr) == (2, "")


@pytest.mark.linux
def test_a_full_output_ends_in_one_line(tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "fecm",
                "rod",
                "--pulse",
                "sine:1,1",
                *("--length", "1"),
                *("--modulus", "1", "--density", "1", "--diameter", "1"),
            ],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            cwd=tmp_path,
        )
    assert done.returncode == 2
    assert done.stderr == "fecm: error: standard output: No space left on device\n"


@pytest.mark.parametrize("option", ["--energy-limit", "--checkpoint"])
@pytest.mark.parametrize("value", ["nan", "inf", "-1"])
def test_a_limit_that_is_no_number_is_refused(option: str, value: str, deck: Path) -> None:
    done = call("run", deck, option, value, cwd=deck.parent)
    assert done.exit_code == 2
    assert f"Invalid value for '{option}'" in done.stderr
    assert [path.name for path in deck.parent.iterdir()] == ["small.inp"]


def test_a_solver_that_is_not_installed_is_refused_in_one_line(
    deck: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm.problem.build.LIBRARY", None)
    done = call("run", deck, "--solver", "kernels", cwd=deck.parent)
    assert_unusable(done)
    assert "no compiled kernels; take the solver numpy" in done.stderr
    assert not deck.with_suffix(".h5").exists()
