"""JSON schemas of what commands print, from the types of these outputs.

    python -m tests.schemas docs/schemas

A field of a TypedDict has its description in ``Annotated``, one of a dataclass in the docstring's
section Attributes.  Other metadata are the shape of an array of finite numbers, a pattern of texts,
and the type whose values, or whose fields, are meant.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from fecm._typing import FiniteFloat
from fecm.cli.info import LocationFileJson, RunFileJson, SweepFileJson
from fecm.cli.run import ProblemRunJson
from fecm.deck.findings import FindingJson
from fecm.identification.edges import EdgeFitJson
from fecm.problem.summary import ProblemSummary
from fecm.results.difference import DifferenceJson, PositionJson
from fecm.results.summary import MetricsJson
from fecm.studies.modes import ModesJson
from fecm.sweeps.about import SweepJson
from fecm.sweeps.mesh_error import MeshErrorEstimate

Schema = dict[str, Any]
TEXT: Schema = {"type": "string"}
PLAIN: dict[Any, Schema] = {
    bool: {"type": "boolean"},
    int: {"type": "integer"},
    str: TEXT,
    NoneType: {"type": "null"},
    float: {"$ref": "#/$defs/number"},
}
NUMBER: Schema = {
    "description": "A number; NaN and infinities are texts.",
    "anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"]}],
}
UNITS = Annotated[dict[str, str], "Names of the units; empty if the deck names none."]
# Keys beside those of a type.
OTHERS = {
    ProblemSummary: {"kind": Literal["summary"], "file": str},
    MeshErrorEstimate: {
        "kind": Literal["mesh_error"],
        "file": str,
        "change": FiniteFloat,
        "relative_change": Annotated[FiniteFloat | None, "Null without a contact."],
        "units": UNITS,
    },
}
# Types with further keys, and the type of these.
FURTHER: dict[type, Any] = {PositionJson: int | str, MetricsJson: float}
OUTPUTS: dict[str, tuple[str, list[type]]] = {
    "check": (
        "A line of `fecm check --format json`",
        [FindingJson, ProblemSummary, MeshErrorEstimate],
    ),
    "run": ("A line of `fecm run --format json`, one for each problem", [ProblemRunJson]),
    "sweep": ("Output of `fecm sweep --format json`", [SweepJson]),
    "info": ("Output of `fecm info --format json`", [RunFileJson, SweepFileJson, LocationFileJson]),
    "diff": ("Output of `fecm diff --format json`", [DifferenceJson]),
    "modes": ("Output of `fecm modes --format json`", [ModesJson, EdgeFitJson]),
}


def attributes(kind: type) -> dict[str, str]:
    """Descriptions in the section Attributes of a class."""
    section = (kind.__doc__ or "").partition("Attributes\n    ----------\n")[2]
    fields = re.findall(r"^    (\w.*) : .*\n((?:        .+\n)+)", section, re.MULTILINE)
    return {n: " ".join(text.split()) for names, text in fields for n in names.split(", ")}


def schema_of(kind: Any, defs: dict[str, Schema]) -> Schema | bool:
    """Schema of a type; those of the types of its fields are added to `defs`."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return annotated(arguments[0], arguments[1:], defs)
    if kind in PLAIN:
        return PLAIN[kind]
    if origin in (Union, UnionType):
        values = [schema_of(one, defs) for one in arguments]
        if all(isinstance(one, dict) and one.keys() == {"type"} for one in values):
            return {"type": [one["type"] for one in values if isinstance(one, dict)]}
        return {"anyOf": values}
    if origin is Literal:
        return {"enum": list(arguments)} if len(arguments) > 1 else {"const": arguments[0]}
    if origin is tuple and Ellipsis not in arguments:
        return array(schema_of(arguments[0], defs), len(arguments))
    if origin in (list, tuple, Sequence):
        return array(schema_of(arguments[0], defs))
    if origin in (dict, Mapping):
        return {"type": "object", "additionalProperties": schema_of(arguments[1], defs)}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return {"enum": [one.value for one in kind]}
    if is_typeddict(kind) or is_dataclass(kind):
        name = kind.__name__.removesuffix("Json")
        if name not in defs:
            defs[name] = of_fields(kind, defs)
        return {"$ref": f"#/$defs/{name}"}
    if kind in (Any, object):
        return True
    raise TypeError(f"no schema is known for {kind}")


def annotated(kind: Any, notes: Sequence[Any], defs: dict[str, Schema]) -> Schema | bool:
    """Schema of a type with metadata."""
    schema: Any = None
    description = {}
    for note in notes:
        match note:
            case str():
                description = {"description": note}
            case re.Pattern():
                schema = {**TEXT, "pattern": note.pattern}
            case tuple():
                schema = {"type": "number"}
                for count in reversed(note):
                    schema = array(schema, count)
            case _:
                schema = schema_of(note, defs)
    if schema is None:
        schema = schema_of(kind, defs)
    return {**description, **schema} if description else schema


def array(items: Schema | bool, count: int | None = None) -> Schema:
    """Schema of an array, of `count` items if it is given."""
    bounds = {} if count is None else {"minItems": count, "maxItems": count}
    return {"type": "array", "items": items, **bounds}


def of_fields(kind: type, defs: dict[str, Schema]) -> Schema:
    """Schema of an object with the fields of a TypedDict or a dataclass."""
    hints = get_type_hints(kind, include_extras=True)
    required = [n for n in hints if n in getattr(kind, "__required_keys__", hints)]
    others = OTHERS.get(kind, {})
    described = {} if is_typeddict(kind) else attributes(kind)
    properties: dict[str, Any] = {}
    for name, hint in {**others, **hints}.items():
        schema = schema_of(hint, defs)
        if name in described and isinstance(schema, dict):
            schema = {"description": described[name], **schema}
        properties[name] = schema
    more = {"additionalProperties": schema_of(FURTHER[kind], defs)} if kind in FURTHER else {}
    return {
        "type": "object",
        "required": [*others, *required],
        "properties": properties,
        **more,
    }


def text_of(name: str) -> str:
    """Text of the schema of an output."""
    title, kinds = OUTPUTS[name]
    defs: dict[str, Schema] = {}
    values = [schema_of(kind, defs) for kind in kinds]
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "oneOf": values,
        "$defs": {**dict(sorted(defs.items())), "number": NUMBER},
    }
    return json.dumps(schema, indent=2) + "\n"


if __name__ == "__main__":
    for output in OUTPUTS:
        (Path(sys.argv[1]) / f"{output}.json").write_text(text_of(output), encoding="utf-8")
