"""Parameters of the contact law from an indentation test (report, chapter 3).

A test is a series of indentations and forces in the order of measurement.  `cycles` finds its
turning points, `curves` fits the loading, unloading and reloading curves, `permanent` fits the
relation of permanent to largest indentation, `constants` combines them, and `report` formats them.
"""

# Bounds of the unloading power.
LIMITS_Q = (0.3, 12.0)
