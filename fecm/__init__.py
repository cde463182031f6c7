"""fecm: low-velocity impact on laminated composite plates, from the decks of NASA CR-168057.

>>> import fecm
>>> result = fecm.run_one("decks/appendix.inp")  # doctest: +SKIP
>>> result.force.shape  # doctest: +SKIP
(10,)
"""

from __future__ import annotations

from fecm import _methods
from fecm._errors import FecmError as FecmError
from fecm._errors import FecmWarning as FecmWarning
from fecm._lazy import names_of_stub as _names_of_stub
from fecm._version import __version__ as __version__

_methods.FUNCTIONS.update(
    {
        "Deck.with_": ("fecm.authoring.changes", "with_values"),
        "Deck.with_program": ("fecm.deck.reader", "with_program"),
        "Result.plot": ("fecm.plot.pictures", "draw_results"),
        "Result.report": ("fecm.report.report", "write_report"),
    }
)

__getattr__, __dir__ = _names_of_stub(__name__, __file__)
