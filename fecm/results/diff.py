"""Compares the datasets of two results.

Two numbers are equal if |a - b| <= atol + rtol*scale.  The scale is the largest finite absolute
value of the complete dataset in both results, so that a zero crossing of a history is judged by the
size of the history.  Datasets that may hold nothing but rounding errors have another scale
(`SCALE_NAMES` of :mod:`fecm.results.dataset_diff`).  Integers (steps, node and equation numbers)
and texts must be equal.  NaN equals NaN, and an infinity the same infinity; either differs from
anything else at any tolerance.

Numbers of tapes are by default equal if they differ by at most one unit of the last printed digit.

Datasets are compared in blocks of rows: memory does not grow with the results.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from numbers import Real
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from fecm._errors import FecmError
from fecm.results.dataset_diff import CURVATURES, Pair, Source, compare
from fecm.results.difference import Difference, Listed
from fecm.results.hdf5_reader import Contents, read
from fecm.results.missing import suggestion
from fecm.results.result import Result
from fecm.results.schema import CONTACT, DATASETS, Form
from fecm.results.tapes import SHEARS, TAPES, TapeText, W, read_tapes

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
    """The result of a run, a sweep or a location."""

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write it as a file."""


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

    Two numbers are equal if they differ by at most `rtol` times the dataset's scale plus `atol`;
    without both, exactly, or those of tapes to their last digit.  The scale is the largest value of
    the whole dataset.  Integers and texts must be equal, NaN equals NaN.

    Parameters
    ----------
    a, b : str, Path, Result, SweepResult or Location
        Result files, folders of tapes, or results; both of runs, of sweeps, or of locations.
    rtol, atol : float, optional
        Relative tolerance, and absolute tolerance in the dataset's unit.
    only, exclude : str or sequence of str
        Names of datasets (``"tape9/force"``), groups (``"tape9"``) or patterns (``"*/force"``) that
        alone are compared, or that are left out.
    tol : mapping of str to float or sequence of float, optional
        Tolerances of their own of such names, ``rtol`` or ``(rtol, atol)``; of several that match,
        the last one holds.

    Returns
    -------
    Difference
        Its ``same`` is the verdict, and ``str()`` what ``fecm diff`` prints.

    Raises
    ------
    IncomparableError
        If one is not a result, or only one is that of a sweep, a name matches no dataset, nothing
        is left to compare, or a tolerance is not a finite number from 0.
    ResultFileError
        If a file is not a result.
    OSError
        If it can't be opened.

    Examples
    --------
    >>> import fecm
    >>> deck = fecm.read_one(fecm.examples.path("impact-patch"))
    >>> result, other = fecm.run_one(deck), fecm.run_one(deck.with_(velocity=116.0))
    >>> found = fecm.diff(result, other, rtol=1e-6, only=["laminate", "history/force"])
    >>> found.same, found.different
    (False, ['history/force'])
    >>> force = found.datasets[0]
    >>> print(f"{force.largest_difference:.3f} lb of {force.maximum:.2f} lb")
    0.768 lb of 85.76 lb
    """
    own = {name: _own_tolerance(name, values) for name, values in (tol or {}).items()}
    for name, value in {"rtol": rtol, "atol": atol}.items():
        _own_tolerance(name, value or 0.0)
    with contextlib.ExitStack() as stack:
        left, right = (_source(one, stack) for one in (a, b))
        forms = left.form, right.form
        if left.form != right.form and {Form.SWEEP, Form.LOCATION} & {*forms}:
            names = " and B ".join(SOURCE_NAMES[form] for form in forms)
            raise IncomparableError(f"A is {names}: they can't be compared")
        left, right = _fitted(left, right), _fitted(right, left)
        shared = ON_TAPE if TAPES in forms else left.shapes.keys() | right.shapes
        in_a, in_b = left.shapes.keys() & shared, right.shapes.keys() & shared
        both = in_a | in_b
        asked = _chosen(both, _names(only)) if only else both
        excluded = asked & _chosen(both, _names(exclude), DATASETS)
        chosen = asked - excluded
        if excluded and not chosen:
            raise IncomparableError("every dataset is excluded")
        last_digit = TAPES in forms and rtol is None and atol is None
        general = None if last_digit else (rtol or 0.0, atol or 0.0)
        tolerances = dict.fromkeys(chosen, general)
        for pattern, (relative, *absolute) in own.items():
            for path in _chosen(both, [pattern], DATASETS) & chosen:
                tolerances[path] = (relative, absolute[0] if absolute else atol or 0.0)
        for source in (left, right):
            if isinstance(source, Contents):
                stack.enter_context(source.held())
        pairs = [Pair(path, (left, right)) for path in sorted(in_a & in_b & chosen)]
        return Difference(
            a=_name(a),
            b=_name(b),
            rtol=rtol or 0.0,
            atol=atol or 0.0,
            tol=own,
            last_digit=last_digit,
            datasets=[compare(pair, tolerances[pair.path]) for pair in pairs],
            only_in_a=sorted((in_a - in_b) & chosen),
            only_in_b=sorted((in_b - in_a) & chosen),
            listed=_listed(left, right),
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
    """Require in a test that a result is that of a trusted file.

    Parameters
    ----------
    result : str, Path, Result or SweepResult
        What is tested, A in the message.
    trusted : str, Path, Result or SweepResult
        What it is compared with, B in the message.
    rtol, atol : float, optional
        Tolerances of :func:`diff`; machines and versions of NumPy round differently.  None for both
        requires equal numbers, or those of tapes to the last digit.
    only, exclude : str or sequence of str
        Datasets that alone are compared, or that are left out; see :func:`diff`.
    tol : mapping of str to float or sequence of float, optional
        Tolerances of their own of some datasets; see :func:`diff`.

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
    found = diff(result, trusted, rtol, atol, only=only, exclude=exclude, tol=tol)
    if not found.same:
        head = f"the result, A: {found.a}, is not the trusted one, B: {found.b}"
        raise AssertionError("\n".join([head, *found.lines(same=False)]))


def _source(one: Compared, stack: contextlib.ExitStack) -> Source:
    """Contents of a file, of a folder of tapes, or of a result, which may be in memory."""
    if isinstance(one, Result) and isinstance(one._arrays, Contents):
        return one._arrays
    if not isinstance(one, str | Path | Savable):
        raise IncomparableError(f"a {type(one).__name__} is not a result")
    if not isinstance(one, str | Path):
        import tempfile  # 3 ms at start

        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="fecm-"))
        path = Path(folder) / "result.h5"
        one.save(path)
        return read(path, *Form)
    path = Path(one)
    return read_tapes(path) if path.is_dir() else read(path, *Form)


def _name(one: Compared) -> str:
    """Path of a result; ``<memory>`` if it has none."""
    if isinstance(one, Result) and isinstance(one._arrays, Contents):
        return str(one._arrays.path)
    return str(one) if isinstance(one, str | Path) else "<memory>"


def _names(given: str | Sequence[str]) -> Sequence[str]:
    """Names of datasets, of which there may be one."""
    return (given,) if isinstance(given, str) else given


def _own_tolerance(name: str, given: Tolerance) -> tuple[float, ...]:
    """Relative tolerance, or relative and absolute tolerance."""
    values = tuple(given) if isinstance(given, Sequence) else (given,)
    valid = all(isinstance(v, Real) and 0.0 <= v < math.inf for v in values)
    if not valid or len(values) not in (1, 2):
        shown = ", ".join(map(str, values))
        raise IncomparableError(f"{name} is {shown}: a tolerance is a finite number from 0")
    return tuple(map(float, values))


def _fitted(source: Source, other: Source) -> Source:
    """Divide tape3 into rows of as many nodes as the other source has, if that is a file."""
    shape = other.shapes.get(W, ())
    if isinstance(source, TapeText) and other.form != TAPES and len(shape) == 2:
        return source.fitted(shape[1])
    return source


def _chosen(names: set[str], patterns: Sequence[str], known: Collection[str] = ()) -> set[str]:
    """Names that match patterns or lie in groups that do; each must match one, or a known name."""
    chosen: set[str] = set()
    for asked in patterns:
        plain = asked.strip("/")
        every = names.union(known)
        found = {n for n in every if fnmatchcase(n, plain) or n.startswith(f"{plain}/")}
        if not found:
            raise IncomparableError(f"there is no `{asked}` to compare{suggestion(plain, names)}")
        chosen |= found & names
    return chosen


def _listed(a: Source, b: Source) -> list[Listed]:
    """Attributes, and first lines of texts, that differ between two files; tapes have none."""
    if isinstance(a, TapeText) or isinstance(b, TapeText):
        return []
    left, right = _attributes(a), _attributes(b)
    listed = [
        Listed(name, left.get(name), right.get(name))
        for name in dict.fromkeys((*left, *right))
        if repr(left.get(name)) != repr(right.get(name))
    ]
    for name in dict.fromkeys((*a.texts, *b.texts)):
        one, other = a.texts.get(name), b.texts.get(name)
        if one is None or other is None:
            listed.append(Listed(name, one and "a text", other and "a text"))
        elif one != other:
            pairs = itertools.zip_longest(one.split("\n"), other.split("\n"))
            line, (x, y) = next((n, (x, y)) for n, (x, y) in enumerate(pairs, 1) if x != y)
            listed.append(Listed(name, x, y, line))
    return listed


def _attributes(source: Contents) -> dict[str, Any]:
    """All attributes by name: ``title``, ``energy:initial``, ``tape3/w:unit``."""
    named = source.groups | {path: source.attributes_of(path) for path in source}
    return source.attributes | {
        f"{path}:{name}": value
        for path, attributes in named.items()
        for name, value in attributes.items()
    }
