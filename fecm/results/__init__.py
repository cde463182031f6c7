"""Results of runs: in memory, in HDF5 files and on the printed program's tapes."""

from fecm._lazy import names_of_stub

__getattr__, __dir__ = names_of_stub(__name__, __file__)
