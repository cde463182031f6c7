"""Results of runs: in memory and in HDF5 files."""

from fecm._lazy import names_of_stub

__getattr__, __dir__ = names_of_stub(__name__, __file__)
