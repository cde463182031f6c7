"""Values for :func:`json.dumps`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias

Json: TypeAlias = "dict[str, Json] | list[Json] | str | int | float | bool | None"


def jsonable(value: object) -> Json:
    """Convert to a value that :func:`json.dumps` writes as valid JSON.

    Infinities and NaN become texts, and so does any other type.

    Examples
    --------
    >>> jsonable({"peak": 3.5, "time": float("nan"), "slips": ("tapes",)})
    {'peak': 3.5, 'time': 'NaN', 'slips': ['tapes']}
    """
    import json  # 2 ms at start, and few commands write JSON

    match value:
        case Mapping():
            return {str(key): jsonable(item) for key, item in value.items()}
        case list() | tuple():
            return [jsonable(item) for item in value]
        case float() if not math.isfinite(value):
            return json.dumps(value)
        case None | bool() | int() | float():
            return value
        case _:
            return str(value)
