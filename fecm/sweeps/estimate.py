"""Estimate of an impact by quick models, beside the run itself."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path

from fecm._errors import warn
from fecm._table import Row, Table, html_table, titled_lines
from fecm.deck.model import Deck
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.judge.limits import TOO_SOFT
from fecm.judge.threshold import AT_THE_LATEST, from_threshold
from fecm.judge.validity import Judge, unsafe
from fecm.problem.loading import sole_problem
from fecm.problem.problem import Problem
from fecm.results.metrics import RATIO
from fecm.results.stored import whole_plate
from fecm.studies.estimate import INFINITE_PLATE, LARGE, SMALL, QuickEstimate
from fecm.studies.estimate import quick_estimate as by_quick_models
from fecm.sweeps.execute import carry_out_plan
from fecm.sweeps.plan import plan

LABEL_WIDTH = 12  # of the labels in a terminal
RUN = "run"  # name of the row of the run itself
# Columns of the table, and their dimensions.
COLUMNS = {
    "peak_force": "force",
    "duration": "time",
    "threshold": "force",
    "velocity": "length/time",
    "energy": "force*length",
}


@dataclass(frozen=True)
class ModelEstimate:
    """Impact by one model, or by the run itself.

    Attributes
    ----------
    peak_force, duration : float
        Peak and duration of the contact; NaN where the run ends before they are known.
    threshold : float
        Delamination threshold that the model reaches, force; NaN without DELA.
    velocity, energy : float
        Impact velocity and energy that reach the threshold; NaN without DELA.
    applies : bool
        Whether the impact is in the range of the model.
    """

    peak_force: float
    duration: float
    threshold: float
    velocity: float
    energy: float
    applies: bool


@dataclass(frozen=True, eq=False)
class Estimate:
    """Quick estimates of an impact beside its run; ``str()`` is the page of `fecm estimate`.

    Attributes
    ----------
    title : str
        Title of the deck.
    response : str
        Class of the response by the mass ratio.
    mass_ratio : float
        Mass of the projectile over the mass of the plate.
    inelasticity : float
        Zener's parameter lambda.
    stiffness : float
        Static stiffness of the plate under its load, force/length; NaN for a free plate.
    models : dict of str to ModelEstimate
        ``"infinite plate"``, ``"static plate"`` and ``"nonlinear static plate"``, as far as the
        plate has them, and the ``"run"``.
    remarks : dict of str to str
        What models neglect (``"damping"``, ``"preload"``, ``"curvature"``, ``"gaps"``), how good
        the static model of a nonlinear plate is, or why it is missing (``"stretching"``), and by
        which model the run's velocity at the threshold was found (``"velocity"``).
    notes : tuple of str
        Reasons to doubt the numbers.
    units : dict of str to str
        Names of the deck's units; empty if it states none.
    """

    title: str
    response: str
    mass_ratio: float
    inelasticity: float
    stiffness: float
    models: dict[str, ModelEstimate]
    remarks: dict[str, str]
    notes: tuple[str, ...]
    units: dict[str, str]

    def to_dict(self) -> dict[str, object]:
        """Return plain values, as `fecm estimate --format json` prints them."""
        stretching = self.remarks.get("stretching")
        about = {"nonlinear": stretching} if stretching else {}
        return {
            "class": self.response,
            "mass_ratio": self.mass_ratio,
            "lambda": self.inelasticity,
            "stiffness": self.stiffness,
            **about,
            "models": [{"model": name, **asdict(model)} for name, model in self.models.items()],
        }

    def _tables(self) -> tuple[Table, Table]:
        """Return a table of what the models share, and a table of the models and the run."""
        free = " (the plate is free: no static model)" if math.isnan(self.stiffness) else ""
        shared: list[Row] = [
            ("class", f"M/M_plate = {self.mass_ratio:.4g}, {self.response}"),
            ("lambda", f"{self.inelasticity:.4g}"),
            ("stiffness", f"{self._text(self.stiffness, 'force/length')}{free}"),
            *self.remarks.items(),
        ]
        models = tuple(
            self._row(name, model) for name, model in self.models.items() if self._may_apply(name)
        )
        header = ("model", *(name.replace("_", " ") for name in COLUMNS))
        return Table(tuple(shared), title=self.title or "(no title)"), Table(models, header)

    def lines(self, columns: int | None = None) -> list[str]:
        """Return the lines that `fecm estimate` prints; `columns` is the longest."""
        return titled_lines(*self._tables(), width=LABEL_WIDTH, columns=columns)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        """Return tables of the estimate and its notes, for notebooks."""
        notes = (Table(tuple(("note", note) for note in self.notes)),) if self.notes else ()
        return html_table(*self._tables(), *notes)

    def _may_apply(self, name: str) -> bool:
        """Return whether a model is for masses such as this one, so that the page has its row."""
        if name == INFINITE_PLATE:
            return self.mass_ratio <= LARGE
        return name == RUN or self.mass_ratio >= SMALL

    def _row(self, name: str, model: ModelEstimate) -> Row:
        """Return the row of a model."""
        cells = [name if model.applies else f"{name} (out of range)"]
        for column, dimension in COLUMNS.items():
            # Force and duration of a run are open unless its contact ends.
            missing = "open" if column in ("peak_force", "duration") else "-"
            cells.append(self._text(getattr(model, column), dimension, missing))
        return tuple(cells)

    def _text(self, value: float, dimension: str, missing: str = "-") -> str:
        """Format a value with its unit."""
        return missing if math.isnan(value) else quantity(value, unit_of(dimension, self.units))


def estimate(deck: str | Path | Deck) -> Estimate:
    """Estimate an impact by quick models, and compare them with its run.

    The infinite plate is for small masses, the static plate for large masses. With NONL the static
    plate is computed linear and nonlinear. With a DELA segment, velocity and energy are the values
    at which the peak force reaches the delamination threshold. The models without a mesh neglect
    DAMP, and the infinite plate neglects PREL. The notes of the result are :class:`FecmWarning`.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem.

    Returns
    -------
    Estimate
        The models and the run.

    Raises
    ------
    DeckError
        If the deck has errors.
    StudyError
        If it has no impact, or the projectile does not approach.
    ValueError
        If the deck has several problems, or none.

    References
    ----------
    R. Olsson, "Impact response of orthotropic composite plates predicted from a one-parameter
    differential equation", AIAA J. 30 (1992) 1587-1596; C. Zener, Phys. Rev. 59 (1941) 669-673.

    Examples
    --------
    >>> import fecm
    >>> result = fecm.estimate(fecm.examples.path("drop-weight-held"))
    >>> result.response
    'quasi-static: the static plate applies, which underestimates the force by about 10 %'
    >>> static, run = result.models["static plate"], result.models["run"]
    >>> print(f"{static.peak_force:.0f} and {run.peak_force:.0f} {result.units['force']}")
    4648 and 4787 N
    """
    result = estimate_problem(sole_problem(deck))
    warn(*result.notes)
    return result


def estimate_problem(problem: Problem) -> Estimate:
    """Estimate the impact of a checked problem; raises StudyError as :func:`estimate`."""
    quick = by_quick_models(problem)
    of_run, searched, bent, doubts = _run_itself(problem, quick.mass)
    if not problem.plate.nonlinear:
        bent = [*_bent_statically(quick, problem.judge), *bent]
    if bent:
        bent = [
            f"beyond {problem.judge.deflection.shown}, {TOO_SOFT}; "
            f"{unsafe(curved=problem.judge.curved)}",
            *bent,
        ]
    remarks: dict[str, str] = {}
    if text := whole_plate(problem.symmetry.factor):
        remarks["symmetry"] = text
    if problem.damping:
        remarks["damping"] = "in the run only: the models without a mesh neglect DAMP"
    if problem.plate.is_preloaded:
        remarks["preload"] = "in the static plate and the run: the infinite plate neglects PREL"
    if problem.plate.is_curved:
        remarks["curvature"] = "in the static plate and the run: the infinite plate is flat"
    if (supports := problem.moving_plate.supports) is not None and supports.gap.any():
        remarks["gaps"] = "in the run only: the static plates leave out the gaps of UNIL"
    if problem.threshold is not None:
        words = from_threshold(problem.threshold.number)
        first = "; plies and interfaces may fail before" if words == AT_THE_LATEST else ""
        remarks["threshold"] = f"delamination {words} these forces and energies{first}"
    if searched:
        remarks["velocity"] = searched
    if quick.remark:
        remarks["stretching"] = quick.remark
    return Estimate(
        title=problem.deck.title,
        response=quick.response,
        mass_ratio=quick.mass_ratio,
        inelasticity=quick.parameter,
        stiffness=quick.stiffness,
        models={**_rows(quick), RUN: of_run},
        remarks=remarks,
        notes=(*bent, *doubts),
        units=unit_names(problem.deck),
    )


def _rows(quick: QuickEstimate) -> dict[str, ModelEstimate]:
    """Return the quick models by name."""
    return {
        model.name: ModelEstimate(
            model.impact.peak,
            model.impact.duration,
            model.threshold,
            model.velocity,
            0.5 * quick.mass * model.velocity**2,
            model.applies,
        )
        for model in quick.models
    }


def _run_itself(problem: Problem, mass: float) -> tuple[ModelEstimate, str, list[str], list[str]]:
    """Return the run itself, how its velocity was found, and notes.

    The notes are about its deflections, and about what is open in it.
    """
    result = carry_out_plan(problem, plan(problem, [{}]))
    swept, doubts = {"the run": result}, []
    threshold, velocity, searched = math.nan, math.nan, ""
    if problem.threshold is not None:
        threshold = problem.threshold.force
        at_threshold = carry_out_plan(problem, plan(problem, [{}], until=threshold))
        swept["the run at the threshold"] = at_threshold
        velocity = float(at_threshold["found_velocity"][0])
        if at_threshold.reduced is not None:
            (difference,) = at_threshold.reduced.difference("peak_force")
            searched = (
                f"of the run: by the reduced model, {difference:+.2%} from the force of a full run"
            )
    peak, duration = (float(result[name][0]) for name in ("peak_force", "contact_time"))
    if math.isnan(duration):
        doubts.append("the run ends before its contact does: what is open needs a longer duration")
    doubts += [
        f"{name}: {outcome['status'][0]}"
        for name, outcome in swept.items()
        if not outcome.completed.all()
    ]
    h, judge = problem.judge.thickness, problem.judge
    bent = [
        text
        for name, outcome in swept.items()
        for text in _bent(name, outcome[RATIO][0] * h, judge)
    ]
    energy = 0.5 * mass * velocity**2
    row = ModelEstimate(peak, duration, threshold, velocity, energy, applies=True)
    return row, searched, bent, doubts


def _bent_statically(quick: QuickEstimate, judge: Judge) -> list[str]:
    """Return notes about deflections of the static model."""
    static = quick.models[-1]
    return [
        *_bent("the static plate", static.impact.peak / quick.stiffness, judge),
        *_bent("the static plate at the threshold", static.threshold / quick.stiffness, judge),
    ]


def _bent(where: str, deflection: float, judge: Judge) -> list[str]:
    """Return a note about a deflection beyond the linear plate. A free plate has none (NaN)."""
    if not deflection > judge.largest(judge.deflection):
        return []
    ratio = deflection / judge.thickness
    return [f"{where} deflects by {ratio:.3g} h: {judge.softness(ratio)}"]
