"""Parameters of the contact law from an indentation test (report, chapter 3).

A test is a series of indentations and forces in the order of measurement.  `curves` finds its
turning points and fits the loading, unloading and reloading curves, `constants` the relation of
permanent to largest indentation and all parameters, and formats them.
"""
