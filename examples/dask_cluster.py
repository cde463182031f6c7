"""Sweeps on a Dask cluster
========================

Two sweeps by one Dask client, which stays yours: the second sweep refines the map of the first
where the force reaches 100 lbf. Needs Dask: ``pip install 'fecm[examples]'``.
"""

import numpy as np
from distributed import Client

import fecm

deck = fecm.examples.path("impact-patch.inp")
# Two threads of this process; ``Client("tcp://192.0.2.1:8786")`` is a cluster of your own.
with Client(processes=False, n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
    coarse = fecm.sweep(deck, {"velocity": np.linspace(80, 180, 6)}, scheduler=client)
    first = int(np.argmax(coarse["peak_force"] >= 100))
    near = np.linspace(*coarse["velocity"][first - 1 : first + 1], 9)
    fine = fecm.sweep(deck, {"velocity": near}, scheduler=client)
    print(f"the client is {client.status}")

for result in (coarse, fine):
    case = int(np.argmax(result["peak_force"] >= 100))
    print(f"{result['peak_force'][case]:.2f} lbf at {result['velocity'][case]:g} in/s")
