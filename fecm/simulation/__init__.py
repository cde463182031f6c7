"""One program, from its problem to its result."""
