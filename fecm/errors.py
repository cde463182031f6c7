"""Errors that public functions raise, by name: ``except fecm.errors.CasesError``.

All of them are :class:`FecmError`.
"""

from __future__ import annotations

from fecm._errors import FecmError, OptionsError, ResultFileError, StudyError
from fecm._extensions import ExtensionError
from fecm._files import NoFolderError, OutputError, OutputExistsError
from fecm._inputs import ContentError, InputError
from fecm._machine import NotEnoughMemoryError
from fecm._watch import StoppedError
from fecm.authoring.case import CasesError
from fecm.authoring.parameters import ObjectError
from fecm.deck.findings import DeckError
from fecm.deck.layup import LayupError
from fecm.deck.macros import RowsError
from fecm.deck.units import UnitsError
from fecm.exploration.plates import ExploreError
from fecm.identification.alignment import IdentifyError
from fecm.location.location import LocateError
from fecm.mechanics.failure import CriterionError
from fecm.mechanics.half_space import PlyError
from fecm.mechanics.own_law import LawError
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.points import OutsideError, PatchError
from fecm.mechanics.projectile import ProjectileError
from fecm.mechanics.reduced_plate import ReductionError
from fecm.mechanics.solutions import ConvergenceError, LiftedPlateError, SingularStiffnessError
from fecm.plot.kinds import LackingError, MatplotlibError, PlotError
from fecm.problem.estimates import NoCurveError
from fecm.problem.plate_mesh import MeshError
from fecm.problem.refine import RefineError
from fecm.problem.supports import NoLineError
from fecm.report.content import Jinja2Error, ReportError
from fecm.results.diff import IncomparableError
from fecm.results.groups import ExportError, NotStoredError, ResultWriteError
from fecm.simulation.checkpoint import CheckpointError
from fecm.sweeps.execute import SchedulerError
from fecm.sweeps.partial_results import DamagedPartError, OtherSweepError
from fecm.sweeps.reduced import MisfitError
from fecm.verification import UnknownCaseError

__all__ = [
    "CasesError",
    "CheckpointError",
    "ContentError",
    "ConvergenceError",
    "CriterionError",
    "DamagedPartError",
    "DeckError",
    "DivergenceError",
    "ExploreError",
    "ExportError",
    "ExtensionError",
    "FecmError",
    "IdentifyError",
    "IncomparableError",
    "InputError",
    "Jinja2Error",
    "LackingError",
    "LawError",
    "LayupError",
    "LiftedPlateError",
    "LocateError",
    "MatplotlibError",
    "MeshError",
    "MisfitError",
    "NoCurveError",
    "NoFolderError",
    "NoLineError",
    "NotEnoughMemoryError",
    "NotStoredError",
    "ObjectError",
    "OptionsError",
    "OtherSweepError",
    "OutputError",
    "OutputExistsError",
    "OutsideError",
    "PatchError",
    "PlotError",
    "PlyError",
    "ProjectileError",
    "ReductionError",
    "RefineError",
    "ReportError",
    "ResultFileError",
    "ResultWriteError",
    "RowsError",
    "SchedulerError",
    "SingularStiffnessError",
    "StoppedError",
    "StudyError",
    "UnitsError",
    "UnknownCaseError",
    "UnsoundPlateError",
]
