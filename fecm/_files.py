"""Output files. Each is written completely, or an existing file stays unchanged.

A file is written under a temporary name, synced, and renamed when it is complete. The partial file
is locked, so that two processes never write the same output at the same time. A partial file
without a lock was left by a process that has ended; it is removed. Windows has no such locks, but
it refuses to remove an open file, which has the same effect.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from fecm._errors import FecmError

# Not available on Windows.
NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
NO_WAIT = getattr(os, "O_NONBLOCK", 0)

# Windows neither removes nor renames an open file.
OPEN_FILES_STAY = os.name == "nt"

# Errors of os.link on file systems without hard links; the last one occurs on Windows.
NO_LINKS = {
    errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EINVAL,
}  # fmt: skip
ATTEMPTS = 10  # to create a partial file while others remove it


class OutputError(FecmError, OSError):
    """An output can't be written; the message says why."""


class NoFolderError(OutputError, FileNotFoundError):
    """The folder of an output does not exist."""


class OutputExistsError(OutputError, FileExistsError):
    """An output exists and may not be replaced."""


def check_outputs(
    paths: Sequence[Path],
    overwrite: bool,
    inputs: Iterable[Path] = (),
    own: Iterable[Path] = (),
) -> None:
    """Refuse outputs that conflict, exist, or can't be written, before the computation.

    `inputs` are files that the command reads; they are never replaced. `own` are other files that
    it writes, such as checkpoints. No output may have their names, none may be a folder, and their
    names must not be too long.
    """
    if Path("-") in (*paths, *own):
        raise OutputError("- is a standard stream, and this needs a file; give its name")
    read = {key for path in inputs for key in _keys(path)}
    used = {key for path in own for key in _keys(path)}
    for path in paths:
        keys = _keys(path)
        if read & keys:
            raise OutputError(f"{path} is an input, which is not replaced; give another name")
        if used & keys:
            raise OutputError(f"{path} is the name of two outputs; give them different names")
        used |= keys
    for path in own:
        _refuse_folder(path)
    for path in paths:
        mode = _mode(path)
        _refuse_special(path, mode)
        target = final(path)
        if not target.parent.is_dir():
            raise NoFolderError(f"{path}: there is no folder {target.parent}")
        if mode is not None and not overwrite:
            raise OutputExistsError(f"{path} exists already; overwrite=True replaces it")
        if path.is_symlink() and not overwrite:
            lack = f"{path} is a link to {target}, which does not exist"
            raise OutputExistsError(f"{lack}; overwrite=True creates it")
        if _is_protected(target):
            raise OutputError(
                f"{path} belongs to another user, and {target.parent} lets only its owner replace "
                "it (sticky bit); give another name"
            )
        if not _discard(partial_of(target)):
            raise OutputError(f"{path} is being written by another process")


def _is_protected(target: Path) -> bool:
    """Return whether the folder of an existing file lets only other users replace it."""
    try:
        owners = target.lstat().st_uid, target.parent.stat().st_uid
        is_sticky = bool(target.parent.stat().st_mode & stat.S_ISVTX)
    except OSError:
        return False
    return is_sticky and os.name == "posix" and os.geteuid() not in (0, *owners)


def _keys(path: Path) -> set[object]:
    """Return what all paths of a file share: its real path, and device and inode if it exists."""
    keys: set[object] = {os.path.realpath(path)}
    with contextlib.suppress(OSError):
        status = path.stat()
        keys.add((status.st_dev, status.st_ino))
    return keys


def _mode(path: Path) -> int | None:
    """Return type and permissions of a file, following links; None if it does not exist."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None


def _refuse_special(path: Path, mode: int | None) -> None:
    """Refuse to replace folders, devices, FIFOs and sockets."""
    if mode is not None and not stat.S_ISREG(mode):
        raise OutputError(f"{path} is {'a folder' if stat.S_ISDIR(mode) else 'not a regular file'}")


def _refuse_folder(path: Path) -> None:
    """Refuse a file of the program if a folder has its name, or if its name is too long."""
    for name in (path, partial_of(path)):
        try:
            mode = name.lstat().st_mode
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:
                raise
            raise OutputError(
                f"the name {path} is too long; give the output a shorter one"
            ) from None
        if stat.S_ISDIR(mode):
            raise OutputError(f"{name} is a folder; remove it, or give the output another name")


def final(path: Path) -> Path:
    """Return the target of a symbolic link, which need not exist; any other path as it is."""
    if not path.is_symlink():
        return path
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OutputError(f"{path} is a link to itself")
    return target


def partial_of(path: Path) -> Path:
    """Return the temporary name under which a file is written."""
    return path.with_name(f".{path.stem}.partial{path.suffix}")


@contextlib.contextmanager
def beside(path: Path, *, overwrite: bool = True, follow: bool = True) -> Iterator[Path]:
    """Yield the path of an empty partial file, which is renamed if the block succeeds.

    The partial file has the suffix of the final name, as some writers choose the format by the
    suffix. A replaced file keeps its permissions and, where the user may set them, its owner and
    group. Other hard links to it keep the old contents.

    `overwrite` replaces an existing file, even one created during the block. `follow` replaces the
    target of a symbolic link instead of the link. Raises OSError if the file can't be written; an
    existing file then stays unchanged.
    """
    target = final(path) if follow else path
    partial = partial_of(target)
    with naming(path, partial):
        mode = _mode(target)
        if follow:
            _refuse_special(path, mode)
        file = io.FileIO(_create(path, partial, 0o666 if mode is None else 0o600), "r+")
        try:
            yield partial
            _finish(file, partial, target, overwrite)
        finally:
            is_finished = file.closed or _is(file.fileno(), partial)
            if OPEN_FILES_STAY:
                file.close()
            if is_finished:
                with contextlib.suppress(PermissionError):  # a writer that failed has it open
                    partial.unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                file.close()


@contextlib.contextmanager
def open_for_writing(path: Path, *, overwrite: bool) -> Iterator[TextIO]:
    """Open a text file that gets its final name when it is complete."""
    with (
        beside(path, overwrite=overwrite) as partial,
        partial.open("w", encoding="utf-8", newline="\n") as file,
    ):
        yield file


@contextlib.contextmanager
def naming(path: Path, partial: Path | None = None) -> Iterator[None]:
    """Add the file's name to operating system errors that lack it or have its temporary name."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename in (None, str(partial)):
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def _create(path: Path, partial: Path, mode: int) -> int:
    """Create and lock a partial file."""
    for _ in range(ATTEMPTS):
        try:
            handle = os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL | NO_FOLLOW, mode)
        except FileExistsError:
            if not _discard(partial):
                break
            continue
        _lock(handle, wait=True)
        if _is(handle, partial):
            return handle
        os.close(handle)  # taken for an abandoned one before it was locked
    raise OutputError(f"{path} is being written by another process")


def _discard(partial: Path) -> bool:
    """Remove a partial file unless it is being written; return whether it is removed."""
    if OPEN_FILES_STAY:
        try:
            partial.unlink(missing_ok=True)
        except PermissionError:
            return False
        return True
    try:
        handle = os.open(partial, os.O_RDONLY | NO_FOLLOW | NO_WAIT)
    except FileNotFoundError:
        return True
    except PermissionError:
        return False
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        partial.unlink(missing_ok=True)  # a link
        return True
    try:
        free = _lock(handle)
        if free and _is(handle, partial):
            partial.unlink(missing_ok=True)
        return free
    finally:
        os.close(handle)


def _lock(handle: int, *, wait: bool = False) -> bool:
    """Lock a file; return False if another process holds the lock."""
    try:
        import fcntl  # Windows has none

        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except (ImportError, OSError):  # Windows, and some file systems, have no locks
        pass
    return True


def make_folder(folder: Path) -> None:
    """Create a folder of the program, unless it exists.

    Raises OutputError if a link or a file has the name, as files in the folder are written and
    deleted.
    """
    try:
        folder.mkdir()
    except FileExistsError:
        if folder.is_symlink() or not folder.is_dir():
            what = "a link" if folder.is_symlink() else "not a folder"
            raise OutputError(f"{folder} is {what}; remove it") from None


def _is(handle: int, path: Path) -> bool:
    """Return whether a path still leads to an open file."""
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except OSError:
        return False


def _finish(file: io.FileIO, partial: Path, target: Path, overwrite: bool) -> None:
    """Sync a partial file and give it its final name."""
    if not _is(file.fileno(), partial):
        raise OutputError(f"{target}: its partial file {partial} was removed during writing")
    sync(file.fileno())
    if overwrite:
        with contextlib.suppress(FileNotFoundError):
            _keep_permissions(file.fileno(), target.lstat())
    if OPEN_FILES_STAY:
        file.close()
    if overwrite:
        partial.replace(target)
    else:
        try:
            _rename_exclusively(partial, target)
        except FileExistsError:
            message = f"{target} was created by another program meanwhile and is not replaced"
            raise OutputExistsError(message) from None
    with contextlib.suppress(OSError):  # not every system opens or syncs folders
        folder = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def sync(handle: int) -> None:
    """Sync an open file, if its file system supports that."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS):
            raise


def _keep_permissions(handle: int, old: os.stat_result) -> None:
    """Copy owner, group and permissions to an open file, as far as possible."""
    if not stat.S_ISREG(old.st_mode):
        return
    for owner, group in ((old.st_uid, -1), (-1, old.st_gid)):
        with contextlib.suppress(OSError, AttributeError):
            os.fchown(handle, owner, group)
    with contextlib.suppress(OSError, AttributeError):
        os.fchmod(handle, stat.S_IMODE(old.st_mode) & 0o777)


def _rename_exclusively(partial: Path, target: Path) -> None:
    """Rename a file without replacing an existing one."""
    try:
        os.link(partial, target)
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_FOLLOW))
        partial.replace(target)


def open_ordinary(path: Path, flags: int = os.O_RDONLY) -> BinaryIO:
    """Open a regular file of the program; raise OutputError for a link, device or FIFO."""
    if path.is_symlink():
        raise OutputError(f"{path} is a link")
    handle = os.open(path, flags | NO_FOLLOW | NO_WAIT, 0o666)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OutputError(f"{path} is not a regular file")
    return os.fdopen(handle, "rb" if flags == os.O_RDONLY else "r+b")


def packed(arrays: Mapping[str, Any]) -> memoryview:
    """Return the contents of an .npz file of arrays.

    The file is built in memory. If the disk is full, NumPy before version 2 leaves the archive open
    and reports the error again when the program ends.
    """
    import numpy as np  # 100 ms, which other users of this module do without

    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getbuffer()


def clear_partials(folders: Iterable[Path]) -> None:
    """Remove the partial files in folders that no process is writing."""
    for folder in folders:
        for partial in folder.glob(".*.partial*"):
            with contextlib.suppress(OSError):
                _discard(partial)
