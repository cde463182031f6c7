"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.location.fit import Errors as Errors
from fecm.location.fit import LocationFit as LocationFit
from fecm.location.fit import PlaceTrial as PlaceTrial
from fecm.location.fit import judged_force as judged_force
from fecm.location.location import Candidate as Candidate
from fecm.location.model import Footprint as Footprint
from fecm.location.model import Sampling as Sampling
from fecm.location.model import moving_plate as moving_plate
from fecm.location.model import responses as responses
from fecm.location.model import rows_of as rows_of
from fecm.location.prepare import shared_symmetry as shared_symmetry
from fecm.location.table import strain_table as strain_table
