"""Objects that other installed packages offer by their entry points."""

from __future__ import annotations

from enum import StrEnum

from fecm._errors import FecmError, did_you_mean


class EntryPoints(StrEnum):
    """Groups of entry points that fecm looks up."""

    LAWS = "fecm.laws"
    CRITERIA = "fecm.criteria"


WHAT = {EntryPoints.LAWS: "contact law", EntryPoints.CRITERIA: "failure criterion"}


class ExtensionError(FecmError, ValueError):
    """No installed package offers an object by a name, or it can't be imported."""


def installed(group: EntryPoints, name: str) -> object:
    """Load the entry point of a group by its name.

    Raises ExtensionError if no package has it, several packages have one, or it can't be imported.
    """
    from importlib.metadata import entry_points  # 20 ms, and few runs need it

    what = WHAT[group]
    matches = [entry for entry in entry_points(group=group) if entry.name == name]
    if not matches:
        names = sorted(entry_points(group=group).names)
        listed = ", ".join(names) if names else "none"
        raise ExtensionError(
            f"no installed package offers the {what} {name!r}; entry points of the group {group}: "
            f"{listed}{did_you_mean(name, names)}"
        )
    targets = sorted({entry.value for entry in matches})
    if len(targets) > 1:
        places = ", ".join(targets)
        raise ExtensionError(f"several installed packages offer the {what} {name!r}: {places}")
    try:
        return matches[0].load()
    except Exception as error:  # importing a package of others can raise anything
        text = f"{type(error).__name__}: {error}"
        raise ExtensionError(
            f"the {what} {name!r} of {matches[0].value} can't be imported ({text})"
        ) from error
