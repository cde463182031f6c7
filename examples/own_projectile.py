"""A projectile of your own
========================

A head on a spring, in front of a carriage: the impactor of a drop tower whose head is mounted
softly. Any object with a mass and a stiffness matrix is a :class:`projectile
<fecm.LinearProjectile>`; the first dof is the end that touches the plate. With the soft spring the
head strikes alone at first, and the carriage follows.
"""

import fecm
from fecm.plot.pictures import draw_results


class SpringMounted:
    """A head and a carriage with a spring between them; lbf, in, s."""

    head, carriage = 2e-5, 4e-5  # lbf s^2/in

    def __init__(self, spring):
        self.spring = spring  # lbf/in

    def mass(self):
        return [self.head, self.carriage]

    def stiffness(self):
        return [[self.spring, -self.spring], [-self.spring, self.spring]]


deck = fecm.read_one(fecm.examples.path("impact-patch.inp"))
results = {}
for name, spring in {"rigid": 1e7, "mounted": 1e4}.items():
    result = results[name] = fecm.run_one(deck, projectile=SpringMounted(spring))
    stored = result.energy.projectile_strain.max()
    print(f"{name}: {result.force.max():.1f} lbf, up to {stored:.3f} lbf in in the spring")
draw_results("force", results, "projectiles.png")
