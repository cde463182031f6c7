"""Results of runs: in memory and in HDF5 files."""
