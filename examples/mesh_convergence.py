"""Convergence with the mesh
=========================

Peak force over the number of elements, under a patch of fixed radius. Under a point force it would
not converge.
"""

import fecm


def deck_of(case):
    """Return a plate of n x n elements under a disc of 6 mm radius."""
    n = round(case["elements"])
    return fecm.impact(
        fecm.Plate.rectangle((60, 60), (n, n), support="simple"),
        fecm.Laminate("[0/90]4s", "T300/5208", 0.125),
        fecm.RigidMass(1e-6),  # t
        fecm.Contact.estimate(radius=6),
        velocity=3000,
        duration=3e-4,
        every=50,
        patch="disc:6",
        units="mm-N-s",
    )


result = fecm.sweep(build=deck_of, vary={"elements": [10, 14, 20]})
peak = result["peak_force"]
for elements, force in zip(result["elements"], peak, strict=True):
    print(f"{elements:3.0f} elements a side: {force:.2f} N ({force / peak[-1] - 1:+.2%})")

ax = result.plot(quantity="peak_force")
ax.set(xlabel="Elements a side", ylim=(177, 178))
ax.figure.savefig("convergence.png")
