"""Arrays that a reader can't change."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fecm._typing import Array


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
