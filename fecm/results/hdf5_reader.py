"""Reader of result files of runs, sweeps and locations: untrusted HDF5.

:func:`read` lists the contents of a file; numbers are read on demand. Links, virtual datasets and
external storage, through which HDF5 would read other files, are refused before any dataset is read.
Any error of the library on a damaged file becomes a :class:`~fecm.results.schema.ResultFileError`.
"""

from __future__ import annotations

import contextlib
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from fecm._errors import OptionsError, ResultFileError
from fecm._text import short_text
from fecm._typing import AnyFile, Array
from fecm.judge.criteria import OWN_CRITERIA, criteria_of
from fecm.results import schema
from fecm.results.exposures import AT_REST, LOAD_FACTOR
from fecm.results.groups import NotStoredError, not_stored
from fecm.results.metrics import INITIAL_PLATE, MOBILITY, REST_W, START_W
from fecm.results.schema import FORMAT_VERSION, Form
from fecm.results.sinks import doubles

ELEMENTS = "mesh/elements"
COORDINATES = "mesh/coordinates"
# Source of each form of file.
RESULT_OF: dict[str, str] = {
    Form.RUN: "a run",
    Form.SWEEP: "a sweep",
    Form.LOCATION: "a location",
}
# Kinds of links that are refused, by HDF5's number.
LINKS = {
    h5py.h5l.TYPE_SOFT: "a soft link to another object",
    h5py.h5l.TYPE_EXTERNAL: "an external link to another file",
}
# References between datasets and the scales of their axes (HDF5's dimension scales, version 1.4).
OF_SCALES = {"DIMENSION_LIST", "REFERENCE_LIST"}
FIRST = 4096  # number of bytes that identify a deck
DECK = re.compile(rb"\A[^\0]*^ *FECM\b", re.IGNORECASE | re.MULTILINE)
MOST_ATTRIBUTES = 1000  # of a group; a result has fewer than 100
DEPTH = 10  # of nested groups; a result has at most 3
PACKED = 2000  # upper bound of the compression of HDF5's filters; deflate reaches 1032


class FileContents(Mapping[str, Array]):
    """Contents of a result file: its datasets by path, read on demand."""

    def __init__(
        self, path: Path, attributes: dict[str, Any], in_memory: io.BytesIO | None = None
    ) -> None:
        self.path = path
        self._source = in_memory or path
        # A value of an unsupported type is replaced by the type's name.
        self.attributes = attributes
        # All by path: attributes of groups; shapes, and types in native byte order, of datasets.
        self.groups: dict[str, dict[str, Any]] = {}
        self.shapes: dict[str, tuple[int, ...]] = {}
        self.dtypes: dict[str, np.dtype[Any]] = {}  # objects for texts
        self.texts: dict[str, str] = {}  # single texts
        self.lists: dict[str, list[str]] = {}  # datasets of texts; sweeps only
        self._read: dict[str, Array] = {}
        self._held: h5py.File | None = None

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keep the file open for many reads; otherwise each read opens it."""
        with _troubles(self.path):
            self._held = h5py.File(self._source)
        try:
            with self._held:
                yield
        finally:
            self._held = None

    @contextlib.contextmanager
    def _file(self) -> Iterator[h5py.File]:
        """Yield the open file; its errors become errors of this module."""
        held = self._held and contextlib.nullcontext(self._held)
        with _troubles(self.path), held or h5py.File(self._source) as file:
            yield file

    @property
    def form(self) -> str:
        """A value of :class:`~fecm.results.schema.Form`."""
        return str(self.attributes["format"])

    def __getitem__(self, key: str) -> Array:
        if key not in self.shapes:
            raise NotStoredError(f"{self.path}: {not_stored(key, self.shapes)}")
        if key in self.lists:
            return np.array(self.lists[key])
        if key not in self._read:
            with self._file() as file:
                values = doubles(np.asarray(file[key][()]))
            if key == ELEMENTS and values.size:  # plotting indexes nodes unchecked
                count = self.shapes.get(COORDINATES, (0,))[0]
                if not 0 <= values.min() <= values.max() <= count:
                    raise ResultFileError(f"{self.path}: {key} names nodes outside 1 to {count}")
            self._read[key] = values
        return self._read[key]

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Read rows `start` to `stop` of a dataset; a single number is one row.

        Raises ResultFileError if the file can't be read there.
        """
        if path in self.lists:
            return np.array(self.lists[path][start:stop], dtype=object)
        with self._file() as file:
            if self.shapes[path]:
                return doubles(np.asarray(file[path][start:stop]))
            return np.asarray(file[path][()]).reshape(1)[start:stop]

    def attributes_of(self, path: str) -> dict[str, Any]:
        """Read the attributes of a dataset or group."""
        if path in self.groups:
            return dict(self.groups[path])
        with self._file() as file:
            return _attributes(file[path])

    def __contains__(self, key: object) -> bool:
        return key in self.shapes  # Mapping's own method would read the dataset

    def __iter__(self) -> Iterator[str]:
        return iter(self.shapes)

    def __len__(self) -> int:
        return len(self.shapes)


@contextlib.contextmanager
def _troubles(path: Path) -> Iterator[None]:
    """Turn any error on a damaged file into a :class:`ResultFileError`."""
    try:
        yield
    except (ResultFileError, MemoryError):
        raise
    except Exception as error:  # HDF5 may raise anything on a damaged file
        message = " ".join(str(error).split())
        raise ResultFileError(f"{path}: not a readable HDF5 file ({message})") from None


def read(source: str | Path | AnyFile, *forms: str) -> FileContents:
    """List the contents of a result file of one of these formats; by default the format of a run.

    A file that is already open is read into memory. Raises ResultFileError if it is not an HDF5
    file, or not a result of these formats. Raises OSError if it can't be opened.
    """
    if isinstance(source, str | Path):
        path, in_memory = Path(source), None
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise ResultFileError(f"{path}: not a regular file")
        with path.open("rb") as opened:  # raises the error of a missing or forbidden file
            begin = opened.read(FIRST)
    else:
        path, in_memory = _open_file(source)
        begin = in_memory.getvalue()[:FIRST]
    if DECK.search(begin):
        raise ResultFileError(f"{path} is a deck, not a result; `fecm run {path}` makes one")
    with _troubles(path), h5py.File(in_memory or path) as file:
        attributes = _attributes(file)
        form = attributes.get("format")
        version = attributes.get("format_version")
        expected = forms or (Form.RUN,)
        if form not in expected:
            what = "not a result of fecm"
            if form in RESULT_OF:
                asked = " or ".join(RESULT_OF[expected_form] for expected_form in expected)
                what = f"the result of {RESULT_OF[form]}, not of {asked}"
            raise ResultFileError(f"{path}: this HDF5 file is {what}")
        if version != FORMAT_VERSION:
            raise ResultFileError(f"{path}: format version {version} is not {FORMAT_VERSION}")
        _check_links(path, file)
        contents = FileContents(path, attributes, in_memory)
        names: list[str | bytes] = []
        file.visit(names.append)
        size = len(in_memory.getbuffer()) if in_memory else path.stat().st_size
        for name in names:
            if isinstance(name, bytes):
                raise ResultFileError(f"{path}: the name {_text(name)!r} is not UTF-8")
            _list(contents, size, name, h5py.h5o.open(file.id, name.encode()))
    return contents


def _open_file(file: AnyFile) -> tuple[Path, io.BytesIO]:
    """Return name and bytes of an open file; OptionsError if it is not a file, or open as text."""
    if not hasattr(file, "read"):
        raise OptionsError(f"a result file is a path or an open file, not {file!r}")
    name = getattr(file, "name", None)
    path = Path(name if isinstance(name, str) else "<file>")
    data = b"" if isinstance(file, io.TextIOBase) else file.read()
    if not data or isinstance(data, str):
        what = "is open as text" if isinstance(file, io.TextIOBase) else "has no bytes to read"
        raise OptionsError(f'{path} {what}; open it again with the mode "rb"')
    return path, io.BytesIO(data)


def _check_links(path: Path, file: h5py.File) -> None:
    """Refuse all but hard links, and groups that are nested deeper than in any result."""

    def unsupported(name: str | bytes, info: Any) -> tuple[str, int] | None:
        text = _text(name)
        is_hard = info.type == h5py.h5l.TYPE_HARD
        return None if is_hard and text.count("/") < DEPTH else (text, info.type)

    if link := file.id.links.visit(unsupported, info=True):
        name, kind = link
        if kind == h5py.h5l.TYPE_HARD:
            raise ResultFileError(f"{path}: {short_text(name)} is nested in {DEPTH} groups or more")
        what = LINKS.get(kind, "a link of unsupported kind")
        raise ResultFileError(f"{path}: {name} is {what}; links are not followed")


def _list(contents: FileContents, file_size: int, name: str, item: Any) -> None:
    """Add a group or dataset of a file to its contents.

    `item` is HDF5's own handle: opening all items as objects of h5py takes twice as long.
    """
    path = contents.path
    if isinstance(item, h5py.h5g.GroupID):
        contents.groups[name] = _attributes(h5py.Group(item))
    if not isinstance(item, h5py.h5d.DatasetID):
        return  # a named type
    created = item.get_create_plist()  # the shape of numbers elsewhere is not read
    if created.get_layout() == h5py.h5d.VIRTUAL:
        what = "is a virtual dataset, whose numbers are in other datasets or files"
        raise ResultFileError(f"{path}: {name} {what}; they are not read")
    if created.get_external_count():
        what = "has external storage: its numbers are in another file, which is not read"
        raise ResultFileError(f"{path}: {name} {what}")
    dtype, shape = item.dtype, item.shape
    is_text = h5py.check_string_dtype(dtype) is not None
    if "/" not in name and h5py.h5ds.is_scale(item):
        return  # a scale numbers an axis
    is_packed = created.get_layout() == h5py.h5d.CHUNKED and not is_text
    room = file_size * (PACKED if is_packed else 1)
    # A damaged shape could have more rows than any disk holds. A text takes a byte or more.
    if math.prod(map(int, shape or ())) * (1 if is_text else dtype.itemsize) > room:
        message = f"{path}: {name} has the shape {shape}, which is more than the file holds"
        raise ResultFileError(message)
    if is_text and shape == ():
        contents.texts[name] = str(_plain(h5py.Dataset(item)[()]))
    elif is_text and contents.form == Form.SWEEP and shape is not None and len(shape) == 1:
        contents.lists[name] = [str(_plain(value)) for value in h5py.Dataset(item)[()].tolist()]
        contents.shapes[name], contents.dtypes[name] = shape, np.dtype(object)
    elif dtype.kind in "biuf" and shape is not None and not dtype.shape:
        contents.shapes[name] = tuple(map(int, shape))
        contents.dtypes[name] = dtype.newbyteorder("=")
    else:
        references = h5py.check_ref_dtype(dtype) is not None
        what = "references; they are not followed" if references else "neither numbers nor a text"
        raise ResultFileError(f"{path}: {name} holds {what}")


def _attributes(item: h5py.HLObject) -> dict[str, Any]:
    """Return attributes as Python values, without those that tie an axis to its scale."""
    values: dict[str, Any] = {}
    if len(item.attrs) > MOST_ATTRIBUTES:
        raise ValueError(f"{item.name} has more than {MOST_ATTRIBUTES} attributes")
    for name in item.attrs:
        if name in OF_SCALES:
            continue
        try:
            values[_text(name)] = _plain(item.attrs[name])
        except (TypeError, OSError, ValueError):  # a type without NumPy counterpart
            values[_text(name)] = "<unreadable>"
    return values


def _plain(value: Any) -> Any:
    """Convert to numbers, texts and lists of them; any other type to its name."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, str | bytes):
        return _text(value)
    return value if isinstance(value, bool | int | float) else f"<{type(value).__name__}>"


def _text(value: str | bytes) -> str:
    """Return a text with undecodable bytes replaced, so that it can be printed."""
    raw = value.encode("utf-8", "surrogateescape") if isinstance(value, str) else value
    return raw.decode("utf-8", "replace")


class Misfit(NamedTuple):
    """Dataset whose shape or type differs from the schema."""

    path: str
    message: str


# Kinds of numbers and texts, as NumPy's letters, by the first letter or the name of a type.
KINDS = {"f": "f", "i": "iu", schema.NUMBERS: "fiu", schema.TEXTS: "O", schema.ANY: "fiubO"}


def first_misfit(
    contents: FileContents, paths: Iterable[str] | None = None, **sizes: int
) -> Misfit | None:
    """Return the first dataset whose shape or type differs from the schema, or None.

    By default all datasets are checked. `sizes` has the lengths of axes that are known beforehand.
    """
    form, failure = Form(contents.form), contents.groups.get("failure", {})
    known_sizes: dict[str | int, tuple[int, str]] = {
        name: (size, "every result") for name, size in (schema.FIXED | sizes).items()
    }
    known_sizes["criteria"] = (len(criteria_of(failure)), "this result")
    for path in contents.shapes if paths is None else paths:
        shape = contents.shapes[path]
        dataset = schema.dataset_of(path, len(shape), form)
        if dataset is None:
            continue
        kinds = KINDS.get(dataset.dtype) or KINDS[dataset.dtype[0]]
        if contents.dtypes[path].kind not in kinds:
            return Misfit(path, f"{path} has the wrong type: expected {dataset.dtype}")
        if len(shape) != len(dataset.shape):
            expected = ", ".join(map(str, dataset.shape))
            return Misfit(path, f"{path} has the shape {shape}, not ({expected})")
        for name, size in zip(dataset.shape, shape, strict=True):
            origin = (name, "every result") if isinstance(name, int) else (size, path)
            group = schema.EVERY_STEP[0] if dataset.group in schema.EVERY_STEP else dataset.group
            key = f"{group} {name}" if name == "rows" else name
            needed, source = known_sizes.setdefault(key, origin)
            if size != needed:
                message = f"{path} has the shape {shape}, but {name} is {needed} in {source}"
                return Misfit(path, message)
    return None


# Attributes that are numbers, and lists of texts, by group.  A result without the
# attributes of history and energy lacks only its summary.
NUMBERS = {
    "energy": ("initial", INITIAL_PLATE),
    "history": ("permanent_indentation", "unsettled_steps", MOBILITY, START_W, REST_W),
    "threshold": ("force", "time", "margin"),
    "patch": ("x", "y", "radius"),
}
TEXTS = {"failure": ("modes", OWN_CRITERIA)}
COMPLETE = ("threshold",)  # groups that have all of these attributes


def attribute_error(groups: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a message about the first attribute that is missing or of a wrong type, or ""."""
    criteria = criteria_of(groups.get("failure", {}))
    numbers = NUMBERS | {f"failure/{name}": (AT_REST, LOAD_FACTOR) for name in criteria}
    for table, fits, what in ((numbers, _is_number, "a number"), (TEXTS, _is_texts, "texts")):
        for group, names in table.items():
            stored = groups.get(group, {})
            missing = [name for name in names if name not in stored]
            if group in groups and group in COMPLETE and missing:
                return f"{group} has no attribute {missing[0]}"
            for name in names:
                if name in stored and not fits(stored[name]):
                    return (
                        f"the attribute {name} of {group} is {short_text(stored[name])}, not {what}"
                    )
    return ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)
