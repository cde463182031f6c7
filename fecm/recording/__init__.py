"""From the states of a run to the rows of its result."""
