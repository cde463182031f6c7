"""Methods of lower rooms that upper rooms implement.

``Deck.with_`` needs the values of sweeps and ``Result.plot`` needs the pictures, but decks and
results know neither. The package ``fecm``, which knows all rooms, names the function of each such
method. The function is imported when the method is called.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

# Module and function by the name of the method.
FUNCTIONS: dict[str, tuple[str, str]] = {}


def function_of(method: str) -> Callable[..., Any]:
    """Import the function that implements a method, such as ``"Deck.with_"``."""
    module, function = FUNCTIONS[method]
    carried_out: Callable[..., Any] = getattr(import_module(module), function)
    return carried_out
