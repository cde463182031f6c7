"""Parameters of the contact law from an indentation test (report, chapter 3).

A test is a series of indentations and forces in the order of measurement, which `measured` reads.
`turns` finds its turning points, `curves` fits the loading, unloading and reloading curves,
`permanent` the relation of permanent to largest indentation, and `constants` all parameters;
`output` shows them.  `modulus` computes k without a test.
"""
