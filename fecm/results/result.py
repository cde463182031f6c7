"""A result in Python: arrays by name, from a run or from a file."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._tables import html_table
from fecm._typing import Array, Floats
from fecm.deck.model import Deck, Impact
from fecm.deck.records import AXES, DOF_NAMES
from fecm.deck.units import unit_of
from fecm.results import schema
from fecm.results.checks import attribute_error, shape_error
from fecm.results.end import End, decided
from fecm.results.errors import NotStoredError, ResultFileError
from fecm.results.group import Group
from fecm.results.metrics import (
    INTEGERS,
    METRICS,
    MOBILITY,
    VALIDITY,
    Indentation,
    Metrics,
    Projectiles,
    summarise,
)
from fecm.results.missing import not_stored
from fecm.results.schema import DATASETS, Dataset, declared_units

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray
    from matplotlib.axes import Axes

    from fecm.deck.findings import Finding
    from fecm.results.comparison import Comparison
    from fecm.results.first_failure import FirstFailure
    from fecm.results.hdf5_reader import Contents
    from fecm.results.pictures import RunKind
    from fecm.results.plies import Plies

HISTORY = "history"


class PlyGroup(schema.PlyRows):
    """The datasets of ``plies``; called, the stresses and strains of some plies."""

    def __init__(self, result: Result) -> None:
        super().__init__("plies", result._arrays, result._groups)
        self._result = result

    def __call__(
        self,
        time: float | Sequence[float] | None = None,
        elements: int | Sequence[int] | None = None,
    ) -> Plies:
        """Stresses and strains ply by ply.

        Parameters
        ----------
        time : float or sequence of float, optional
            Times, for which the nearest stored rows are taken; all rows by default.
        elements : int or sequence of int, optional
            Numbers of elements; by default all with ply stresses.

        Raises
        ------
        NotStoredError
            If the result has no ply stresses, or not at such a time or of such an element.
        ResultFileError
            If the result's deck can't be read or does not fit its ply stresses.

        Examples
        --------
        >>> plies = result.plies(time=4e-5, elements=[61, 62])  # doctest: +SKIP
        >>> plies.sigma_1.max(), plies.eps_1.max()  # doctest: +SKIP
        """
        from fecm.results.plies import plies_of

        return plies_of(self._result, time, elements)


class Result(schema.Contact):
    """Result of a run.

    Every dataset is available as ``result["tape3/w"]`` and ``result.tape3.w``; the columns of the
    history (``time``, ``force``, ``indentation``, ``transducer``, ``displacement``, ``velocity``,
    ``acceleration``, ``plate_w``, ``step``) also as ``result.force``.  Units are those of the deck.

    Parameters
    ----------
    arrays : mapping of str to ndarray
        Datasets by path.
    texts : mapping of str to str
        Texts by path.
    groups : mapping of str to mapping
        Attributes of the groups; those of the result itself under ``""``.

    Attributes
    ----------
    attributes : dict
        Attributes of the result.
    deck : str
        The cards of the problem.
    findings : tuple of Finding
        Warnings and notes about the deck, of a run in this process; empty for a loaded result.
    """

    step: schema.Ints
    time: Floats
    plate_w: Floats
    mesh: schema.Mesh
    laminate: schema.LaminateStiffness
    tape3: schema.Tape3
    tape8: schema.Tape8
    tape9: schema.Tape9
    history: schema.History
    energy: schema.Energy
    gages: schema.GageGroup
    stresses: schema.Stresses
    patch: schema.PatchGroup
    failure: schema.Failure
    exposures: schema.Exposures
    reactions: schema.Reactions
    modes: schema.Modes

    def __init__(
        self,
        arrays: Mapping[str, Array],
        texts: Mapping[str, str],
        groups: Mapping[str, Mapping[str, Any]],
        model: Deck | None = None,
    ) -> None:
        self._arrays = arrays
        self._groups = groups
        self.attributes: dict[str, Any] = dict(groups.get("", {}))
        self.deck: str = texts.get("deck", "")
        self._model = model
        self.findings: tuple[Finding, ...] = ()

    @property
    def title(self) -> str:
        """The deck's title."""
        return str(self.attributes.get("title", ""))

    @property
    def mode(self) -> str:
        """``"report"`` or ``"listing"``."""
        return str(self.attributes.get("mode", ""))

    @property
    def slips(self) -> tuple[str, ...]:
        """Names of the active slips, sorted."""
        return self._texts("slips")

    @property
    def notes(self) -> tuple[str, ...]:
        """Reasons to doubt the result."""
        return self._texts("notes")

    def _texts(self, name: str) -> tuple[str, ...]:
        """An attribute that is a list of texts; empty if it is not there."""
        texts = self.attributes.get(name)
        return tuple(map(str, texts)) if isinstance(texts, list | tuple) else ()

    @property
    def has_listing_tapes(self) -> bool:
        """Whether tape8 and tape9 are those of the printed program: the slip ``tapes``."""
        return "tapes" in self.slips

    def unit(self, dimension: str) -> str:
        """Unit of a dimension such as ``"force/length"``; empty if the deck names none."""
        return unit_of(dimension, declared_units(self.attributes))

    @property
    def plies(self) -> PlyGroup:
        """Ply stresses: ``result.plies(time, elements)``, or a dataset ``result.plies.sigma_1``."""
        return PlyGroup(self)

    @property
    def still_in_contact(self) -> bool:
        """Whether the run ended in contact, so that its final values are not known."""
        return f"{HISTORY}/force" in self and bool((self[f"{HISTORY}/force"][-1:] > 0.0).any())

    @property
    def threshold(self) -> Mapping[str, Any]:
        """Delamination threshold of DELA; empty without it.

        `force` of `number` delaminations, `d_star`, `time` of the first crossing, `margin` of the
        peak, and `band`: forces of one in each of the `interfaces` of unlike plies, and of one.
        """
        return self._groups.get("threshold", {})

    @property
    def first_failures(self) -> list[FirstFailure]:
        """When each criterion of FAIL first reaches an exposure of 1, the earliest first.

        Empty without FAIL, or if all exposures stay below 1.
        """
        from fecm.results.first_failure import first_failures

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
        found = self._summarised()
        return None if found is None else End(found.end.item())

    @property
    def validity(self) -> str:
        """``"ok"``, or the reasons to doubt the result, in the words that sweeps have.

        Empty in files of earlier versions and without impact steps.
        """
        return str(self.attributes.get(VALIDITY, ""))

    @property
    def metrics(self) -> dict[str, float]:
        """Impact metrics by the names of :data:`fecm.results.metrics.METRICS`.

        Empty without impact steps.  Unknown values are NaN: those that the :attr:`end` of the run
        has not decided, those that need a deck that can't be read, the time of a threshold that is
        not reached.
        """
        if (found := self._summarised()) is None:
            return {}
        w = self[f"{HISTORY}/plate_w"]
        columns = found.columns | {"max_deflection": decided(w[[w.argmax()]], w[-1:], found.end)}
        values: dict[str, float] = {n: columns[n].item() for n in METRICS if n in columns}
        return values | {n: int(values[n]) for n in INTEGERS if math.isfinite(values[n])}

    def _summarised(self) -> Metrics | None:
        """Metrics of the run; None without impact steps."""
        if f"{HISTORY}/force" not in self or not len(self[f"{HISTORY}/force"]):
            return None
        from fecm.results.plies import model_of

        velocity = np.float64(math.nan)
        with contextlib.suppress(ResultFileError):
            if (card := model_of(self).last(Impact)) is not None and card.velocity:
                velocity = np.float64(card.velocity)
        force, time, indentation = (
            self[f"{HISTORY}/{name}"] for name in ("force", "time", "indentation")
        )
        history = self.attributes_of(HISTORY)
        permanent = np.array([_number(history.get("permanent_indentation"))])
        initial = _number(self.attributes_of("energy").get("initial"))
        largest = indentation.max(keepdims=True, initial=0.0)
        depths = Indentation(largest, indentation[-1:], permanent)
        threshold = _number(self.threshold.get("force")) if self.threshold else None
        mobility = _number(history.get(MOBILITY, 0.0))
        with np.errstate(all="ignore"):
            hit = Projectiles(2.0 * initial / velocity**2, velocity)
            return summarise(force[:, None], time, depths, hit, threshold, mobility)

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Rows of a dataset; those of a file are not kept in memory."""
        read = getattr(self._arrays, "rows", None)
        if read is None:
            return np.asarray(self._arrays[path.strip("/")][start:stop])
        return np.asarray(read(path, start, stop))

    def to_dataframe(self) -> pandas.DataFrame:
        """The history as a pandas DataFrame: one row per step, indexed by time.

        Raises
        ------
        ImportError
            If pandas is not installed.
        KeyError
            If the run has no impact step.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("a DataFrame needs pandas: pip install pandas") from None
        members = [path for path in self if path.startswith(f"{HISTORY}/")]
        if not members:
            raise KeyError("the result has no history: no impact step was taken")
        known = [path for path in DATASETS if path in members]
        columns = {path.partition("/")[2]: self[path] for path in dict.fromkeys(known + members)}
        index = pandas.Index(columns.pop("time"), name="time")
        return pandas.DataFrame(columns, index=index)

    def to_xarray(self) -> xarray.DataTree:
        """The result as a tree of labelled arrays; needs xarray.

        Dimensions have the names of the file's scales (``time``, ``node``, ``element``, ...); x and
        y of the nodes are coordinates; ``units`` are the deck's, as pint-xarray reads them.

        Examples
        --------
        >>> tree = result.to_xarray()  # doctest: +SKIP
        >>> tree["tape3"].w.sel(time=1e-4, method="nearest").max()  # doctest: +SKIP
        """
        try:
            import xarray
        except ImportError:
            raise ImportError("a DataTree needs xarray: pip install 'fecm[xarray]'") from None
        groups: dict[str, dict[str, Any]] = {}
        for path in self:
            values = self[path]
            known = DATASETS.get(path, Dataset(path, values.shape, ""))
            texts = {"long_name": known.description, "units": self.unit(known.dimension)}
            names = {"rows": ("time", ""), **schema.SCALES}
            axes = [
                names.get(str(size), (f"{known.name}_{n}",))[0]
                for n, size in enumerate(known.shape)
            ]
            attributes = {name: text for name, text in texts.items() if text}
            groups.setdefault(known.group, {})[known.name] = (axes, values, attributes)
        units = {"units": unit} if (unit := self.unit("length")) else {}
        places = {
            axis: ("node", values, units)
            for axis, values in zip(AXES, self["mesh/coordinates"].T, strict=False)
        }
        unknowns = {"unknown": list(DOF_NAMES[: self["mesh/equations"].shape[1]])}
        tree = {"/": xarray.Dataset(coords=unknowns, attrs=self.attributes)}
        for name, variables in groups.items():
            at_nodes = any("node" in axes for axes, _, _ in variables.values())
            own = self.attributes_of(name)
            tree[name] = xarray.Dataset(variables, places if at_nodes else {}, own)
        return xarray.DataTree.from_dict(tree)

    def to_pyvista(self, time: float | None = None) -> pyvista.UnstructuredGrid:
        """The plate with its displacements, w and rotations as point data; needs PyVista.

        Parameters
        ----------
        time : float, optional
            The nearest stored row is taken; by default the last.

        Raises
        ------
        NotStoredError
            If the result has no displacements, or none at this time.
        """
        try:
            import pyvista
        except ImportError:
            raise ImportError("a grid needs PyVista: pip install 'fecm[pyvista]'") from None
        from fecm.results.plies import rows_at
        from fecm.results.vtkhdf import vtk_cells

        if "tape3/w" not in self:
            raise NotStoredError("there are no displacements (tape3) in this result; add DISP")
        (row,) = [-1] if time is None else rows_at(self["tape3/time"], [time], "displacements")
        connectivity, offsets, types = vtk_cells(self["mesh/elements"])
        points = np.zeros((len(self["mesh/coordinates"]), 3))
        points[:, :2] = self["mesh/coordinates"][:, :2]
        cells = np.insert(connectivity, offsets[:-1], np.diff(offsets))
        grid = pyvista.UnstructuredGrid(cells, types, points)
        field = self["tape3/displacement"][row]
        grid.point_data["displacement"] = field[:, :3]
        grid.point_data["w"], grid.point_data["rotation"] = field[:, 2], field[:, 3:]
        grid.field_data["time"] = [self["tape3/time"][row]]
        return grid

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the result as a file, such as one of a run in memory.

        Raises
        ------
        OSError
            If the file exists and may not be replaced, or can't be written.
        """
        from fecm._files import check_outputs
        from fecm.results.hdf5_writer import writing

        check_outputs([Path(path)], overwrite)
        with writing(Path(path), overwrite=overwrite) as sink:
            sink.attributes("", self.attributes)
            sink.text("deck", self.deck, "the cards of the problem")
            for name in self:
                values = self[name]
                own = Dataset(name, values.shape, "", dtype=values.dtype.name)
                sink.create(DATASETS.get(name, own), values.shape)
                sink.write(name, 0, values)
            for group in filter(None, self._groups):
                sink.attributes(group, self.attributes_of(group))

    def attributes_of(self, group: str) -> dict[str, Any]:
        """Attributes of a group; empty without the group."""
        return dict(self._groups.get(group, {}))

    def plot(
        self,
        kind: RunKind = "force",
        path: str | Path | None = None,
        *,
        ax: Axes | None = None,
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
            File to write instead, as ``fecm plot`` does; an existing one is replaced.  The suffix
            selects the format.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on.
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
        ImportError
            If matplotlib is not installed.

        Examples
        --------
        >>> ax = result.plot("force", width="full")  # doctest: +SKIP
        >>> ax.plot(time, force, ".")  # doctest: +SKIP
        """
        from fecm.results.pictures import plot

        return plot(kind, {self.title or "the result": self}, path, ax, **options)

    def compare(
        self,
        measured: str | Path | tuple[Any, Any],
        *,
        delay: float = 0.0,
        offset: float = 0.0,
    ) -> Comparison:
        """Compare the contact force, or the transducer, with a measured one.

        Parameters
        ----------
        measured : str, Path or tuple
            CSV file with the columns time and force (or transducer), or times and forces, in the
            deck's units.
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
            If the file is invalid or in other units, the numbers are invalid, or no two of the
            times are within those of the result.

        Examples
        --------
        >>> print(result.compare("shot-3.csv"))  # doctest: +SKIP
        """
        from fecm.results.comparison import compare, measurement_of

        given = measurement_of(measured, declared_units(self.attributes))
        return compare(self, given.corrected(delay, offset))

    def __getitem__(self, path: str) -> Array:
        name = path.strip("/")
        if name not in self._arrays:
            raise NotStoredError(not_stored(name, self._arrays))
        return np.asarray(self._arrays[name])

    def __contains__(self, path: str) -> bool:
        return path.strip("/") in self._arrays

    def __iter__(self) -> Iterator[str]:
        """Iterate over the paths of all datasets."""
        return iter(self._arrays)

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if name.startswith("_"):
                raise AttributeError(name)
            if f"{HISTORY}/{name}" in self._arrays:
                return self._arrays[f"{HISTORY}/{name}"]
            if any(path.startswith(f"{name}/") for path in self._arrays):
                return schema.GROUP_TYPES.get(name, Group)(name, self._arrays, self._groups)
            raise NotStoredError(not_stored(name, self._arrays))

    def __dir__(self) -> list[str]:
        heads = {path.partition("/")[0] for path in self._arrays}
        columns = [p.partition("/")[2] for p in self._arrays if p.startswith(f"{HISTORY}/")]
        return [*super().__dir__(), *heads, *columns]

    def __repr__(self) -> str:
        steps = len(self["history/time"]) if "history/time" in self else 0
        return f"<fecm result {self.title!r}, {self.mode} mode, {steps} steps>"

    def _repr_html_(self) -> str:
        """Table of the metrics, for notebooks; without an impact of the datasets."""
        rows = [
            (name.replace("_", " "), f"{value:.6g} {self.unit(METRICS[name][1])}".rstrip())
            for name, value in self.metrics.items()
        ] or [(path, str(self[path].shape)) for path in self]
        return html_table(repr(self)[1:-1], [*rows, *(("note", note) for note in self.notes)])


def load(path: str | Path) -> Result:
    """Open a result file; datasets are read on demand.

    Parameters
    ----------
    path : str or Path
        A file that ``fecm run`` wrote.

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
    from fecm.results.hdf5_reader import read

    return result_of(read(Path(path)))


def result_of(contents: Contents, model: Deck | None = None) -> Result:
    """Build a run's result from the contents of its file, and the deck's model where it is known.

    Raises ResultFileError if a dataset has the wrong shape or type, or an attribute the wrong type.
    """
    kinds = {name: dtype.kind for name, dtype in contents.dtypes.items()}
    found = shape_error(contents.shapes, kinds) or attribute_error(contents.groups)
    if found:
        raise ResultFileError(f"{contents.path}: {found}")
    attributes = {"": contents.attributes, **contents.groups}
    return Result(contents, contents.texts, attributes, model)


def _number(value: Any) -> float:
    """A number of a file's attribute; NaN for anything else."""
    return float(value) if isinstance(value, int | float) else math.nan
