"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.listing.law import ListingLaw as ListingLaw
from fecm.listing.slips import LISTING as LISTING
from fecm.listing.slips import MODES as MODES
from fecm.listing.slips import NAMES as NAMES
from fecm.listing.slips import Mode as Mode
from fecm.listing.slips import active_slips as active_slips
from fecm.listing.tapes import fortran_number as fortran_number
from fecm.listing.tapes import read_tapes as read_tapes
from fecm.listing.tapes import tape_texts as tape_texts
from fecm.listing.tapes import write_tapes as write_tapes
from fecm.listing.variant import MISREAD_DENSITY as MISREAD_DENSITY
from fecm.listing.variant import PlateVariant as PlateVariant
from fecm.listing.variant import Variant as Variant
from fecm.listing.variant import variant_of as variant_of
