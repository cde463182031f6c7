"""fecm: low-velocity impact on laminated composite plates, from the decks of NASA CR-168057.

>>> import fecm
>>> result = fecm.run_one("decks/appendix.inp")  # doctest: +SKIP
>>> result.force.shape  # doctest: +SKIP
(10,)
"""

from __future__ import annotations

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

from fecm import examples
from fecm._errors import FecmError, FecmWarning
from fecm._version import __version__

if TYPE_CHECKING:
    from fecm import errors
    from fecm._extensions import ExtensionError
    from fecm.api import DeckCheck, check, read_one, run, run_one
    from fecm.authoring.contact import Contact
    from fecm.authoring.impact import impact
    from fecm.authoring.laminate import Laminate
    from fecm.authoring.plate import Plate
    from fecm.deck.catalogue import contacts, materials
    from fecm.deck.findings import DeckError
    from fecm.deck.model import Deck, Ply
    from fecm.deck.reader import read_deck
    from fecm.identification.identify import Identification, identify
    from fecm.location.locate import locate
    from fecm.location.location import LocateError, Location, load_location
    from fecm.mechanics.contact_law import ContactPoint, Law
    from fecm.mechanics.failure import CriterionError, FailureCriterion, Strengths
    from fecm.mechanics.own_law import LawError
    from fecm.mechanics.plate_motion import DivergenceError
    from fecm.mechanics.projectile import LinearProjectile, ProjectileError, RigidMass, Rod
    from fecm.problem.plate_mesh import MeshError
    from fecm.results.diff import assert_same, diff
    from fecm.results.difference import Difference
    from fecm.results.result import Result, load
    from fecm.studies.indentation_test.study import fit_indentation
    from fecm.studies.rod_test.study import pulse_test
    from fecm.studies.waves.study import waves
    from fecm.sweeps.api import sweep
    from fecm.sweeps.estimate import estimate
    from fecm.sweeps.mesh_error import MeshErrorEstimate, mesh_error
    from fecm.sweeps.result import SweepResult, load_sweep
    from fecm.verification import verify

__all__ = [
    "Contact",
    "ContactPoint",
    "CriterionError",
    "Deck",
    "DeckCheck",
    "DeckError",
    "Difference",
    "DivergenceError",
    "ExtensionError",
    "FailureCriterion",
    "FecmError",
    "FecmWarning",
    "Identification",
    "Laminate",
    "Law",
    "LawError",
    "LinearProjectile",
    "LocateError",
    "Location",
    "MeshError",
    "MeshErrorEstimate",
    "Plate",
    "Ply",
    "ProjectileError",
    "Result",
    "RigidMass",
    "Rod",
    "Strengths",
    "SweepResult",
    "__version__",
    "assert_same",
    "check",
    "contacts",
    "diff",
    "errors",
    "estimate",
    "examples",
    "fit_indentation",
    "identify",
    "impact",
    "load",
    "load_location",
    "load_sweep",
    "locate",
    "materials",
    "mesh_error",
    "pulse_test",
    "read_deck",
    "read_one",
    "run",
    "run_one",
    "sweep",
    "verify",
    "waves",
]

if not TYPE_CHECKING:  # type checkers know the names from the imports above
    # Module of each name, and its name there.  They are imported on first access: `import fecm`
    # takes 20 ms, and 900 ms with all of them.
    _HOMES = {
        "Contact": ("fecm.authoring.contact", "Contact"),
        "ContactPoint": ("fecm.mechanics.contact_law", "ContactPoint"),
        "CriterionError": ("fecm.mechanics.failure", "CriterionError"),
        "Deck": ("fecm.deck.model", "Deck"),
        "DeckCheck": ("fecm.api", "DeckCheck"),
        "DeckError": ("fecm.deck.findings", "DeckError"),
        "Difference": ("fecm.results.difference", "Difference"),
        "DivergenceError": ("fecm.mechanics.plate_motion", "DivergenceError"),
        "ExtensionError": ("fecm._extensions", "ExtensionError"),
        "FailureCriterion": ("fecm.mechanics.failure", "FailureCriterion"),
        "Identification": ("fecm.identification.identify", "Identification"),
        "Laminate": ("fecm.authoring.laminate", "Laminate"),
        "Law": ("fecm.mechanics.contact_law", "Law"),
        "LawError": ("fecm.mechanics.own_law", "LawError"),
        "LinearProjectile": ("fecm.mechanics.projectile", "LinearProjectile"),
        "LocateError": ("fecm.location.location", "LocateError"),
        "Location": ("fecm.location.location", "Location"),
        "MeshError": ("fecm.problem.plate_mesh", "MeshError"),
        "MeshErrorEstimate": ("fecm.sweeps.mesh_error", "MeshErrorEstimate"),
        "Plate": ("fecm.authoring.plate", "Plate"),
        "Ply": ("fecm.deck.model", "Ply"),
        "ProjectileError": ("fecm.mechanics.projectile", "ProjectileError"),
        "Result": ("fecm.results.result", "Result"),
        "RigidMass": ("fecm.mechanics.projectile", "RigidMass"),
        "Rod": ("fecm.mechanics.projectile", "Rod"),
        "Strengths": ("fecm.mechanics.failure", "Strengths"),
        "SweepResult": ("fecm.sweeps.result", "SweepResult"),
        "assert_same": ("fecm.results.diff", "assert_same"),
        "check": ("fecm.api", "check"),
        "contacts": ("fecm.deck.catalogue", "contacts"),
        "diff": ("fecm.results.diff", "diff"),
        "estimate": ("fecm.sweeps.estimate", "estimate"),
        "fit_indentation": ("fecm.studies.indentation_test.study", "fit_indentation"),
        "identify": ("fecm.identification.identify", "identify"),
        "impact": ("fecm.authoring.impact", "impact"),
        "load": ("fecm.results.result", "load"),
        "load_location": ("fecm.location.location", "load"),
        "load_sweep": ("fecm.sweeps.result", "load"),
        "locate": ("fecm.location.locate", "locate"),
        "materials": ("fecm.deck.catalogue", "materials"),
        "mesh_error": ("fecm.sweeps.mesh_error", "mesh_error"),
        "pulse_test": ("fecm.studies.rod_test.study", "pulse_test"),
        "read_deck": ("fecm.deck.reader", "read_deck"),
        "read_one": ("fecm.api", "read_one"),
        "run": ("fecm.api", "run"),
        "run_one": ("fecm.api", "run_one"),
        "sweep": ("fecm.sweeps.api", "sweep"),
        "verify": ("fecm.verification", "verify"),
        "waves": ("fecm.studies.waves.study", "waves"),
    }

    def __getattr__(name):
        """Import a public name on first access."""
        if name == "errors":
            return _import_module("fecm.errors")
        if name not in _HOMES:
            raise AttributeError(f"module 'fecm' has no attribute {name!r}")
        module, own = _HOMES[name]
        return getattr(_import_module(module), own)


def __dir__() -> list[str]:
    return __all__
