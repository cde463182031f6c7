"""Constants of the indentation law from an indentation test (the report's chapter 3).

A test is a series of indentations and forces in the order of measurement.  `cycles` finds where
it turns, `curves` fits the loading, unloading and reloading curves, `permanent` the relation of
permanent to largest indentation, `constants` puts all together, and `report` tells it.
"""

# Unloading powers that are searched.
LIMITS_Q = (0.3, 12.0)
