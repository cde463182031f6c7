"""fecm: low-velocity impact on laminated composite plates, from the decks of NASA CR-168057.

>>> import fecm
>>> result = fecm.run("decks/appendix.inp")
>>> result.force.shape
(10,)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fecm._errors import FecmError
from fecm._version import __version__

if TYPE_CHECKING:
    from fecm.api import run
    from fecm.deck.findings import DeckError
    from fecm.deck.reader import read_deck
    from fecm.mechanics.plate_motion import DivergenceError
    from fecm.results.result import Result, load
    from fecm.sweeps.api import sweep
    from fecm.sweeps.result import SweepResult
    from fecm.sweeps.result import load as load_sweep

__all__ = [
    "DeckError",
    "DivergenceError",
    "FecmError",
    "Result",
    "SweepResult",
    "__version__",
    "load",
    "load_sweep",
    "read_deck",
    "run",
    "sweep",
]

_HOMES = {
    "run": "fecm.api",
    "DeckError": "fecm.deck.findings",
    "read_deck": "fecm.deck.reader",
    "DivergenceError": "fecm.mechanics.plate_motion",
    "Result": "fecm.results.result",
    "load": "fecm.results.result",
    "sweep": "fecm.sweeps.api",
    "SweepResult": "fecm.sweeps.result",
    "load_sweep": "fecm.sweeps.result:load",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first access, so that `import fecm` is fast."""
    if name not in _HOMES:
        raise AttributeError(f"module 'fecm' has no attribute {name!r}")
    module, _, own = _HOMES[name].partition(":")
    return getattr(import_module(module), own or name)
