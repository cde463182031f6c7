"""Outputs are complete or untouched, clash with nothing, and keep what a file had."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

import fecm
from fecm import _files
from fecm._files import OutputError, beside, check_outputs, partial_of
from fecm.simulation.checkpoint import checkpoint_of
from tests.calls import assert_unusable, call
from tests.decks import small
from tests.without_posix import of_closed_files

UNALIGNED = small().replace("    1    1       0.0       0.0\n", "1,1,0.0,0.0\n")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with two decks."""
    monkeypatch.chdir(tmp_path)
    Path("d.inp").write_text(small())
    Path("two.inp").write_text(small(stop=False) + small())
    return tmp_path


def unlinked(*_: object, **__: object) -> None:
    """Refuse a hard link."""
    raise PermissionError(errno.EPERM, "this file system has no hard links")


def names(folder: Path) -> list[str]:
    """Names in a folder."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.links
@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "d.inp", "-o", "x.h5", "--print", "x.h5"),
        ("run", "d.inp", "-o", "x.h5", "--print", "./here/x.h5"),
        ("run", "d.inp", "-o", "x.h5", "--print", "x.h5.spool"),
        ("run", "two.inp", "-o", "x.h5", "--print", "x-2.h5"),
        ("run", "d.inp", "-o", "d.inp"),
        ("run", "d.inp", "--print", "here/d.inp"),
        ("run", "link.inp", "-o", "d.inp"),
        ("run", "hard.inp", "-o", "d.inp"),
        ("sweep", "d.inp", "--vary", "velocity=1,2", "-o", "d.inp"),
        ("rod", "--pulse", "sine:1,1", "--length", "1", "--modulus", "1", "--density", "1",
         "--diameter", "1", "-o", "x.svg", "--plot", "x.svg"),
    ],
)  # fmt: skip
def test_outputs_are_neither_each_other_nor_inputs(
    folder: Path, arguments: tuple[str, ...]
) -> None:
    Path("here").symlink_to(".")
    Path("link.inp").symlink_to("d.inp")
    os.link("d.inp", "hard.inp")
    before = names(folder)
    done = call(*arguments, "--overwrite")
    assert done.exit_code == 2
    assert "is an input" in done.stderr or "the name of two outputs" in done.stderr
    assert done.stdout == ""
    assert names(folder) == before
    assert Path("d.inp").read_text() == small()


@pytest.mark.links
@pytest.mark.parametrize("kind", ["fifo", "device", "folder"])
@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "d.inp", "--overwrite", "-o"),
        ("run", "d.inp", "--overwrite", "--print"),
        ("fmt", "d.inp", "--overwrite", "-o"),
        ("fmt",),
    ],
)
def test_what_is_no_ordinary_file_is_never_replaced(
    folder: Path, arguments: tuple[str, ...], kind: str
) -> None:
    match kind:
        case "fifo":
            os.mkfifo("out")
        case "device":
            Path("out").symlink_to("/dev/null")
        case _:
            Path("out").mkdir()
    if arguments == ("fmt",) and kind == "folder":
        pytest.skip("click itself refuses to read a folder")

    def identity() -> tuple[int, int, int]:
        status = Path("out").lstat()
        return status.st_ino, status.st_mode, status.st_mtime_ns

    before = identity()
    done = call(*arguments, "out")
    assert done.exit_code == 2
    assert "out is not a regular file" in done.stderr or "out is a folder" in done.stderr
    assert identity() == before
    assert names(folder) == ["d.inp", "out", "two.inp"]
    with pytest.raises(OutputError), beside(Path("out")):
        pass


@pytest.mark.links
def test_of_a_link_the_target_is_replaced_and_a_dangling_one_is_refused(folder: Path) -> None:
    Path("deck.inp").write_text(UNALIGNED)
    Path("link.inp").symlink_to("deck.inp")
    assert call("fmt", "link.inp").exit_code == 0
    assert Path("link.inp").readlink() == Path("deck.inp")
    assert Path("deck.inp").read_text() != UNALIGNED
    Path("dangling.h5").symlink_to("far.h5")
    refused = call("run", "d.inp", "-o", "dangling.h5")
    assert refused.exit_code == 2
    assert "does not exist; --overwrite creates it" in refused.stderr
    assert not Path("far.h5").exists()
    assert call("run", "d.inp", "-o", "dangling.h5", "--overwrite").exit_code == 0
    assert Path("dangling.h5").is_symlink()
    assert Path("far.h5").is_file()
    Path("loop.h5").symlink_to("loop.h5")
    assert_unusable(call("fmt", "d.inp", "-o", "loop.h5", "--overwrite"))


@pytest.mark.posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444])
def test_a_replaced_file_keeps_its_permissions_and_is_private_until_then(
    folder: Path, mode: int
) -> None:
    Path("deck.inp").write_text(UNALIGNED)
    Path("deck.inp").chmod(mode)
    with beside(Path("deck.inp")) as partial:
        assert stat.S_IMODE(partial.stat().st_mode) == 0o600
    assert Path("deck.inp").read_bytes() == b""
    Path("deck.inp").unlink()
    Path("deck.inp").write_text(UNALIGNED)
    Path("deck.inp").chmod(mode)
    assert call("fmt", "deck.inp").exit_code == 0
    assert stat.S_IMODE(Path("deck.inp").stat().st_mode) == mode
    with beside(Path("new")):
        pass
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(Path("new").stat().st_mode) == 0o666 & ~mask


@pytest.mark.posix
def test_a_file_that_only_its_owner_may_replace_is_refused_before_the_computation(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = folder / "shared"
    shared.mkdir()
    shared.chmod(0o1777)
    (shared / "r.h5").write_text("")
    (folder / "link.h5").symlink_to(shared / "r.h5")
    check_outputs([shared / "r.h5"], overwrite=True)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    check_outputs([shared / "new.h5"], overwrite=True)
    for name in ("shared/r.h5", "link.h5"):
        with pytest.raises(OutputError, match="belongs to another user"):
            fecm.Run("d.inp", output=name, overwrite=True)


@pytest.mark.posix
def test_a_file_is_synced_before_it_has_its_name_and_its_folder_after(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[str, bool]] = []
    sync = os.fsync

    def watched(handle: int) -> None:
        kind = "folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file"
        seen.append((kind, Path("x.csv").exists()))
        sync(handle)

    monkeypatch.setattr(os, "fsync", watched)
    for overwrite in (False, True):
        with beside(Path("x.csv"), overwrite=overwrite) as partial:
            partial.write_text("1")
        Path("x.csv").unlink()
    assert seen == 2 * [("file", False), ("folder", True)]


@pytest.mark.linux
@pytest.mark.parametrize("links", [True, False])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_files_are_closed_before_they_are_renamed_or_removed_where_that_is_needed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    monkeypatch.setattr(_files, "OPEN_FILES_STAY", True)
    for name in ("unlink", "replace"):
        monkeypatch.setattr(os, name, of_closed_files(getattr(os, name)))
    if not links:
        monkeypatch.setattr(os, "link", unlinked)
    assert call("run", "d.inp").exit_code == 0
    assert call("run", "d.inp", "--overwrite").exit_code == 0
    assert names(folder) == ["d.h5", "d.inp", "two.inp"]
    with beside(Path("x.h5")):
        refused = call("run", "d.inp", "-o", "x.h5")
    assert "x.h5 is being written by another process" in refused.stderr
    with pytest.raises(ZeroDivisionError), beside(Path("y.h5")):
        _ = 1 / 0
    assert names(folder) == ["d.h5", "d.inp", "two.inp", "x.h5"]


def test_two_processes_never_write_the_same_output_at_a_time(folder: Path) -> None:
    with beside(Path("x.h5")) as partial:
        partial.write_text("first")
        refused = call("run", "d.inp", "-o", "x.h5", "--overwrite")
        assert refused.exit_code == 2
        assert "x.h5 is being written by another process" in refused.stderr
        with pytest.raises(OutputError, match="is being written"), beside(Path("x.h5")):
            pass
    assert Path("x.h5").read_text() == "first"


@pytest.mark.parametrize("links", [True, False])
def test_a_file_made_meanwhile_is_not_replaced_unasked(
    folder: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    if not links:
        monkeypatch.setattr(os, "link", unlinked)
    with contextlib.ExitStack() as stack:
        stack.enter_context(beside(Path("x.h5"), overwrite=False)).write_text("mine")
        Path("x.h5").write_text("theirs")
        with pytest.raises(OutputError, match=r"x\.h5 was created by another program meanwhile"):
            stack.close()
    assert Path("x.h5").read_text() == "theirs"
    with beside(Path("y.h5"), overwrite=False) as partial:
        partial.write_text("mine")
    assert Path("y.h5").read_text() == "mine"
    assert names(folder) == ["d.inp", "two.inp", "x.h5", "y.h5"]


def test_commands_without_overwrite_rename_exclusively(
    folder: Path, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(runs / "small.h5", "d.h5")
    finish = _files._finish

    def late(file: io.FileIO, partial: Path, target: Path, overwrite: bool) -> None:
        if not target.name.endswith((".checkpoint", ".json", ".npz")):
            target.write_text("theirs")
        finish(file, partial, target, overwrite)

    monkeypatch.setattr(_files, "_finish", late)
    for arguments, name in (
        (("run", "d.inp", "-o", "a.h5"), "a.h5"),
        (("export", "d.h5", "--to", "csv", "-o", "a.csv"), "a.csv"),
        (("export", "d.h5", "--to", "vtkhdf", "-o", "a.vtkhdf"), "a.vtkhdf"),
        (("tapes", "d.h5", "-d", "tapes"), "tapes/tape9"),
        (("plot", "d.h5", "-o", "a.png"), "a.png"),
        (("fmt", "d.inp", "-o", "a.inp"), "a.inp"),
        (("sweep", "d.inp", "--vary", "velocity=90,91", "-o", "s.h5"), "s.h5"),
    ):
        done = call(*arguments)
        assert (done.exit_code, Path(name).read_text()) == (2, "theirs"), name
        assert "meanwhile and is not replaced" in done.stderr


@pytest.mark.links
def test_what_a_killed_process_has_left_is_removed_and_no_link_is_followed(folder: Path) -> None:
    victim = Path("victim")
    victim.write_text("precious")
    partial = partial_of(Path("x.h5"))
    partial.write_text("half of it")
    with beside(Path("x.h5")) as own:
        assert own.read_bytes() == b""
    os.link(victim, partial)
    with beside(Path("x.h5")) as own:
        own.write_text("new")
    partial.symlink_to("victim")
    with beside(Path("x.h5")) as own:
        own.write_text("new")
    assert victim.read_text() == "precious"
    assert names(folder) == ["d.inp", "two.inp", "victim", "x.h5"]
    partial.write_text("half of it")
    _files.clear_partials([folder])
    assert not partial.exists()
    with beside(Path("x.h5")) as own:
        _files.clear_partials([folder])
        assert own.exists()


@pytest.mark.posix
def test_a_partial_file_that_somebody_removes_is_an_error(folder: Path) -> None:
    with contextlib.ExitStack() as stack:
        partial = stack.enter_context(beside(Path("x.h5")))
        partial.unlink()
        partial.write_text("another one")
        with pytest.raises(OutputError, match="was removed during"):
            stack.close()
    assert not Path("x.h5").exists()


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_every_disk_error_names_the_file(
    folder: Path, runs: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    shutil.copy(runs / "small.h5", "d.h5")

    def full(handle: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "fsync", full)
    for arguments, name in (
        (("run", "d.inp", "-o", "a.h5"), "a.h5"),
        (("export", "d.h5", "--to", "csv", "-o", "a.csv"), "a.csv"),
        (("tapes", "d.h5", "-d", "tapes"), "tapes/tape9"),
        (("plot", "d.h5", "-o", "a.png"), "a.png"),
        (("fmt", "d.inp"), "d.inp"),
    ):
        done = call(*arguments)
        assert done.exit_code == 2
        assert done.stderr.endswith(f"fecm: error: {name}: {os.strerror(code)}\n")
    assert names(folder) == ["d.h5", "d.inp", "tapes", "two.inp"]
    assert names(folder / "tapes") == []


def test_tapes_are_replaced_only_when_asked_for_and_all_or_none(
    folder: Path, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(runs / "small.h5", "d.h5")
    Path("tape8").write_text("precious")
    assert_unusable(call("tapes", "d.h5"))
    assert names(folder) == ["d.h5", "d.inp", "tape8", "two.inp"]
    assert call("tapes", "d.h5", "-d", "out").exit_code == 0

    def strains(*_: object) -> Iterator[str]:
        yield "a line\n"
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("fecm.listing.tapes._strain_lines", strains)
        assert call("tapes", "d.h5", "--overwrite").exit_code == 2
    assert Path("tape8").read_text() == "precious"
    assert names(folder) == ["d.h5", "d.inp", "out", "tape8", "two.inp"]
    assert call("tapes", "d.h5", "--overwrite").exit_code == 0
    for name in ("tape3", "tape8", "tape9"):
        assert Path(name).read_bytes() == (folder / "out" / name).read_bytes()
    Path("file").write_text("")
    assert_unusable(call("tapes", "d.h5", "-d", "file"))


def test_fmt_asks_before_it_replaces_another_file_and_reads_no_more_than_check(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("deck.inp").write_text(UNALIGNED)
    Path("other.inp").write_text("precious")
    assert_unusable(call("fmt", "deck.inp", "-o", "other.inp"))
    assert Path("other.inp").read_text() == "precious"
    assert call("fmt", "deck.inp", "-o", "./deck.inp").exit_code == 0
    assert Path("deck.inp").read_text() != UNALIGNED
    monkeypatch.setattr("fecm.deck.reader.LARGEST_FILE", 100)
    done = call("fmt", "deck.inp", "--check")
    assert_unusable(done)
    assert "more than 100 bytes" in done.stderr


def test_pictures_go_to_a_folder_that_is_made(folder: Path, runs: Path) -> None:
    pytest.importorskip("matplotlib")
    shutil.copy(runs / "small.h5", "d.h5")
    done = call("plot", "d.h5", "-o", "new/pictures/", "--kind", "force", "--kind", "energy")
    assert done.exit_code == 0
    assert names(folder / "new" / "pictures") == ["d-energy.png", "d-force.png"]


def test_the_advice_after_another_choice_of_options_can_be_followed(folder: Path) -> None:
    checkpoint_of(Path("d.h5")).write_bytes(b"no checkpoint")
    refused = call("run", "d.inp", "--resume")
    assert refused.exit_code == 2
    assert "--overwrite without --resume discards" in refused.stderr
    assert call("run", "d.inp", "--overwrite").exit_code == 0
    assert names(folder) == ["d.h5", "d.inp", "two.inp"]


def test_of_many_outputs_the_one_that_is_named_twice_is_found(folder: Path) -> None:
    paths = [Path(f"x-{n}.h5") for n in range(300)]
    check_outputs(paths, overwrite=False, inputs=[Path("d.inp")])
    with pytest.raises(OutputError, match=r"x-7\.h5 is the name of two"):
        check_outputs([*paths, paths[7]], overwrite=False)
