"""The page of the API documents every type that public signatures name."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from typing import Any

import fecm
from tests.printed import text_of

DIRECTIVE = re.compile(r"^\.\. auto(?!module)\w+:: (\S+)\n((?:   :.*\n)*)", re.MULTILINE)
# Parts of the program that objects hold: nobody who uses them makes or reads one.
HELD = {
    "fecm.authoring.plate.DropWeight",
    "fecm.deck.card.CardSource",
    "fecm.mechanics.element_matrices.IntegrationRules",
    "fecm.mechanics.laminate.LaminateSection",
    "fecm.results.groups.GroupSource",
    "fecm.results.stored.Stored",
    "fecm.studies.indentation_test.curves.CurveSolution",
    "fecm.studies.waves.harmonic.Medium",
}


def documented(page: str) -> dict[str, tuple[Any, str]]:
    """Names on a page: what they are, and the options of their directives."""
    by_name = {}
    for path, options in DIRECTIVE.findall(page):
        module, _, name = path.rpartition(".")
        by_name[path] = getattr(import_module(module), name), options
    return by_name


def shown(actual: Any, options: str) -> Iterator[Any]:
    """What the page shows with a signature: a function, or a class and its members."""
    if inspect.isfunction(actual):
        yield actual
        return
    # A class of fields has their annotations itself.
    yield actual.__init__ if inspect.isfunction(actual.__init__) else actual
    if "__call__" in options:
        yield actual.__call__
    if not (asked := re.search(":members:(.*)", options)):
        return
    members = (
        inspect.getmembers(actual) if ":inherited-members:" in options else vars(actual).items()
    )
    names = [name.strip() for name in asked[1].split(",") if name.strip()]
    for name, value in members:
        function = inspect.unwrap(getattr(value, "fget", None) or getattr(value, "__func__", value))
        if inspect.isfunction(function) and (name in names if names else not name.startswith("_")):
            yield function


@cache
def named_in(module: str) -> dict[str, type]:
    """Own classes that annotations of a module may name, also those imported for types alone."""
    actual = dict(vars(import_module(module)))
    for node in ast.walk(ast.parse(inspect.getsource(import_module(module)))):
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("fecm"):
            home = import_module(str(node.module))
            actual |= {name.asname or name.name: getattr(home, name.name) for name in node.names}
    return {
        name: one
        for name, one in actual.items()
        if inspect.isclass(one) and one.__module__.startswith("fecm")
    }


def lacking(page: str) -> dict[str, str]:
    """Types without an entry on a page, and a signature that names each."""
    entries = documented(page)
    classes = {one for one, _ in entries.values() if inspect.isclass(one)}
    by_name = {}
    for one, options in entries.values():
        for function in shown(one, options):
            for annotation in getattr(function, "__annotations__", {}).values():
                for name in re.findall(r"\b[A-Z]\w+", str(annotation)):
                    kind = named_in(function.__module__)
                    if name in kind and kind[name] not in classes:
                        full = f"{kind[name].__module__}.{name}"
                        by_name[full] = function.__qualname__
    return {name: where for name, where in by_name.items() if name not in HELD}


PAGE = text_of("api*.md")


def test_every_type_of_a_public_signature_is_on_the_page_of_the_api() -> None:
    assert len(documented(PAGE)) > 100
    assert lacking(PAGE) == {}


def test_a_type_without_an_entry_is_found() -> None:
    page = PAGE.replace(".. autoclass:: fecm.results.comparison.Comparison\n", "")
    assert lacking(page) == {"fecm.results.comparison.Comparison": "Result.compare"}


def test_every_public_name_is_on_the_page_of_the_api() -> None:
    entries = {id(one) for one, _ in documented(PAGE).values()}
    names = {name for name in fecm.__all__ if id(getattr(fecm, name)) not in entries}
    assert names == {"__version__", "errors", "examples"}
