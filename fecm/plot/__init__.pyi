"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.plot.data import patches as patches
from fecm.plot.data import strain_points as strain_points
from fecm.plot.failure import NAMES as NAMES
from fecm.plot.failure import outline as outline
from fecm.plot.histories import force_fit_picture as force_fit_picture
from fecm.plot.kinds import KINDS as KINDS
from fecm.plot.kinds import MISSING as MISSING
from fecm.plot.kinds import Picture as Picture
from fecm.plot.kinds import PlotError as PlotError
from fecm.plot.kinds import Shows as Shows
from fecm.plot.location import location_picture as location_picture
from fecm.plot.mesh import Support as Support
from fecm.plot.mesh import support_masks as support_masks
from fecm.plot.pictures import draw as draw
from fecm.plot.pictures import draw_results as draw_results
from fecm.plot.pictures import save_picture as save_picture
from fecm.plot.plate import profile as profile
from fecm.plot.studies import dispersion_picture as dispersion_picture
from fecm.plot.studies import fronts_picture as fronts_picture
from fecm.plot.studies import indentation_fit_picture as indentation_fit_picture
from fecm.plot.studies import pulse_picture as pulse_picture
from fecm.plot.studies import rigidity_picture as rigidity_picture
from fecm.plot.studies import speeds_picture as speeds_picture
from fecm.plot.style import COLOURS as COLOURS
from fecm.plot.style import scale as scale
