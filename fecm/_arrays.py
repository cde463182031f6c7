"""Arrays that a reader can't change, and tuples of arrays that can be compared."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fecm._typing import Array

_Kind = TypeVar("_Kind")


def read_only(values: ArrayLike) -> Array:
    """Return a view of an array that can't be written to.

    Examples
    --------
    >>> read_only([1.0, 2.0]).flags.writeable
    False
    """
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


def compared_by_identity(kind: type[_Kind]) -> type[_Kind]:
    """Make instances of a NamedTuple of arrays equal only to themselves, as other results are.

    Tuples compare their items, and the comparison of two arrays has no truth value.
    """
    for method in ("__eq__", "__ne__", "__hash__"):
        setattr(kind, method, getattr(object, method))
    return kind
