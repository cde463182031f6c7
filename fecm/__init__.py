"""fecm: low-velocity impact on laminated composite plates, from the decks of NASA CR-168057.

>>> import fecm
>>> result = fecm.run_one("decks/appendix.inp")  # doctest: +SKIP
>>> result.force.shape  # doctest: +SKIP
(10,)
"""

from __future__ import annotations

import ast as _ast
from functools import cache as _cache
from importlib import import_module as _import_module
from pathlib import Path as _Path

from fecm import _methods
from fecm._errors import FecmError as FecmError
from fecm._errors import FecmWarning as FecmWarning
from fecm._version import __version__ as __version__

_methods.FUNCTIONS.update(
    {
        "Deck.with_": ("fecm.authoring.changes", "with_values"),
        "Deck.with_program": ("fecm.authoring.changes", "with_program"),
        "Result.plot": ("fecm.plot.pictures", "draw_results"),
        "Result.report": ("fecm.report.report", "write_report"),
    }
)


@_cache
def _homes():
    """Module of each public name, and its name there, as ``__init__.pyi`` imports them."""
    stub = _ast.parse(_Path(__file__).with_suffix(".pyi").read_text("utf-8"))
    imports = [statement for statement in stub.body if isinstance(statement, _ast.ImportFrom)]
    return {
        alias.asname: (statement.module, alias.name)
        for statement in imports
        for alias in statement.names
    }


def __getattr__(name):
    """Import a public name on first access: with all of them ``import fecm`` would take 0.9 s."""
    if name == "__all__":
        return sorted([*_homes(), "__version__"])
    if name.startswith("_") or name not in _homes():
        raise AttributeError(f"module 'fecm' has no attribute {name!r}")
    module, original = _homes()[name]
    if module == "fecm":
        return _import_module(f"fecm.{original}")
    return getattr(_import_module(module), original)


def __dir__():
    return __getattr__("__all__")
