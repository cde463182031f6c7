"""Types of arrays and of open files."""

from __future__ import annotations

from typing import IO, Annotated, Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

# With the shape of a single number; in JSON others may be NaN and infinite, as texts.
FiniteFloat = Annotated[float, ()]

AnyFile = IO[str] | IO[bytes]  # open as text or as bytes
