"""Decks and tables that come with the package: ``fecm example`` writes them."""

from __future__ import annotations

from pathlib import Path

from fecm._errors import OptionsError, did_you_mean

__all__ = ["names", "path"]

# What is in each file.
CONTENTS = {
    "impact-patch.inp": "the report's experiment at 115 in/s, with a contact patch (lbf, in, s)",
    "drop-weight.inp": "ASTM D7136 at 2.5 J, with strengths and delamination threshold (mm, N, s)",
    "drop-weight-held.inp": "the same, w held along the window: linear, for sweeps and fits",
    "plate-with-gages.inp": "a ball of 20 g on a clamped plate with strain gages (mm, N, s)",
    "panel-with-gages.inp": "a panel with four strain gages, to locate an impact (mm, N, s)",
    "panel-strains.csv": "strains of an impact somewhere on that panel: time, gages 1 to 4",
    "hole.msh": "mesh of Gmsh: 60 x 40 with a hole of radius 6, groups edge and hole",
    "measured-force.csv": "a force of impact-patch as a transducer shows it: time, force",
    "indentation-test.csv": "an indentation test in five cycles: indentation, force",
    "calibration-test.csv": "a calibration of a transducer: time, V_F, V_a",
    "pulse.csv": "a force on a rod: time, force",
    "cases.csv": "cases of a sweep of impact-patch: velocity, k, layup",
    "tests.csv": "tests of drop-weight-held: specimen, energy, measured peak and contact time",
}


def names() -> list[str]:
    """Names of the example files.

    Examples
    --------
    >>> names()[0]
    'impact-patch.inp'
    """
    return list(CONTENTS)


def path(name: str) -> Path:
    """Path of an example file in the installed package.

    Parameters
    ----------
    name : str
        One of :func:`names`, with or without its suffix.

    Raises
    ------
    OptionsError
        If there is no such example.

    Examples
    --------
    >>> path("impact-patch").name
    'impact-patch.inp'
    """
    for file in CONTENTS:
        if name in (file, Path(file).stem):
            return Path(__file__).parent / file
    stems = [Path(file).stem for file in CONTENTS]
    hint = did_you_mean(name, [*CONTENTS, *stems]) or f"; there are {', '.join(CONTENTS)}"
    raise OptionsError(f"there is no example {name!r}{hint}")


def __dir__() -> list[str]:
    return __all__
