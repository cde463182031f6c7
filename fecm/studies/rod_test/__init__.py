"""The instrumented rod."""
