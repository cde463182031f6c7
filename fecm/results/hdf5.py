"""Result files: HDF5, written beside their final name and renamed when complete."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fecm.deck.records import UNKNOWNS
from fecm.files import beside
from fecm.results.schema import (
    FORMAT,
    FORMAT_VERSION,
    GROUP_DESCRIPTIONS,
    SCALES,
    SWEEP,
    Dataset,
    NotStoredError,
    ResultFileError,
    ResultWriteError,
    declared_units,
)
from fecm.units import unit_of

Array = NDArray[Any]
TIME = "time"
ELEMENTS, COORDINATES = "mesh/elements", "mesh/coordinates"


class FileSink:
    """Writes a result into an open HDF5 file."""

    def __init__(self, file: h5py.File, guarded: _Guarded) -> None:
        self._file = file
        self._guarded = guarded
        self._units: dict[str, str] = {}
        self._datasets: dict[str, h5py.Dataset] = {}
        self._made: list[Dataset] = []

    def _group(self, name: str) -> h5py.Group:
        if not name:
            return self._file
        new = name not in self._file
        group = self._file.require_group(name)
        if new and name in GROUP_DESCRIPTIONS:
            group.attrs["description"] = GROUP_DESCRIPTIONS[name]
        return group

    def attributes(self, group: str, values: Mapping[str, Any]) -> None:
        """Set attributes of a group; a list of strings becomes an array of strings."""
        target = self._group(group)
        if not group:
            self._units = declared_units(values)
        for name, value in values.items():
            if isinstance(value, list | tuple):
                target.attrs.create(name, value, (len(value),), h5py.string_dtype())
            else:
                target.attrs[name] = value

    def create(self, dataset: Dataset, shape: tuple[int, ...]) -> None:
        """Make a contiguous dataset of its full shape."""
        made = self._group(dataset.group).create_dataset(dataset.name, shape, dataset.dtype)
        made.attrs["description"] = dataset.description
        made.attrs["long_name"] = dataset.description
        if dataset.dimension:
            made.attrs["dimension"] = dataset.dimension
            if unit := unit_of(dataset.dimension, self._units):
                made.attrs["unit"] = unit
        self._datasets[dataset.path] = made
        self._made.append(dataset)

    def label_axes(self) -> None:
        """Attach scales to every axis of what is stored in rows, by which xarray knows them.

        HDF5's Dimension Scales Specification.  Rows have their group's times; nodes, elements,
        points and unknowns have the file's own scales, as a netCDF reader finds dimensions in a
        group and in those above it, and takes a dataset with all of its axes labelled or none.
        """
        made_of = [(d, self._datasets[d.path]) for d in self._made if d.path in self._datasets]
        clocks = {d.group: made for d, made in made_of if d.name == TIME}
        for clock in clocks.values():
            clock.make_scale(TIME)
        for dataset, made in made_of:
            clock = clocks.get(dataset.group)
            if clock is None or made == clock:
                continue
            for axis, size in enumerate(dataset.shape):
                rows = size == "rows"
                scale = clock if rows else self._scale(str(size), made.shape[axis])
                made.dims[axis].attach_scale(scale)

    def _scale(self, size: str, length: int) -> h5py.Dataset:
        """The scale of an axis, made when it is first asked for."""
        name, description = SCALES.get(size, (size, ""))
        if name not in self._file:
            if size == "ndf":
                made = self._file.create_dataset(name, data=UNKNOWNS, dtype=h5py.string_dtype())
            else:
                made = self._file.create_dataset(name, data=np.arange(1, length + 1, dtype="i4"))
            made.make_scale(name)
            made.attrs["description"] = made.attrs["long_name"] = description
        return self._file[name]

    def write(self, path: str, start: int, rows: Array) -> None:
        """Store rows of a dataset.

        Raises
        ------
        OSError
            If this or an earlier write failed.
        """
        self.check()
        self._datasets[path][start : start + len(rows)] = rows

    def check(self) -> None:
        """Raise the first error of writing.

        Raises
        ------
        OSError
        """
        if self._guarded.error is not None:
            raise self._guarded.error

    def stored(self, path: str, start: int, stop: int) -> Array:
        """Rows of a dataset as they stand in the file."""
        return np.asarray(self._datasets[path][start:stop])

    def trim(self, path: str, rows: int) -> None:
        """Cut a dataset down to its first rows; without any it goes, and an empty group with it."""
        old = self._datasets.pop(path)
        group, name = old.parent, path.rpartition("/")[2]
        attributes = dict(old.attrs)
        kept = old[:rows]
        del group[name]
        if rows:
            made = group.create_dataset(name, data=kept)
            made.attrs.update(attributes)
            self._datasets[path] = made
        elif not len(group):
            del self._file[path.rpartition("/")[0]]

    def text(self, path: str, value: str, description: str) -> None:
        """Store a text."""
        made = self._file.create_dataset(path, data=value, dtype=h5py.string_dtype())
        made.attrs["description"] = description

    def texts(self, path: str, values: Sequence[str], description: str) -> None:
        """Store texts, one a row."""
        made = self._file.create_dataset(path, data=list(values), dtype=h5py.string_dtype())
        made.attrs["description"] = description


@contextlib.contextmanager
def writing(path: Path) -> Iterator[FileSink]:
    """Open a result for writing; it gets its final name only when all went well.

    Raises
    ------
    ResultWriteError
        If the file can't be written; what stood under the final name is then untouched.
    """
    with beside(path) as partial, partial.open("w+b", buffering=0) as raw:
        guarded = _Guarded(raw)
        with h5py.File(guarded, "w") as file:
            sink = FileSink(file, guarded)
            try:
                yield sink
            except OSError as error:
                if error is guarded.error:
                    raise _unwritten(path, error) from None
                raise
            sink.label_axes()
        if guarded.error is not None:
            raise _unwritten(path, guarded.error)


def _unwritten(path: Path, error: OSError) -> ResultWriteError:
    return ResultWriteError(f"{path} can't be written: {error.strerror or error}")


class _Guarded:
    """A file that remembers the first error of writing instead of raising it.

    HDF5 can neither go on nor let go of a file once a write has failed in it: it complains at every
    turn, and falls over at the end of the program.  So it is left in the belief that all is well,
    until the sink asks.
    """

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw
        self.error: OSError | None = None

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def read(self, size: int = -1) -> bytes:
        return self._raw.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        return self._raw.readinto(buffer) or 0

    def write(self, data: memoryview) -> int:
        view = memoryview(data).cast("B")
        done = 0
        while self.error is None and done < len(view):
            try:
                done += self._raw.write(view[done:]) or 0
            except OSError as error:
                self.error = error
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        if self.error is None:
            try:
                self._raw.truncate(size)
            except OSError as error:
                self.error = error
        return size or 0

    def flush(self) -> None:
        """Nothing is buffered."""


class FileArrays(Mapping[str, Array]):
    """The datasets of a result file, each read when it is asked for.

    Attributes
    ----------
    path : Path
        The file.
    shapes : dict
        Shape of every dataset of numbers.
    dtypes : dict
        Its type, in this machine's byte order.
    """

    def __init__(
        self,
        path: Path,
        shapes: dict[str, tuple[int, ...]],
        dtypes: dict[str, np.dtype[Any]] | None = None,
    ) -> None:
        self.path = path
        self.shapes = shapes
        self.dtypes = dtypes or {}
        self._read: dict[str, Array] = {}

    def __getitem__(self, key: str) -> Array:
        if key not in self.shapes:
            raise NotStoredError(f"{self.path}: there is no {key} in this result")
        if key not in self._read:
            with _troubles(self.path), h5py.File(self.path) as file:
                values = np.asarray(file[key][()])
            if key == ELEMENTS:
                self._check_nodes(values)
            self._read[key] = values
        return self._read[key]

    def _check_nodes(self, elements: Array) -> None:
        """Refuse elements with nodes that the mesh has not; whoever draws them takes their word."""
        count = self.shapes.get(COORDINATES, (0,))[0]
        if elements.size and not 0 <= elements.min() <= elements.max() <= count:
            raise ResultFileError(f"{self.path}: {ELEMENTS} names nodes outside 1 to {count}")

    def __contains__(self, key: object) -> bool:
        return key in self.shapes  # Mapping's own would read the dataset

    def __iter__(self) -> Iterator[str]:
        return iter(self.shapes)

    def __len__(self) -> int:
        return len(self.shapes)


class OpenArrays:
    """The datasets of a result file that stays open: rows are read as they are asked for.

    Used in a ``with`` statement; memory holds no more than the rows of one call.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> OpenArrays:
        with _troubles(self.path):
            self._file = h5py.File(self.path)
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(Exception):  # nothing was written that closing could lose
            self._file.close()

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Rows `start` to `stop` of a dataset; a single number is one row.

        Raises
        ------
        ResultFileError
            If the file can't be read there.
        """
        with _troubles(self.path):
            dataset = self._file[path]
            if not dataset.shape:
                return np.asarray(dataset[()]).reshape(1)[start:stop]
            return np.asarray(dataset[start:stop])

    def attributes(self, path: str) -> dict[str, Any]:
        """Attributes of a dataset or group."""
        with _troubles(self.path):
            return _attributes(self._file[path])


@contextlib.contextmanager
def _troubles(path: Path) -> Iterator[None]:
    """Turn whatever a damaged file raises into one :class:`ResultFileError`."""
    try:
        yield
    except (ResultFileError, MemoryError):
        raise
    except Exception as error:  # a damaged file may raise anything inside of HDF5
        told = " ".join(str(error).split())
        raise ResultFileError(f"{path}: this is no readable HDF5 file ({told})") from None


def read(
    path: Path, form: str = FORMAT
) -> tuple[FileArrays, dict[str, Any], dict[str, dict[str, Any]]]:
    """Datasets, texts and attributes of a result file.

    A dataset of texts is given as a list.

    Links are not followed, and attributes of a type that Python has no plain value for are given
    by the name of that type.

    Raises
    ------
    ResultFileError
        If the file is no HDF5 file, or no result of this format.
    OSError
        If it can't be opened.
    """
    path = Path(path)
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise ResultFileError(f"{path}: this is no file but a device or a pipe")
    with path.open("rb"):
        pass  # a missing or forbidden file says so itself
    with _troubles(path), h5py.File(path) as file:
        root = _attributes(file)
        if root.get("format") != form:
            raise ResultFileError(f"{path}: this HDF5 file is {_other(root, form)}")
        if root.get("format_version") != FORMAT_VERSION:
            raise ResultFileError(
                f"{path}: format version {root.get('format_version')} is not "
                f"{FORMAT_VERSION}, which this program reads"
            )
        visitor = _Visitor(path, lists=form == SWEEP)
        file.visititems(visitor)
    arrays = FileArrays(path, visitor.shapes, visitor.dtypes)
    return arrays, visitor.texts, {"": root, **visitor.groups}


def _other(root: Mapping[str, Any], form: str) -> str:
    """What a file is that is not of the form that was asked for."""
    if form == FORMAT and root.get("format") == SWEEP:
        return "the result of a sweep, not of a run"
    if form == SWEEP and root.get("format") == FORMAT:
        return "the result of a run, not of a sweep"
    return "not a result of fecm"


# No filter of HDF5 packs numbers more tightly than this; deflate reaches 1032.
PACKED = 2000


class _Visitor:
    """Notes what stands in a file: shapes, texts, attributes of groups."""

    def __init__(self, path: Path, *, lists: bool = False) -> None:
        self.path = path
        self.lists = lists  # of texts
        self.size = path.stat().st_size
        self.shapes: dict[str, tuple[int, ...]] = {}
        self.dtypes: dict[str, np.dtype[Any]] = {}
        self.texts: dict[str, Any] = {}
        self.groups: dict[str, dict[str, Any]] = {}

    def __call__(self, name: str, item: h5py.HLObject) -> None:
        if isinstance(item, h5py.Group):
            self.groups[name] = _attributes(item)
        elif isinstance(item, h5py.Dataset):  # a named type is nothing to read
            self._dataset(name, item)

    def _dataset(self, name: str, item: h5py.Dataset) -> None:
        if "/" not in name and item.is_scale:
            return  # it numbers an axis
        if h5py.check_string_dtype(item.dtype) and item.shape == ():
            self.texts[name] = str(_plain(item[()]))
        elif self.lists and h5py.check_string_dtype(item.dtype) and len(item.shape or ()) == 1:
            self.texts[name] = [str(_plain(value)) for value in item[()].tolist()]
        elif item.dtype.kind in "biuf" and item.shape is not None and not item.dtype.shape:
            shape = tuple(map(int, item.shape))
            room = self.size * (PACKED if item.chunks else 1)
            # A damaged shape would have a reader go through more rows than any disk holds.
            if math.prod(shape) * item.dtype.itemsize > room:
                raise ResultFileError(
                    f"{self.path}: {name} has the shape {shape}, which is more than the file holds"
                )
            self.shapes[name] = shape
            self.dtypes[name] = item.dtype.newbyteorder("=")
        else:
            raise ResultFileError(f"{self.path}: {name} holds neither numbers nor one text")


def _attributes(item: h5py.HLObject) -> dict[str, Any]:
    """Attributes as Python values."""
    values: dict[str, Any] = {}
    for name in item.attrs:
        try:
            values[_text(name)] = _plain(item.attrs[name])
        except (TypeError, OSError, ValueError):  # a type that NumPy has no counterpart of
            values[_text(name)] = "<unreadable>"
    return values


def _plain(value: Any) -> Any:
    """Numbers, texts and lists of them; anything else by the name of its type."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, str | bytes):
        return _text(value)
    return value if isinstance(value, bool | int | float) else f"<{type(value).__name__}>"


def _text(value: str | bytes) -> str:
    """A text whose undecodable bytes are replaced, so that it can be printed."""
    raw = value.encode("utf-8", "surrogateescape") if isinstance(value, str) else value
    return raw.decode("utf-8", "replace")
