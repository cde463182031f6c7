"""Public name of this room; it is imported when it is first used."""

from fecm.plot.pictures import draw_results as draw_results
