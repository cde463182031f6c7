"""Pages to hand on
================

A report is one HTML file about a run, a sweep, a random sweep, a fit, or a location. These are
seven of them: the report's experiment, a drop-weight test, a map, a table of tests, a probability,
a contact law from a measured force, and an impact that strain gages located.
"""

from dataclasses import replace

import numpy as np

import fecm

report = fecm.examples.path("impact-patch.inp")
measured = fecm.examples.path("measured-force.csv")
drop, held = (  # the deck's title has one energy
    replace(fecm.read_one(fecm.examples.path(name)), title="ASTM D7136, 5.5 kg")
    for name in ("drop-weight.inp", "drop-weight-held.inp")
)
panel = fecm.examples.path("panel-with-gages.inp")
laws = {"velocity": "normal:1300,60", "k": "lognormal:42000,0.2"}
grid = {"velocity": [600, 900, 1200, 1500, 1800], "k": [2e4, 3e4, 4e4, 6e4]}
threshold = {"peak_force": "threshold"}
time, force = np.loadtxt(measured, delimiter=",", skiprows=3, unpack=True)
pages = {
    "report-deck": fecm.run_one(report),
    "drop-weight": fecm.run_one(drop),
    "map": fecm.sweep(held, grid),
    "tests": fecm.sweep(held, cases=fecm.examples.path("tests.csv")),
    "random": fecm.sweep(held, random=laws, samples=64, exceed=threshold),
    "identification": fecm.identify(report, time, force, ["k", "velocity"]),
    "location": fecm.locate(panel, fecm.examples.path("panel-strains.csv"), grid=40.0),
}
for name, result in pages.items():
    result.report(f"{name}.html", overwrite=True)
