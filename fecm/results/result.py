"""Result in Python: arrays by name, from a run or from a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from fecm._errors import ResultFileError, warn
from fecm._table import html_of
from fecm._text import Decimal
from fecm._typing import AnyFile, Floats
from fecm.deck.model import Deck
from fecm.judge.end import End
from fecm.results import schema
from fecm.results.groups import GROUPS, NotStoredError, ResultGroup, not_stored
from fecm.results.metrics import METRICS, MetricAttributes
from fecm.results.run_metrics import ImpactMetrics, end_of, metrics_of
from fecm.results.stored import Stored
from fecm.results.written import Reported, Saved

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray
    from matplotlib.axes import Axes

    from fecm.deck.findings import Finding
    from fecm.results.comparison import Comparison
    from fecm.results.exposures import FirstFailure
    from fecm.results.hdf5_reader import FileContents
    from fecm.results.pictures import RunKind
    from fecm.results.plies import PlyGroup


class Result(Stored, Saved, Reported, schema.ContactRows, MetricAttributes):
    """Result of a run.

    Every dataset is available as ``result["tape3/w"]`` and ``result.tape3.w``; the columns of the
    history (``time``, ``force``, ``indentation``, ``transducer``, ``displacement``, ``velocity``,
    ``acceleration``, ``plate_w``, ``step``) also as ``result.force``, and the impact metrics as
    ``result.peak_force``.  Units are those of the deck.

    Parameters
    ----------
    arrays : mapping of str to ndarray
        Datasets by path.
    texts : mapping of str to str
        Texts by path.
    groups : mapping of str to mapping
        Attributes of the groups; ``""`` has the attributes of the result itself.

    Attributes
    ----------
    attributes : dict
        Attributes of the result.
    deck_text : str
        The cards of the problem, as in the file; :attr:`deck` has them read.
    findings : tuple of Finding
        Warnings and notes about the deck, of a run in this process; empty for a loaded result.
    """

    step: schema.Ints
    time: Floats
    plate_w: Floats
    mesh: schema.MeshGroup
    laminate: schema.LaminateStiffness
    tape3: schema.Tape3
    tape8: schema.Tape8
    tape9: schema.Tape9
    history: schema.HistoryRows
    energy: schema.Energy
    gages: schema.GageGroup
    membrane: schema.MembraneRows
    stresses: schema.Stresses
    patch: schema.PatchGroup
    failure: schema.FailureGroup
    exposures: schema.ExposureRows
    reactions: schema.Reactions
    modes: schema.ModeRows

    findings: tuple[Finding, ...] = ()

    @property
    def plies(self) -> PlyGroup:
        """Ply stresses: ``result.plies(time, elements)``, or a dataset ``result.plies.sigma_1``."""
        from fecm.results.plies import PlyGroup  # 1 ms, and few results have plies

        return PlyGroup(self)

    @property
    def first_failures(self) -> list[FirstFailure]:
        """Times at which each criterion of FAIL first reaches an exposure of 1, the earliest first.

        Empty without FAIL, or if all exposures stay below 1.
        """
        from fecm.results.exposures import first_failures  # 1 ms, for FAIL only

        return first_failures(self)

    @property
    def end(self) -> End | None:
        """State of the contact at the end of the run; None without impact steps.

        Examples
        --------
        >>> import fecm
        >>> fecm.run_one("decks/impact-115.inp").end
        <End.OVER: 'contact over'>
        """
        return end_of(self)

    @property
    def metrics(self) -> ImpactMetrics:
        """Impact metrics by name, as items and as attributes, such as ``metrics.peak_force``.

        Empty without impact steps.  Unknown values are NaN: those that the :attr:`end` of the run
        has not decided, those that need a deck that can't be read, the time of a threshold that is
        not reached.
        """
        return ImpactMetrics(metrics_of(self), self.units, self.validity)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the history as a pandas DataFrame: one row per step, indexed by time.

        ``attrs["units"]`` has the units of the columns and the time, if the deck names its units.

        Raises
        ------
        ImportError
            If pandas is not installed.
        NotStoredError
            If the run has no impact step; a KeyError.
        """
        from fecm.results.export import dataframe  # 1 ms, which a run does not need

        return dataframe(self)

    def to_xarray(self) -> xarray.DataTree:
        """Return the result as a tree of labelled arrays; needs xarray.

        Dimensions have the names of the file's scales (``time``, ``node``, ``element``, ...). x and
        y of the nodes are coordinates. ``units`` are the deck's units, as pint-xarray reads them.

        Examples
        --------
        >>> tree = result.to_xarray()  # doctest: +SKIP
        >>> tree["tape3"].w.sel(time=1e-4, method="nearest").max()  # doctest: +SKIP
        """
        from fecm.results.export import datatree  # 1 ms, which a run does not need

        return datatree(self)

    def to_pyvista(self, time: float | str | None = None) -> pyvista.UnstructuredGrid:
        """Return the plate and its fields at a time, as point and cell data; needs PyVista.

        The fields are those of ``fecm export --to vtkhdf`` (docs/results.md): displacements,
        strains, ply stresses, and the largest exposures of the run. Strains and ply stresses that
        were not stored at the step of the displacements are absent. The field data are ``time``
        and, if there are reasons to doubt the result or its fields, ``notes``.

        Parameters
        ----------
        time : float or str, optional
            Time, also with a unit, as in ``"50us"``. The nearest row of displacements is taken; by
            default the last.

        Raises
        ------
        NotStoredError
            If the result has no displacements, or none at this time.
        ExportError
            If elements that do not exist have ply stresses.
        ImportError
            If PyVista is not installed.

        Examples
        --------
        >>> grid = result.to_pyvista(1e-4)  # doctest: +SKIP
        >>> grid.warp_by_vector("displacement", factor=20.0).plot(scalars="sigma_2")
        ... # doctest: +SKIP
        """
        from fecm.results.export import pyvista_grid  # 1 ms, which a run does not need

        return pyvista_grid(self, time)

    def _write(self, path: Path, *, overwrite: bool) -> None:
        from fecm.results.hdf5_writer import save_result  # h5py takes 30 ms

        save_result(self, path, overwrite=overwrite)

    @property
    def _name(self) -> str:
        return self.title or "the result"

    def export(
        self,
        path: str | Path,
        dataset: str = "",
        *,
        to: Literal["vtkhdf", "csv"] | None = None,
        overwrite: bool = False,
        decimal: Decimal = "point",
    ) -> None:
        """Write the result for ParaView or a spreadsheet, as ``fecm export`` does.

        A :class:`~fecm.FecmWarning` names fields that are exported incompletely.

        Parameters
        ----------
        path : str or Path
            File to write.
        dataset : str
            What csv holds: a dataset such as ``"tape3/w"``, or a group; by default ``"history"``.
        to : str, optional
            ``"vtkhdf"`` or ``"csv"``; by default what the suffix of the file says.
        overwrite : bool
            Whether an existing file is replaced.
        decimal : {"point", "comma"}
            Decimal mark of csv. With commas, semicolons separate the values.

        Raises
        ------
        ExportError
            If the format is unknown, or the result lacks the data.
        OSError
            If the file exists and may not be replaced, or can't be written.

        Examples
        --------
        >>> import fecm
        >>> result = fecm.run_one(fecm.examples.path("impact-patch"))
        >>> result.export("impact-patch.vtkhdf")
        >>> result.export("curvature.csv", "tape8/kappa_x")
        """
        from fecm.results.export import export_result, format_of  # h5py takes 30 ms

        file = Path(path)
        form = format_of(file, to)
        export_result(self, file, form, dataset, warn, overwrite=overwrite, decimal=decimal)

    def plot(
        self,
        kind: RunKind = "force",
        path: str | Path | None = None,
        *,
        ax: Axes | None = None,
        overwrite: bool = False,
        **options: Any,
    ) -> Axes:
        """Draw a picture on a new figure of pyplot, on given axes, or in a file.

        The axes hold the result's numbers in the deck's units; the labels of their ticks are
        scaled.  The user's settings of matplotlib hold, except in files.

        Parameters
        ----------
        kind : str
            ``"force"``, ``"loop"``, ``"energy"``, ``"strain"``, ``"thickness"``, ``"failure"``,
            ``"line"``, ``"contour"``, ``"surface"``, ``"mesh"`` or ``"animation"``.
        path : str or Path, optional
            File to write instead, as ``fecm plot`` does.  The suffix selects the format.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on.
        overwrite : bool
            Replace an existing file.
        **options
            Options of the kind, such as ``times`` or ``overlay``; see docs/pictures.md.

        Returns
        -------
        matplotlib.axes.Axes
            The picture's first axes.

        Raises
        ------
        PlotError
            If the result lacks the data, the options are invalid, or `ax` is given and the picture
            has several axes.
        FileExistsError
            If the file exists and may not be replaced.
        ImportError
            If matplotlib is not installed.

        Examples
        --------
        >>> ax = result.plot("force", width="full")  # doctest: +SKIP
        >>> ax.plot(time, force, ".")  # doctest: +SKIP
        """
        from fecm.results.pictures import plot_results  # which a run does not need

        return plot_results(kind, {self._name: self}, path, ax, overwrite=overwrite, **options)

    def compare(
        self,
        measured: str | Path | tuple[Any, Any],
        *,
        columns: Sequence[str] = (),
        units: Sequence[str] = (),
        delay: float = 0.0,
        offset: float = 0.0,
    ) -> Comparison:
        """Compare the contact force, or the transducer, with a measured one.

        Parameters
        ----------
        measured : str, Path or tuple
            CSV file with the columns time and force (or transducer), or times and forces.  They are
            converted to the deck's units if the file or `units` names those of the measurement.
        columns : sequence of str, optional
            Names or numbers (from 1) of the columns of time and force; by default the usual names,
            such as ``"time"`` and ``"force"`` or ``"load"``.  A minus before one changes its sign.
        units : sequence of str, optional
            Units of time and force of a measurement that names none, such as ``("ms", "kN")``; by
            default the deck's.
        delay, offset : float
            Measured time of the first contact, and measured force without a contact, which are
            subtracted; :func:`fecm.identify` fits them.

        Returns
        -------
        Comparison
            Peaks, impulses, rms of the difference and correlation; ``str()`` says them in words.

        Raises
        ------
        StudyError
            If the file is invalid, a unit is unknown, the numbers are invalid, or fewer than two
            times are within the times of the result.

        Examples
        --------
        >>> print(result.compare("shot-3.csv"))  # doctest: +SKIP
        """
        from fecm.results.comparison import compare_force, measurement_of  # 4 ms at start

        measurement = measurement_of(measured, self.units, columns, units)
        return compare_force(self, measurement.corrected(delay, offset))

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if name.startswith("_"):
                raise AttributeError(name)
            if f"history/{name}" in self._arrays:
                return self[f"history/{name}"]
            if any(path.startswith(f"{name}/") for path in self._arrays):
                return (GROUPS[name].kind if name in GROUPS else ResultGroup)(name, self)
            metrics = self.metrics
            if name in METRICS:
                return metrics[name]
            attributes = [other for other in object.__dir__(self) if other[0] != "_"]
            raise NotStoredError(not_stored(name, self._arrays, [*attributes, *metrics]))

    def __dir__(self) -> list[str]:
        heads = {path.partition("/")[0] for path in self._arrays}
        columns = [p.partition("/")[2] for p in self._arrays if p.startswith("history/")]
        metrics = METRICS if columns else ()
        return [*super().__dir__(), *heads, *columns, *metrics]

    def __repr__(self) -> str:
        steps = len(self["history/time"]) if "history/time" in self else 0
        return f"<fecm result {self.title!r}, {self.mode} mode, {steps} steps>"

    def __str__(self) -> str:
        from fecm.results.summary import summary_of_run  # 4 ms at start

        return str(summary_of_run(self))

    def _repr_html_(self) -> str:
        """Return answer, tables and notes, for notebooks."""
        from fecm.results.summary import summary_of_run  # 4 ms at start

        return html_of(self, summary_of_run(self))


def load(path: str | Path | AnyFile) -> Result:
    """Open a result file; datasets are read on demand.

    Parameters
    ----------
    path : str, Path or file
        A file that ``fecm run`` wrote, or one that is open as bytes, which is read into memory.

    Raises
    ------
    ResultFileError
        If the file is not a result, or a dataset has the wrong shape or type.
    OSError
        If it can't be opened.

    Examples
    --------
    >>> result = load("appendix.h5")
    >>> float(result.force.max())  # doctest: +SKIP
    6.19
    """
    from fecm.results.hdf5_reader import read  # h5py takes 30 ms

    return result_of(read(path))


def result_of(contents: FileContents, model: Deck | None = None) -> Result:
    """Build the result of a run from the contents of its file.

    Raises ResultFileError if a dataset has the wrong shape or type, or an attribute the wrong type.
    """
    # 1 ms, which the result of a run itself does not need.
    from fecm.results.hdf5_reader import attribute_error, first_misfit

    misfit = first_misfit(contents)
    if message := misfit.message if misfit else attribute_error(contents.groups):
        raise ResultFileError(f"{contents.path}: {message}")
    attributes = {"": contents.attributes, **contents.groups}
    return Result(contents, contents.texts, attributes, model)
