"""Files and pages that results write of themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

from fecm._files import check_outputs
from fecm._methods import function_of


class Saved(ABC):
    """Result that has a file."""

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the result as a file, as the option ``-o`` of its command does.

        :func:`fecm.load`, :func:`fecm.load_sweep` and :func:`fecm.load_location` read files of
        runs, sweeps and locations.

        Parameters
        ----------
        path : str or Path
            HDF5 file to write.
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        FileExistsError
            If the file exists and may not be replaced.
        ResultWriteError
            If it can't be written; an OSError.

        Examples
        --------
        >>> import fecm
        >>> fecm.run_one("decks/appendix.inp").save("appendix.h5", overwrite=True)
        >>> result = fecm.sweep("decks/impact-115.inp", {"velocity": [50.0, 115.0]})
        >>> result.save("velocities.h5", overwrite=True)
        >>> fecm.load_sweep("velocities.h5").keys() == result.keys()
        True
        """
        check_outputs([Path(path)], overwrite)
        self._write(Path(path), overwrite=overwrite)

    @abstractmethod
    def _write(self, path: Path, *, overwrite: bool) -> None:
        """Write the file."""


class Reported(ABC):
    """Result that has a page."""

    @property
    @abstractmethod
    def _name(self) -> str:
        """Name of the result on pages and in legends."""

    def report(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write an HTML page to hand on, as ``fecm report`` and ``fecm identify --report`` do.

        The page is one file: verdict, numbers, pictures and deck; of a run also its validity, the
        model and checksums.

        Parameters
        ----------
        path : str or Path
            File to write, ``.html``.
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        ReportError
            If the name has another suffix.
        FileExistsError
            If the file exists and may not be replaced.
        ImportError
            If Jinja2 or matplotlib is not installed.

        Examples
        --------
        >>> result.report("impact.html")  # doctest: +SKIP
        """
        write_report = function_of("Result.report")
        write_report({self._name: self}, Path(path), overwrite=overwrite)
