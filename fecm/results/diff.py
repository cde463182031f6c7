"""Comparison of two results, dataset by dataset.

Two numbers are equal if |a - b| <= atol + rtol*scale. The scale is the largest finite absolute
value of the complete dataset in both results, so that a zero crossing of a history is judged by the
size of the history. Datasets that may hold nothing but rounding errors have another scale
(`SCALE_NAMES`). Integers (steps, node and equation numbers) and texts must be equal. NaN equals
NaN, and an infinity equals the same infinity; either differs from anything else at any tolerance.
Numbers of tapes are by default equal if they differ by at most one unit of the last printed digit.

Datasets are compared in blocks of rows, so that memory does not grow with the results.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from enum import StrEnum
from fnmatch import fnmatchcase
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Array
from fecm.deck.mesh_cards import DOF_NAMES
from fecm.listing.tapes import CONTACT, SHEARS, TAPES, TapeText, W, last_digit, read_tapes
from fecm.results.difference import TEXT, DatasetDifference, Difference, Listed, Position
from fecm.results.groups import suggestion
from fecm.results.hdf5_reader import FileContents, read
from fecm.results.result import Result
from fecm.results.schema import DATASETS, SCALES, Form, dataset_of
from fecm.results.stored import row_blocks

# A resultant or strain that is zero in bending, and its bending counterpart.
RESULTANTS = ("N_x", "N_y", "N_xy")
COUPLES = ("M_x", "M_y", "M_xy")
STRAINS = ("eps_xx", "eps_yy", "gamma_xy")
CURVATURES = ("kappa_x", "kappa_y", "kappa_xy")


class DifferenceScale(StrEnum):
    """Scale of differences, other than the largest value of the dataset."""

    ENERGY = "the energy put in"
    COUPLING = "sqrt(max A * max D)"
    INTERLAMINAR = "the largest interlaminar stress"
    RESULTANT = "the largest N or M * sqrt(A/D)"
    STRAIN = "the largest strain or curvature * sqrt(D/A)"
    CONTACT = "the largest indentation in contact"


SCALE_NAMES = {
    "energy/balance_error": DifferenceScale.ENERGY,
    "laminate/B": DifferenceScale.COUPLING,
    "plies/residual": DifferenceScale.INTERLAMINAR,
    **{f"stresses/{name}": DifferenceScale.RESULTANT for name in RESULTANTS},
    **{f"stresses/{name}": DifferenceScale.STRAIN for name in STRAINS},
    "history/indentation": DifferenceScale.CONTACT,
    "tape9/indentation": DifferenceScale.CONTACT,
}

Source = FileContents | TapeText


class Pair(NamedTuple):
    """Dataset that both sources have."""

    path: str
    sources: tuple[Source, Source]  # A and B

    @property
    def shapes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes in A and B."""
        a, b = self.sources
        return a.shapes[self.path], b.shapes[self.path]

    @property
    def types(self) -> tuple[str, str]:
        """Names of the types in A and B."""
        a, b = (str(source.dtypes[self.path]) for source in self.sources)
        return a.replace("object", TEXT), b.replace("object", TEXT)

    def blocks(self) -> Iterator[tuple[int, Array, Array]]:
        """Yield the number of the first row, rows of A and rows of B."""
        a, b = self.sources
        for start, stop in row_blocks(self.shapes[0]):
            yield start, a.rows(self.path, start, stop), b.rows(self.path, start, stop)


def compare_dataset(pair: Pair, tolerances: tuple[float, float] | None) -> DatasetDifference:
    """Compare a dataset of both sources, by rtol and atol, or to the last digit of tapes."""
    difference = DatasetDifference(pair.path, pair.shapes, pair.types)
    if not difference.comparable:
        return difference
    if difference.holds_texts:
        _compare_texts(difference, pair)
        return difference
    infinite = _measure(difference, pair)
    difference.scale = difference.maximum
    if scale := _own_scale(pair):
        difference.scale, difference.scale_name = scale, SCALE_NAMES[_scaled_name(pair.path)]
    if tolerances is None:
        difference.tolerance = float(last_digit(np.array(difference.maximum)))
    elif any(source.dtypes[pair.path].kind == "f" for source in pair.sources):
        rtol, atol = tolerances
        difference.tolerance = atol + rtol * difference.scale
    if infinite or difference.largest_difference > (
        0.0 if tolerances is None else difference.tolerance
    ):
        _count(difference, pair, to_last_digit=tolerances is None)
    return difference


def _compare_texts(difference: DatasetDifference, pair: Pair) -> None:
    """Compare a dataset of texts."""
    texts_a, texts_b = (
        source.rows(pair.path, 0, difference.shapes[0][0]) for source in pair.sources
    )
    rows = np.flatnonzero(texts_a != texts_b)
    difference.differing = len(rows)
    if len(rows):
        difference.largest_difference, difference.at = math.inf, _place(pair, (int(rows[0]),))
        difference.values = str(texts_a[rows[0]]), str(texts_b[rows[0]])


def _scaled_name(path: str) -> str:
    """Return the name of a dataset in `SCALE_NAMES`, without the number of its laminate."""
    group, name = path.partition("/")[0], path.rpartition("/")[2]
    return f"{group}/{name}" if group == "laminate" else path


def _own_scale(pair: Pair) -> float:
    """Return the scale of a dataset in `SCALE_NAMES`, or 0."""
    match SCALE_NAMES.get(_scaled_name(pair.path)):
        case None:
            return 0.0
        case DifferenceScale.ENERGY:
            return _initial_energy(pair) + _largest(pair, "energy/external_work")
        case DifferenceScale.COUPLING:  # with the thickness h, A h and D / h have the order of B
            return float((_largest_laminate(pair, "A") * _largest_laminate(pair, "D")) ** 0.5)
        case DifferenceScale.INTERLAMINAR:
            return max(_largest(pair, "plies/tau_xz"), _largest(pair, "plies/tau_yz"))
        case DifferenceScale.RESULTANT:
            couples = _largest_of(pair, COUPLES) * _inverse_thickness(pair)
            return max(_largest_of(pair, RESULTANTS), couples)
        case DifferenceScale.STRAIN:
            ratio = _inverse_thickness(pair)
            bending = _largest_of(pair, CURVATURES) / ratio if ratio else 0.0
            return max(_largest_of(pair, STRAINS), bending)
        case DifferenceScale.CONTACT:
            group = pair.path.partition("/")[0]
            # A tape has few digits of every number, also in free flight.
            has_steps = all(f"{group}/step" in source.shapes for source in pair.sources)
            return _largest(pair, pair.path, above=0.0) if has_steps else 0.0


def _largest(pair: Pair, path: str, above: float = -np.inf) -> float:
    """Return the largest finite absolute value above a limit of a dataset in both sources."""
    size = 0.0
    for source in pair.sources:
        if path in source.shapes and source.dtypes[path].kind != "O":
            for rows in row_blocks(source.shapes[path]):
                block = source.rows(path, *rows)
                counted = np.abs(block[np.isfinite(block) & (block > above)])
                size = max(size, float(counted.max(initial=0.0)))
    return size


def _largest_of(pair: Pair, names: Sequence[str]) -> float:
    """Return the largest value of the given resultants and strains of STRE."""
    return max(_largest(pair, f"stresses/{name}") for name in names)


def _inverse_thickness(pair: Pair) -> float:
    """Return sqrt(A/D), which is of the order of 1/h; 0 if it is not known."""
    bending = _largest_laminate(pair, "D") or np.inf
    return float((_largest_laminate(pair, "A") / bending) ** 0.5)


def _largest_laminate(pair: Pair, name: str) -> float:
    """Return the largest value of a stiffness matrix of the laminates."""
    paths = {path for source in pair.sources for path in source.shapes}
    numbered = [p for p in paths if p.startswith("laminate/") and p.endswith(f"/{name}")]
    return max((_largest(pair, path) for path in numbered), default=0.0)


def _initial_energy(pair: Pair) -> float:
    """Return the largest initial energy of both files; 0 if it is not known."""
    files = (source for source in pair.sources if isinstance(source, FileContents))
    initial = (file.groups.get("energy", {}).get("initial") for file in files)
    energies = (abs(e) for e in initial if isinstance(e, int | float) and np.isfinite(e))
    return max(energies, default=0.0)


def _measure(difference: DatasetDifference, pair: Pair) -> bool:
    """Find the maximum and the largest difference with its place.

    Returns whether the difference is infinite.
    """
    place: tuple[int, ...] = ()
    infinite = False
    for start, a, b in pair.blocks():
        for values in (a, b):
            size = np.abs(values, where=np.isfinite(values), out=np.zeros(values.shape))
            difference.maximum = max(difference.maximum, float(size.max(initial=0.0)))
        apart, strange = _differences(a, b)
        if infinite or not apart.size:
            continue  # no other difference is larger
        here = int((strange if strange.any() else apart).argmax())
        index = np.unravel_index(here, apart.shape)
        if strange.any() or apart[index] > difference.largest_difference:
            infinite = bool(strange.any())
            difference.largest_difference = np.inf if infinite else float(apart[index])
            difference.values = float(a[index]), float(b[index])
            place = (start + int(index[0]), *map(int, index[1:]))
    if place:
        difference.at = _place(pair, place)
    return infinite


def _count(difference: DatasetDifference, pair: Pair, *, to_last_digit: bool) -> None:
    """Count the differences beyond the tolerance, and find the first row that has one."""
    instants = difference.shapes[0] and (_clock(pair) or pair.path.startswith("tape"))
    for start, a, b in pair.blocks():
        apart, strange = _differences(a, b)
        tolerance: Any = difference.tolerance
        if to_last_digit:
            pairs = zip(pair.sources, (a, b), strict=True)
            printed = [
                last_digit(values) for source, values in pairs if isinstance(source, TapeText)
            ]
            tolerance = (1.0 + 1e-9) * np.max(printed, axis=0)
        wrong = strange | (apart > tolerance)
        difference.differing += int(np.count_nonzero(wrong))
        if difference.first is None and wrong.any() and instants:
            row = int(wrong.reshape(len(wrong), -1).any(axis=1).argmax())
            difference.first = _place(pair, (start + row,))


def _differences(a: Array, b: Array) -> tuple[Array, Array]:
    """Return |a - b| where both are finite, else 0; and a mask of other unequal numbers."""
    if a.dtype.kind in "biu" and b.dtype.kind in "biu":
        apart = np.abs(a.astype(float) - b.astype(float))
        unequal = a != b
        # Different large integers may be equal as floats.
        return np.where(unequal, np.maximum(apart, 1.0), 0.0), np.zeros(a.shape, bool)
    a, b = a.astype(float), b.astype(float)
    finite = np.isfinite(a) & np.isfinite(b)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.where(finite, np.abs(a - b), 0.0)
    equal = (a == b) | (np.isnan(a) & np.isnan(b))
    return apart, ~finite & ~equal


def _clock(pair: Pair) -> tuple[Source, str] | None:
    """Return the source and the group whose step and time belong to the rows of a dataset."""
    group = pair.path.rpartition("/")[0]
    for source in pair.sources:
        rows = source.shapes[pair.path][:1]
        clock = [n for n in (f"{group}/step", f"{group}/time") if source.shapes.get(n) == rows]
        if rows and [source.dtypes[name].kind for name in clock] == ["i", "f"]:
            return source, group
    return None


def _place(pair: Pair, index: tuple[int, ...]) -> Position:
    """Return the position of a number, or of a row if only its index is given."""
    path, source = pair.path, pair.sources[0]
    if isinstance(source, TapeText) and source.lines and path == W:
        names = ("line", "column")
        return Position(index, axes={name: i + 1 for name, i in zip(names, index, strict=False)})
    if source.form == Form.SWEEP and path.startswith(("cases/", "summary/", "history/")):
        case, *steps = index  # cases count from 0, as in commands
        return Position(index, steps[0] + 1 if steps else None, axes={"case": case})
    step: int | None = None
    time: float | None = None
    clock = _clock(pair)
    if clock is not None:
        timed, group = clock
        row = index[0], index[0] + 1
        step = int(timed.rows(f"{group}/step", *row)[0])
        time = float(timed.rows(f"{group}/time", *row)[0])
    return Position(index, step, time, _axes(pair, index, has_clock=clock is not None))


def _axes(pair: Pair, index: tuple[int, ...], *, has_clock: bool) -> dict[str, int | str]:
    """Return the indices of a place, from 1, by the names of the axes other than time."""
    path, sizes = pair.path, pair.shapes[0]
    axes: dict[str, int | str] = {}
    if not has_clock and path.startswith("tape"):
        axes["row"] = index[0] + 1
    dataset = dataset_of(path, len(sizes))
    shape = () if dataset is None else dataset.shape
    if len(shape) != len(sizes):
        return axes
    for axis, (size, i) in enumerate(zip(shape, index, strict=False)):
        if size == "ndf" and i < len(DOF_NAMES):
            axes["unknown"] = DOF_NAMES[i]
        elif isinstance(size, int):
            axes["column" if axis else "row"] = i + 1
        elif size in SCALES:
            axes[SCALES[size][0]] = i + 1
    return axes


SOURCE_NAMES: dict[str, str] = {
    Form.RUN: "the result of a run",
    Form.SWEEP: "the result of a sweep",
    Form.LOCATION: "the result of a location",
    TAPES: "a folder of tapes",
}
# Datasets that tapes hold.
ON_TAPE = {
    W,
    *(f"tape8/{name}" for name in (*CURVATURES, *SHEARS["tape8"])),
    *(f"tape9/{name}" for name in CONTACT),
}


class IncomparableError(FecmError, ValueError):
    """The sources can't be compared, or lack the requested datasets."""


@runtime_checkable
class Savable(Protocol):
    """Result of a run, a sweep or a location."""

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the result as a file."""


Compared = str | Path | Savable
Tolerance = float | Sequence[float]  # relative, or relative and absolute


def diff(
    a: Compared,
    b: Compared,
    rtol: float | None = None,
    atol: float | None = None,
    *,
    only: str | Sequence[str] = (),
    exclude: str | Sequence[str] = (),
    tol: Mapping[str, Tolerance] | None = None,
) -> Difference:
    """Compare two results dataset by dataset.

    Two numbers are equal if they differ by at most `rtol` times the dataset's scale plus `atol`.
    Without both tolerances they must be identical, on tapes up to one unit of the last digit.  The
    scale is the largest value of the whole dataset.  Integers and texts must be equal, NaN equals
    NaN.

    Parameters
    ----------
    a, b : str, Path, Result, SweepResult or Location
        Result files, folders of tapes, or results; both of runs, of sweeps, or of locations.
    rtol, atol : float, optional
        Relative tolerance, and absolute tolerance in the dataset's unit.
    only, exclude : str or sequence of str
        Datasets to compare instead of all, and datasets to leave out: names (``"tape9/force"``),
        groups (``"tape9"``) or patterns (``"*/force"``).
    tol : mapping of str to float or sequence of float, optional
        Own tolerances by such names, ``rtol`` or ``(rtol, atol)``.  If several names match a
        dataset, the last one holds.

    Returns
    -------
    Difference
        Its ``same`` is the verdict, and ``str()`` what ``fecm diff`` prints.

    Raises
    ------
    IncomparableError
        If an argument is not a result, the results are of different kinds, a name matches no
        dataset, nothing is left to compare, or a tolerance is not a finite number from 0.
    ResultFileError
        If a file is not a result.
    OSError
        If it can't be opened.

    Examples
    --------
    >>> import fecm
    >>> deck = fecm.read_one(fecm.examples.path("impact-patch"))
    >>> result, other = fecm.run_one(deck), fecm.run_one(deck.with_(velocity=116.0))
    >>> comparison = fecm.diff(result, other, rtol=1e-6, only=["laminate", "history/force"])
    >>> comparison.same, comparison.different
    (False, ['history/force'])
    >>> force = comparison.datasets[0]
    >>> print(f"{force.largest_difference:.3f} lb of {force.maximum:.2f} lb")
    0.768 lb of 85.76 lb
    """
    tolerance_of = {name: _own_tolerance(name, values) for name, values in (tol or {}).items()}
    for name, value in {"rtol": rtol, "atol": atol}.items():
        _own_tolerance(name, value or 0.0)
    with contextlib.ExitStack() as stack:
        source_a, source_b = (_source(compared, stack) for compared in (a, b))
        forms = source_a.form, source_b.form
        if source_a.form != source_b.form and {Form.SWEEP, Form.LOCATION} & {*forms}:
            names = " and B ".join(SOURCE_NAMES[form] for form in forms)
            raise IncomparableError(f"A is {names}: they can't be compared")
        source_a, source_b = _fitted(source_a, source_b), _fitted(source_b, source_a)
        shared = ON_TAPE if TAPES in forms else source_a.shapes.keys() | source_b.shapes
        in_a, in_b = source_a.shapes.keys() & shared, source_b.shapes.keys() & shared
        both = in_a | in_b
        asked = _chosen(both, _names(only)) if only else both
        excluded = asked & _chosen(both, _names(exclude), DATASETS)
        chosen = asked - excluded
        if excluded and not chosen:
            raise IncomparableError("every dataset is excluded")
        last_digit = TAPES in forms and rtol is None and atol is None
        general = None if last_digit else (rtol or 0.0, atol or 0.0)
        tolerances = dict.fromkeys(chosen, general)
        for pattern, (relative, *absolute) in tolerance_of.items():
            for path in _chosen(both, [pattern], DATASETS) & chosen:
                tolerances[path] = (relative, absolute[0] if absolute else atol or 0.0)
        for source in (source_a, source_b):
            if isinstance(source, FileContents):
                stack.enter_context(source.held())
        pairs = [Pair(path, (source_a, source_b)) for path in sorted(in_a & in_b & chosen)]
        return Difference(
            a=_name(a),
            b=_name(b),
            rtol=rtol or 0.0,
            atol=atol or 0.0,
            tol=tolerance_of,
            last_digit=last_digit,
            datasets=[compare_dataset(pair, tolerances[pair.path]) for pair in pairs],
            only_in_a=sorted((in_a - in_b) & chosen),
            only_in_b=sorted((in_b - in_a) & chosen),
            listed=_listed(source_a, source_b),
            excluded=sorted(excluded),
        )


def assert_same(
    result: Compared,
    trusted: Compared,
    rtol: float | None = 1e-6,
    atol: float | None = None,
    *,
    only: str | Sequence[str] = (),
    exclude: str | Sequence[str] = (),
    tol: Mapping[str, Tolerance] | None = None,
) -> None:
    """Require in a test that a result equals a trusted file.

    Parameters
    ----------
    result : str, Path, Result or SweepResult
        What is tested, A in the message.
    trusted : str, Path, Result or SweepResult
        What it is compared with, B in the message.
    rtol, atol : float, optional
        Tolerances of :func:`diff`; machines and versions of NumPy round differently.  None for both
        requires identical numbers, on tapes up to one unit of the last digit.
    only, exclude : str or sequence of str
        Datasets to compare instead of all, and datasets to leave out; see :func:`diff`.
    tol : mapping of str to float or sequence of float, optional
        Own tolerances of some datasets; see :func:`diff`.

    Raises
    ------
    AssertionError
        If they differ; the message has the lines of ``fecm diff`` about the differences.
    IncomparableError
        If they can't be compared; see :func:`diff`.
    ResultFileError
        If a file is not a result.
    OSError
        If it can't be opened.

    Examples
    --------
    >>> import fecm
    >>> deck = fecm.examples.path("impact-patch")
    >>> fecm.run_one(deck).save("trusted.h5")
    >>> fecm.assert_same(fecm.run_one(deck, solver="csr"), "trusted.h5")
    """
    __tracebackhide__ = True  # pytest shows the line of the test
    difference = diff(result, trusted, rtol, atol, only=only, exclude=exclude, tol=tol)
    if not difference.same:
        head = f"the result, A: {difference.a}, is not the trusted one, B: {difference.b}"
        raise AssertionError("\n".join([head, *difference.lines(same=False)]))


def _source(compared: Compared, stack: contextlib.ExitStack) -> Source:
    """Return the contents of a file, a folder of tapes, or a result, which may be in memory."""
    if isinstance(compared, Result) and isinstance(compared._arrays, FileContents):
        return compared._arrays
    if not isinstance(compared, str | Path | Savable):
        raise IncomparableError(f"a {type(compared).__name__} is not a result")
    if not isinstance(compared, str | Path):
        import tempfile  # 3 ms at start

        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="fecm-"))
        path = Path(folder) / "result.h5"
        compared.save(path)
        return read(path, *Form)
    path = Path(compared)
    return read_tapes(path) if path.is_dir() else read(path, *Form)


def _name(compared: Compared) -> str:
    """Return the path of a result, or ``<memory>``."""
    if isinstance(compared, Result) and isinstance(compared._arrays, FileContents):
        return str(compared._arrays.path)
    return str(compared) if isinstance(compared, str | Path) else "<memory>"


def _names(names: str | Sequence[str]) -> Sequence[str]:
    """Return names of datasets as a tuple."""
    return (names,) if isinstance(names, str) else names


def _own_tolerance(name: str, tolerance: Tolerance) -> tuple[float, ...]:
    """Return the relative and the absolute tolerance of a dataset."""
    values = tuple(tolerance) if isinstance(tolerance, Sequence) else (tolerance,)
    valid = all(isinstance(v, Real) and 0.0 <= v < math.inf for v in values)
    if not valid or len(values) not in (1, 2):
        shown = ", ".join(map(str, values))
        raise IncomparableError(f"{name} is {shown}: a tolerance is a finite number from 0")
    return tuple(map(float, values))


def _fitted(source: Source, other: Source) -> Source:
    """Divide tape3 into rows of as many nodes as the other source has, if the other is a file."""
    shape = other.shapes.get(W, ())
    if isinstance(source, TapeText) and other.form != TAPES and len(shape) == 2:
        return source.fitted(shape[1])
    return source


def _chosen(
    names: set[str], patterns: Sequence[str], known_names: Collection[str] = ()
) -> set[str]:
    """Return the names that match patterns, or lie in groups that match.

    Each pattern must match one of the names, or a known name.
    """
    chosen: set[str] = set()
    for asked in patterns:
        plain = asked.strip("/")
        every = names.union(known_names)
        matches = {n for n in every if fnmatchcase(n, plain) or n.startswith(f"{plain}/")}
        if not matches:
            raise IncomparableError(f"there is no `{asked}` to compare{suggestion(plain, names)}")
        chosen |= matches & names
    return chosen


def _listed(a: Source, b: Source) -> list[Listed]:
    """Return attributes, and first lines of texts, that differ between two files."""
    if isinstance(a, TapeText) or isinstance(b, TapeText):
        return []
    attributes_a, attributes_b = _attributes(a), _attributes(b)
    listed = [
        Listed(name, attributes_a.get(name), attributes_b.get(name))
        for name in dict.fromkeys((*attributes_a, *attributes_b))
        if repr(attributes_a.get(name)) != repr(attributes_b.get(name))
    ]
    for name in dict.fromkeys((*a.texts, *b.texts)):
        text_a, text_b = a.texts.get(name), b.texts.get(name)
        if text_a is None or text_b is None:
            listed.append(Listed(name, text_a and "a text", text_b and "a text"))
        elif text_a != text_b:
            pairs = itertools.zip_longest(text_a.split("\n"), text_b.split("\n"))
            line, (x, y) = next((n, (x, y)) for n, (x, y) in enumerate(pairs, 1) if x != y)
            listed.append(Listed(name, x, y, line))
    return listed


def _attributes(source: FileContents) -> dict[str, Any]:
    """Return all attributes by name: ``title``, ``energy:initial``, ``tape3/w:unit``."""
    named = source.groups | {path: source.attributes_of(path) for path in source}
    return source.attributes | {
        f"{path}:{name}": value
        for path, attributes in named.items()
        for name, value in attributes.items()
    }
