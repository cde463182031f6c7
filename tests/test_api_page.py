"""The page of the API documents every type that public signatures name."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from typing import Any

import fecm
from tests.decks import ROOT

# Objects that results carry with them: users get them, and neither build nor read them.
INSIDE = {
    "fecm.authoring.fixtures.Fixture.__init__",
    "fecm.deck.card.Source.__init__",
    "fecm.results.plies.PlyGroup.__init__",
    "fecm.studies.indentation_test.constants.Fit.__init__",
    "fecm.studies.waves.medium.Medium.__init__",
}
DIRECTIVE = re.compile(r"^\.\. auto(\w+):: (\S+)\n((?:   :.*\n)*)", re.MULTILINE)


def _documented() -> dict[str, tuple[object, str]]:
    """Paths on the page: what they are, and the options of their directive."""
    found = {}
    for kind, path, options in DIRECTIVE.findall((ROOT / "docs" / "api.md").read_text("utf-8")):
        if kind != "module":
            module, _, name = path.rpartition(".")
            found[path] = getattr(import_module(module), name), options
    return found


def _functions(found: object, options: str) -> Iterator[Callable[..., Any]]:
    """Functions whose signatures the page shows."""
    if inspect.isfunction(found):
        yield found
    if not inspect.isclass(found):
        return
    if inspect.isfunction(found.__init__):
        yield found.__init__
    if ":members:" not in options:
        return
    members = inspect.getmembers(found) if ":inherited-members:" in options else vars(found).items()
    for name, value in members:
        function = value.fget if isinstance(value, property) else inspect.unwrap(value)
        if inspect.isfunction(function) and not name.startswith("_"):
            yield function


@cache
def _classes_named_in(module: str) -> dict[str, object]:
    """Own classes that annotations of a module name, also those imported for types alone."""
    tree = ast.parse(inspect.getsource(import_module(module)))
    found = dict(vars(import_module(module)))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("fecm"):
            home = import_module(str(node.module))
            found |= {name.asname or name.name: getattr(home, name.name) for name in node.names}
    return {
        name: one
        for name, one in found.items()
        if inspect.isclass(one) and one.__module__.startswith("fecm")
    }


def test_every_type_of_a_public_signature_is_on_the_page_of_the_api() -> None:
    page = _documented()
    shown = {one for one, _ in page.values() if inspect.isclass(one)}
    lacking = {
        f"{named[name].__module__}.{name}": function.__qualname__
        for found, options in page.values()
        for function in _functions(found, options)
        if f"{function.__module__}.{function.__qualname__}" not in INSIDE
        for annotation in getattr(function, "__annotations__", {}).values()
        for named in [_classes_named_in(function.__module__)]
        for name in re.findall(r"\b[A-Z]\w+", str(annotation))
        if name in named and named[name] not in shown
    }
    assert len(page) > 50
    assert lacking == {}


def test_every_public_name_is_on_the_page_of_the_api() -> None:
    own = {path.removeprefix("fecm.") for path in _documented()}
    assert set(fecm.__all__) - own == {"__version__", "examples"}
