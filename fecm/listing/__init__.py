"""The printed program of the report: its slips, what they change, its printed output and tapes."""

from fecm._lazy import names_of_stub

__getattr__, __dir__ = names_of_stub(__name__, __file__)
