"""Results: what a run gives, in memory, in HDF5 and as the program's own tapes."""
