"""Parameters of the contact law from an indentation test (report, chapter 3).

A test is a series of indentations and forces in the order of measurement. `turns` reads it and
finds its turning points. `curves` fits the loading, unloading and reloading curves, and the
relation of permanent to largest indentation. `constants` fits all parameters and formats them.
"""
