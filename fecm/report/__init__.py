"""One HTML page about results, to hand on."""

from fecm._lazy import names_of_stub

__getattr__, __dir__ = names_of_stub(__name__, __file__)
