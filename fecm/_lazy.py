"""Lazy names of a package: each is imported when it is first used.

The stub ``__init__.pyi`` of the package says where each name comes from, for type checkers and for
Python alike. A package therefore states its names once, and importing it imports nothing else.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def names_of_stub(
    package: str, file: str
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package from its name and ``__file__``."""

    @cache
    def origins() -> dict[str, tuple[str, str]]:
        """Return the module of each name, and its name there."""
        # The loader reads the stub of a package in a zip file too.
        loader: Any = sys.modules[package].__loader__
        stub = ast.parse(loader.get_data(str(Path(file).with_suffix(".pyi"))))
        return {
            alias.asname or alias.name: (statement.module or package, alias.name)
            for statement in stub.body
            if isinstance(statement, ast.ImportFrom)
            for alias in statement.names
        }

    def get(name: str) -> object:
        if name == "__all__":
            return list_names()
        if name.startswith("_") or name not in origins():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, original = origins()[name]
        if module == package:
            return import_module(f"{package}.{original}")
        return getattr(import_module(module), original)

    def list_names() -> list[str]:
        return sorted(origins())

    return get, list_names
