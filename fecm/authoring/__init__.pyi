"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.authoring.case import Case as Case
from fecm.authoring.case import CasesError as CasesError
from fecm.authoring.case import check_deck as check_deck
from fecm.authoring.mesh import InPlane as InPlane
from fecm.authoring.parameters import ObjectError as ObjectError
from fecm.authoring.parameters import in_units as in_units
from fecm.authoring.plate import Support as Support
from fecm.authoring.strike_values import Strike as Strike
from fecm.authoring.strike_values import strike_of as strike_of
from fecm.authoring.time_values import with_time_step as with_time_step
from fecm.authoring.values import NAMES as NAMES
from fecm.authoring.values import VARIABLES as VARIABLES
from fecm.authoring.values import Changes as Changes
from fecm.authoring.values import apply_case as apply_case
from fecm.authoring.values import strike_of_case as strike_of_case
