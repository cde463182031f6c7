"""The printed program of the report: its slips, what they change, and its printed output."""

from fecm._lazy import names_of_stub

__getattr__, __dir__ = names_of_stub(__name__, __file__)
