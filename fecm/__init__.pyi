"""Public names of fecm and their modules; ``__init__.py`` imports each when it is first used."""

from fecm import errors as errors
from fecm import examples as examples
from fecm._errors import FecmError as FecmError
from fecm._errors import FecmWarning as FecmWarning
from fecm._extensions import ExtensionError as ExtensionError
from fecm.api import DeckCheck as DeckCheck
from fecm.api import check as check
from fecm.api import read_one as read_one
from fecm.api import run as run
from fecm.api import run_one as run_one
from fecm.authoring.contact import Contact as Contact
from fecm.authoring.impact import impact as impact
from fecm.authoring.laminate import Laminate as Laminate
from fecm.authoring.plate import Plate as Plate
from fecm.deck.catalogue import contacts as contacts
from fecm.deck.catalogue import materials as materials
from fecm.deck.findings import DeckError as DeckError
from fecm.deck.model import Deck as Deck
from fecm.deck.model import Ply as Ply
from fecm.deck.reader import read_deck as read_deck
from fecm.identification.identify import Identification as Identification
from fecm.identification.identify import identify as identify
from fecm.location.locate import locate as locate
from fecm.location.location import LocateError as LocateError
from fecm.location.location import Location as Location
from fecm.location.location import load_location as load_location
from fecm.mechanics.contact_law import ContactPoint as ContactPoint
from fecm.mechanics.contact_law import Law as Law
from fecm.mechanics.failure import CriterionError as CriterionError
from fecm.mechanics.failure import FailureCriterion as FailureCriterion
from fecm.mechanics.failure import Strengths as Strengths
from fecm.mechanics.own_law import LawError as LawError
from fecm.mechanics.plate_motion import DivergenceError as DivergenceError
from fecm.mechanics.projectile import LinearProjectile as LinearProjectile
from fecm.mechanics.projectile import ProjectileError as ProjectileError
from fecm.mechanics.projectile import RigidMass as RigidMass
from fecm.mechanics.projectile import Rod as Rod
from fecm.problem.plate_mesh import MeshError as MeshError
from fecm.results.diff import assert_same as assert_same
from fecm.results.diff import diff as diff
from fecm.results.difference import Difference as Difference
from fecm.results.result import Result as Result
from fecm.results.result import load as load
from fecm.studies.indentation_test.study import fit_indentation as fit_indentation
from fecm.studies.rod_test.study import pulse_test as pulse_test
from fecm.studies.waves.study import waves as waves
from fecm.sweeps.api import sweep as sweep
from fecm.sweeps.estimate import estimate as estimate
from fecm.sweeps.mesh_error import MeshErrorEstimate as MeshErrorEstimate
from fecm.sweeps.mesh_error import mesh_error as mesh_error
from fecm.sweeps.result import SweepResult as SweepResult
from fecm.sweeps.result import load_sweep as load_sweep
from fecm.verification import verify as verify

__version__: str
__all__: list[str]
