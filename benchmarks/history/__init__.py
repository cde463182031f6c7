"""Benchmarks over the history of the repository, for airspeed velocity."""
