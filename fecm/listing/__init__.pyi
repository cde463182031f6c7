"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.listing.slips import LISTING as LISTING
from fecm.listing.slips import MODES as MODES
from fecm.listing.slips import NAMES as NAMES
from fecm.listing.slips import active_slips as active_slips
