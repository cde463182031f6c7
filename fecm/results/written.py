"""Files and pages that results write of themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fecm._files import check_outputs
from fecm._methods import function_of
from fecm._options import described_by, documented, option

if TYPE_CHECKING:
    from fecm.results.comparison import Source

HEAD = "Head of the page"  # group of options
MEASURED = "Measured force"
OTHER = "Other options"


@documented
@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """What a page says besides its result.

    Parameters
    ----------
    {parameters}
    """

    title: str | None = option(
        None, "Title of the page.", default_text="the deck's", group=HEAD, metavar="TEXT"
    )
    author: str | None = option(None, "Who made the page.", group=HEAD, metavar="TEXT")
    client: str | None = option(None, "Who receives it.", group=HEAD, metavar="TEXT")
    project: str | None = option(None, "Project or order.", group=HEAD, metavar="TEXT")
    specimen: str | None = option(None, "Specimen of the test.", group=HEAD, metavar="TEXT")
    date: str | None = option(
        None, "Date, as it is to be printed; a page has no other.", group=HEAD, metavar="TEXT"
    )
    logo: str | Path | None = option(
        None, "Picture beside the title: .png, .jpg or .svg.", group=HEAD, metavar="FILE"
    )
    measured: Source | None = option(
        None,
        "Measured force that the page compares with the run: columns time and force (or "
        "transducer).",
        python="A CSV file, or times and forces.",
        group=MEASURED,
        metavar="FILE.csv",
    )
    columns: Sequence[str] | None = option(
        None,
        "Names or numbers (from 1) of its columns of time and force; a minus before one changes "
        "its sign.",
        default_text="the usual names",
        group=MEASURED,
        metavar="TIME,FORCE",
    )
    units: Sequence[str] | None = option(
        None,
        "Its units of time and force, if it names none, such as ms,kN.",
        default_text="the deck's",
        group=MEASURED,
        metavar="TIME,FORCE",
    )
    delay: float = option(
        0.0, "Its time of the first contact, subtracted.", group=MEASURED, metavar="TIME"
    )
    offset: float = option(
        0.0, "Its force without a contact, subtracted.", group=MEASURED, metavar="FORCE"
    )
    full_deck: bool = option(
        False, "Show all cards of the deck, nodes and elements too.", group=OTHER
    )


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

    @described_by(PageOptions)
    def report(
        self,
        path: str | Path,
        *,
        overwrite: bool = False,
        title: str | None = None,
        author: str | None = None,
        client: str | None = None,
        project: str | None = None,
        specimen: str | None = None,
        date: str | None = None,
        logo: str | Path | None = None,
        measured: Source | None = None,
        columns: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        delay: float = 0.0,
        offset: float = 0.0,
        full_deck: bool = False,
    ) -> None:
        """Write an HTML page to hand on, as ``fecm report`` and ``fecm identify --report`` do.

        The page is one file: answers, headline figures, pictures and deck; of a run also its
        validity, the model and checksums.

        Parameters
        ----------
        path : str or Path
            File to write, ``.html``.
        overwrite : bool
            Replace an existing file.
        {parameters}

        Raises
        ------
        ReportError
            If the name has another suffix, the logo is no picture that fits, or a measured force
            is given for something else than a run.
        StudyError
            If the measured force is invalid.
        FileExistsError
            If the file exists and may not be replaced.
        ImportError
            If Jinja2 or matplotlib is not installed.

        Examples
        --------
        >>> result.report("impact.html", client="Example Ltd", specimen="117")  # doctest: +SKIP
        """
        options = PageOptions(
            title=title,
            author=author,
            client=client,
            project=project,
            specimen=specimen,
            date=date,
            logo=logo,
            measured=measured,
            columns=columns,
            units=units,
            delay=delay,
            offset=offset,
            full_deck=full_deck,
        )
        write_report = function_of("Result.report")
        write_report({self._name: self}, Path(path), options=options, overwrite=overwrite)
