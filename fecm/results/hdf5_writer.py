"""Writer of result files: HDF5, renamed to their final name when complete."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fecm._errors import ResultFileError
from fecm._files import beside
from fecm._typing import Array
from fecm.deck.output_cards import Compact
from fecm.deck.units import declared_units, unit_of, units_of_columns
from fecm.judge.criteria import criteria_of
from fecm.results import schema
from fecm.results.groups import ResultWriteError
from fecm.results.schema import Dataset, Form
from fecm.results.sinks import Operation
from fecm.results.stored import Stored

TEXT = h5py.string_dtype()
TEXT_TYPE = h5py.h5t.py_create(TEXT, logical=True)
SCALAR = h5py.h5s.create(h5py.h5s.SCALAR)
# Of datasets without time stamps.
PROPERTIES = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
PROPERTIES.set_obj_track_times(False)
CHUNK = 65_536  # bytes of the chunks of datasets that grow or are compressed
CACHE = 8 * CHUNK  # bytes of the chunks in memory of each dataset; HDF5 2 keeps 8 MB by default
LEVEL = 1  # of gzip: higher levels save 2 % and take a tenth longer


class FileSink:
    """Writer of a result of a form into an open HDF5 file.

    A `compact` file is compressed, and its fields have single precision.
    """

    compact: bool = False

    def __init__(self, file: h5py.File, guarded: _Guarded, form: Form = Form.RUN) -> None:
        self._file = file
        self._guarded = guarded
        self._form = form
        self._described = schema.FILES[form].groups
        self._units: dict[str, str] = {}
        # Datasets, single texts, and attributes of groups that are stored so far, by path.
        self.arrays: dict[str, Any] = {}
        self.texts: dict[str, str] = {}
        self.groups: dict[str, dict[str, Any]] = {}
        # What was created, with its shape before `trim`: h5py takes 10 us to tell.
        self._made: dict[str, tuple[Dataset, tuple[int, ...]]] = {}
        self._groups: dict[str, h5py.Group] = {"": file}
        self._scales: dict[str, h5py.Dataset] = {}
        self.axis_names = dict(schema.AXIS_NAMES)
        # Operations so far, rows without their values, if a checkpoint needs them.
        self.operations: list[dict[str, Any]] | None = None

    def _note(self, operation: Operation, **about: Any) -> None:
        if self.operations is not None:
            self.operations.append({"do": operation, **about})

    def _group(self, name: str) -> h5py.Group:
        if name not in self._groups:
            new = name not in self._file
            group = self._groups[name] = self._file.require_group(name)
            if new and name in self._described:
                _set_text(group, self._described[name], "description")
        return self._groups[name]

    def attributes(self, group: str, values: Mapping[str, Any]) -> None:
        """Set attributes of a group; a list of strings becomes an array of strings."""
        self._note(Operation.ATTRIBUTES, group=group, values=dict(values))
        self.groups.setdefault(group, {}).update(values)
        target = self._group(group)
        if not group:
            self._units = declared_units(values)
        for name, value in values.items():
            if isinstance(value, list | tuple) and all(isinstance(item, str) for item in value):
                target.attrs.create(name, value, (len(value),), TEXT)
            else:
                target.attrs[name] = value

    def create(self, dataset: Dataset, shape: tuple[int, ...], *, grows: bool = False) -> None:
        """Create a dataset of its full shape; see :meth:`known`.

        It is contiguous, unless it grows, so that the file has no room for rows that never come, or
        is compressed.
        """
        self.known(dataset.path, len(shape))
        self._create(dataset, shape, grows=grows)

    def known(self, path: str, rank: int) -> Dataset:
        """Return the dataset of the schema; ValueError if the schema has none of this path."""
        return schema.required_dataset(path, rank, self._form)

    def _create(self, dataset: Dataset, shape: tuple[int, ...], *, grows: bool = False) -> None:
        self._note(Operation.CREATE, path=dataset.path, shape=shape, grows=grows)
        if self.compact and dataset.is_field:
            dataset = replace(dataset, dtype="f4")
        kind = _type_of(dataset.dtype)
        compressed = self.compact and kind.get_size() * math.prod(shape) > CHUNK
        has_chunks = grows or compressed
        # Low-level interface: create_dataset takes twice as long.
        place = h5py.h5s.create_simple(shape, shape if has_chunks else None)
        name = dataset.name.encode()
        group = self._group(dataset.group).id
        properties = PROPERTIES
        if has_chunks:
            rows = max(1, CHUNK // (kind.get_size() * max(1, math.prod(shape[1:]))))
            properties = PROPERTIES.copy()
            properties.set_chunk((min(rows, shape[0]), *shape[1:]))
        if compressed:
            properties.set_shuffle()
            properties.set_deflate(LEVEL)
        created = h5py.Dataset(h5py.h5d.create(group, name, kind, place, properties))
        _set_text(created, dataset.description, "description", "long_name")
        if dataset.dimension:
            _set_text(created, dataset.dimension, "dimension")
            if unit := unit_of(dataset.dimension, self._units):
                names = self.axis_names.get(dataset.shape[-1], ())[: shape[-1]]
                if columns := units_of_columns(unit, names):
                    _set_text(created, unit, "unit")
                    created.attrs.create(schema.COLUMN_UNITS, columns, (len(columns),), TEXT)
                else:
                    _set_text(created, unit, "unit", "units")  # xarray and pint read units
        self.arrays[dataset.path] = created
        self._made[dataset.path] = dataset, shape

    def label_axes(self) -> None:
        """Attach dimension scales (of the HDF5 specification) to the axes of datasets, for xarray.

        The scale of rows is the group's time. Scales of nodes, elements, points and dofs belong to
        the file, because a netCDF reader looks for dimensions in a group and its parents. It needs
        all axes of a dataset labelled, or none.
        """
        kept = [
            (d, shape, self.arrays[p]) for p, (d, shape) in self._made.items() if p in self.arrays
        ]
        clocks = {
            d.group: array for d, _, array in kept if d.name == "time" and d.shape[0] == "rows"
        }
        for clock in clocks.values():
            clock.make_scale("time")
        for dataset, shape, array in kept:
            clock = clocks.get(dataset.group)
            if array is clock or not {*dataset.shape} <= {"rows", *schema.SCALES}:
                continue
            for axis, (size, length) in enumerate(zip(dataset.shape, shape, strict=True)):
                rows = size == "rows"
                scale = clocks[dataset.group] if rows else self._scale(size, length)
                h5py.h5ds.attach_scale(array.id, scale.id, axis)

    def _scale(self, size: Any, length: int) -> h5py.Dataset:
        """Return the scale of an axis, created on first use."""
        name, description = schema.SCALES[size]
        if name not in self._scales:
            if texts := self.axis_names.get(size):
                scale = self._file.create_dataset(name, data=texts[:length], dtype=TEXT)
            else:
                numbers = np.arange(length, dtype="i4") + (size not in schema.FROM_0)
                scale = self._file.create_dataset(name, data=numbers)
            scale.make_scale(name)
            _set_text(scale, description, "description", "long_name")
            self._scales[name] = scale
        return self._scales[name]

    def write(self, path: str, start: int, rows: Array) -> None:
        """Store rows of a dataset.  Raises OSError if this or an earlier write failed."""
        self._note(Operation.WRITE, path=path, start=start, rows=len(rows))
        self.check()
        dataset = self.arrays[path]
        # Low-level interface: slices of h5py take four times as long for a short block.
        values = np.ascontiguousarray(rows, self._made[path][0].dtype)
        place = dataset.id.get_space()
        place.select_hyperslab((start, *[0] * (values.ndim - 1)), values.shape)
        dataset.id.write(h5py.h5s.create_simple(values.shape), place, values)

    def store(self, path: str, values: Array, dimension: str = "") -> None:
        """Store a whole dataset of the schema, numbers or texts; see :meth:`dataset`.

        `dimension` replaces the dimension of the schema.
        """
        dataset = self.known(path, values.ndim)
        if dataset.dtype == schema.TEXTS or values.dtype.kind in "US":
            stored = self.arrays[path] = self._text(path, values.tolist(), dataset.description)
            self._made[path] = dataset, stored.shape
            return
        if dataset.dtype in (schema.ANY, schema.NUMBERS):
            dataset = replace(dataset, dtype="i8" if values.dtype.kind in "iu" else "f8")
        self._create(replace(dataset, dimension=dimension or dataset.dimension), values.shape)
        self.write(path, 0, values)

    def keep(self, path: str, values: Array) -> None:
        """Store a dataset of a result of another version, which the schema lacks."""
        self._create(Dataset(path, values.shape, "", dtype=values.dtype.name), values.shape)
        self.write(path, 0, values)

    def check(self) -> None:
        """Raise the first error of writing, an OSError."""
        if self._guarded.error is not None:
            raise self._guarded.error

    def trim(self, path: str, rows: int) -> None:
        """Truncate a dataset to its first rows; delete it, or an empty group, without rows."""
        old = self.arrays[path]
        if rows and old.chunks is not None:
            old.resize(rows, axis=0)
            return
        del self.arrays[path]
        group = old.parent
        attributes = dict(old.attrs)
        kept = old[:rows]
        del self._file[path]
        if rows:
            self.arrays[path] = dataset = self._file.create_dataset(path, data=kept)
            dataset.attrs.update(attributes)
        elif not len(group):
            empty = path.rpartition("/")[0]
            del self._file[empty]
            self._groups.pop(empty, None)

    def deck(self, text: str) -> None:
        """Store the text of the deck."""
        self._note(Operation.TEXT, value=text)
        self.texts["deck"] = text
        self._text("deck", text, schema.FILES[self._form].deck)

    def _text(self, path: str, value: str | list[str], description: str) -> h5py.Dataset:
        """Create a dataset of a text or of texts."""
        group, _, name = path.rpartition("/")
        dataset = self._group(group).create_dataset(name, data=value, dtype=TEXT)
        dataset.attrs["description"] = description
        return dataset


@cache
def _type_of(dtype: str) -> h5py.h5t.TypeID:
    """Return the HDF5 type for NumPy's name of a type."""
    return h5py.h5t.py_create(np.dtype(dtype), logical=True)


def _set_text(item: h5py.HLObject, text: str, *names: str) -> None:
    """Set new attributes to a text, as ``item.attrs`` does at three times the cost."""
    value = np.array(text, dtype=TEXT)
    for name in names:
        h5py.h5a.create(item.id, name.encode(), TEXT_TYPE, SCALAR).write(value)


@contextlib.contextmanager
def result_writing(
    path: Path, form: Form = Form.RUN, *, overwrite: bool = True
) -> Iterator[FileSink]:
    """Open a result of a form for writing; it gets its final name only on success.

    Raises ResultWriteError if the file can't be written; an existing file then stays unchanged.
    """
    with beside(path, overwrite=overwrite) as partial, result_at(partial, path, form) as sink:
        yield sink


@contextlib.contextmanager
def result_at(partial: Path, path: Path, form: Form) -> Iterator[FileSink]:
    """Open a result at its partial file, from :func:`beside`; see :func:`result_writing`."""
    with _hdf5_at(partial, path) as (file, guarded):
        sink = FileSink(file, guarded, form)
        yield sink
        sink.label_axes()


def save_result(stored: Stored, path: Path, *, overwrite: bool) -> None:
    """Write a result as a file; see :meth:`fecm.Result.save`."""
    with result_writing(path, overwrite=overwrite) as sink:
        with contextlib.suppress(ResultFileError):  # a file of others may have no deck
            sink.compact = stored.deck.has(Compact)
        sink.axis_names["criteria"] = criteria_of(stored.attributes_of("failure"))
        sink.attributes("", stored.attributes)
        sink.deck(stored.deck_text)
        for name in stored:
            values = stored[name]
            dataset = schema.dataset_of(name, values.ndim)
            (sink.keep if dataset is None else sink.store)(name, values)
        for group in filter(None, stored._groups):
            sink.attributes(group, stored.attributes_of(group))


@contextlib.contextmanager
def new_hdf5(path: Path, *, overwrite: bool = True) -> Iterator[tuple[h5py.File, _Guarded]]:
    """Open an HDF5 file for writing; see :func:`result_writing`."""
    with beside(path, overwrite=overwrite) as partial, _hdf5_at(partial, path) as opened:
        yield opened


@contextlib.contextmanager
def _hdf5_at(partial: Path, path: Path) -> Iterator[tuple[h5py.File, _Guarded]]:
    """Open an HDF5 file for writing at its partial file; `path` is its final name."""
    with _Guarded(partial, "w+") as guarded:
        with h5py.File(guarded, "w", rdcc_nbytes=CACHE) as file:
            try:
                yield file, guarded
            except OSError as error:
                if error is not guarded.error:
                    raise
        if (failed := guarded.error) is not None:
            raise ResultWriteError(f"{path} can't be written: {failed.strerror or failed}")


class _Guarded(io.FileIO):
    """File that stores the first write error instead of raising it.

    After a failed write HDF5 can neither continue nor close the file, and crashes at exit. It
    therefore sees no error; the sink checks for one.
    """

    error: OSError | None = None

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        done = 0
        while self.error is None and done < len(view):
            try:
                done += super().write(view[done:]) or 0
            except OSError as error:
                self.error = error
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        if self.error is None:
            try:
                super().truncate(size)
            except OSError as error:
                self.error = error
        return size or 0
