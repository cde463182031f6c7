"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.identification.alignment import IdentifyError as IdentifyError
from fecm.identification.alignment import level as level
from fecm.identification.alignment import noise as noise
from fecm.identification.alignment import onset as onset
from fecm.identification.misfit import sign_runs as sign_runs
