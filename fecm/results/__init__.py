"""Results of runs: in memory, in HDF5 files and on the printed program's tapes."""
