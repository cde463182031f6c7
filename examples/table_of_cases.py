"""Cases in a table
================

A DataFrame of pandas, with a column per value and a row per impact, is swept; the results are a
DataFrame too. Needs pandas: ``pip install 'fecm[examples]'``.
"""

import pandas as pd

import fecm

tests = pd.DataFrame(
    {
        "specimen": ["A1", "A2", "A3", "B1", "B2"],
        "layup": ["[0/45/0/-45/0]2s"] * 3 + ["[0/90/0/90/0]2s"] * 2,
        "velocity": [90.0, 115.0, 140.0, 90.0, 140.0],  # in/s
    }
).set_index("specimen")

result = fecm.sweep(fecm.examples.path("impact-patch.inp"), cases=tests)
columns = ["peak_force", "contact_time", "energy_absorbed", "status"]
results = tests.join(result.to_dataframe()[columns].set_index(tests.index))
print(results.to_string())

# %%
# From here on it is pandas: the ratio of force to velocity by layup.
ratio = results["peak_force"] / results["velocity"]
print(ratio.groupby(results["layup"]).mean().to_string(float_format="{:.4f} lbf s/in".format))
