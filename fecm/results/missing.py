"""Messages about datasets that a result does not have: similar names, or what stores them."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from fecm.results.groups import STORED_BY


def not_stored(asked: str, paths: Collection[str]) -> str:
    """Message about a path that is no dataset of a result: what is, or what stores it."""
    if members := sorted(path for path in paths if path.startswith(f"{asked}/")):
        return f"{asked} is a group, not a dataset; its datasets are {', '.join(members)}"
    group = asked.partition("/")[0]
    known = any(path.startswith(f"{group}/") for path in paths)
    more = suggestion(asked, paths) if known else remedy(asked) or suggestion(asked, paths)
    return f"there is no {asked} in this result{more}"


def suggestion(asked: str, paths: Iterable[str]) -> str:
    """End of a message about a missing dataset or group: similar names, or the groups."""
    import difflib  # 1 ms, only after a mistake

    known = sorted({name for path in paths for name in (path, path.rpartition("/")[0])} - {""})
    last_parts = [name.rpartition("/")[2] for name in known]
    close = difflib.get_close_matches(asked, last_parts, n=3) if "/" not in asked else []
    alike = [name for name, last in zip(known, last_parts, strict=True) if last in (asked, *close)]
    if alike := alike or difflib.get_close_matches(asked, known, n=3):
        return f"; did you mean {' or '.join(alike)}?"
    groups = sorted({name.partition("/")[0] for name in known})
    return f"; there are {', '.join(groups)}" if groups else ""


def remedy(path: str) -> str:
    """End of a message about a missing dataset: what stores it; empty if no macro does."""
    macro = STORED_BY.get(path.partition("/")[0])
    return f"; add {macro} to the deck's program and run it again" if macro else ""
