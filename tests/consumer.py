"""Code of a user, for the type checkers: it is not run.

Lines with an ``ignore`` must fail in both checkers; an ``ignore`` without an error is an error.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import xarray
from matplotlib.axes import Axes
from numpy.typing import NDArray

import fecm

result: fecm.Result = fecm.run_one("plate.inp", mode="report", solver="csr")
force: NDArray[np.float64] = result.force
late: NDArray[np.float64] = result.tape3.time[result.tape3.step > 10]
worst: float = float(result.failure.puck.exposure.max())
title: str = result.title
doubts: tuple[str, ...] = result.notes
peak: float = result.peak_force + result.metrics.peak_force + result.metrics["impulse"]
unit_of_peak: str = result.metrics.unit("peak_force")
several: fecm.Result | list[fecm.Result] = fecm.run(Path("plates.inp"))
deck: fecm.Deck = fecm.read_one("plate.inp")
again: fecm.Result = fecm.run_one(deck, progress=lambda step, steps: print(step / steps))
axes: Axes = result.plot("loop", ax=result.plot("force"), against="displacement")
similarity: float = result.compare("shot-3.csv").correlation
discrete: fecm.PlateModel = fecm.plate_model(deck)
nodes: NDArray[np.float64] = discrete.field(discrete.nodal_loads / discrete.mass)
checked: fecm.DeckCheck = fecm.check(deck, "listing")
codes: list[str] = [finding.code for finding in checked.errors]
critical: list[float] = [problem.critical_time_step for problem in checked.problems]
stiffness: NDArray[np.float64] = checked.problems[0].D
of_mesh: fecm.MeshErrorEstimate = fecm.mesh_error(deck, progress=lambda step, steps: None)
apart: fecm.Difference = fecm.diff("a.h5", result, 1e-6, tol={"tape8": 1e-5, "energy": (0, 1)})
where: int | None = apart.datasets[0].at.step if apart.datasets[0].at else None
fecm.assert_same(result, Path("trusted.h5"), rtol=1e-6, only="history")
verified: bool = all(row.within for row in fecm.verify("isotropic-ply"))
result.export("plate.vtkhdf", overwrite=True)
sweep: fecm.SweepResult = fecm.sweep(deck, {"velocity": [1.0, 2.0]}, workers=2)
pooled: fecm.SweepResult = fecm.sweep(deck, {"k": [1e6]}, executor=ThreadPoolExecutor())
measured: fecm.SweepResult = fecm.sweep(
    build=lambda case: deck, vary={"width": [1.0]}, measure=lambda r: {"w": r.plate_w.max()}
)
fecm.assert_same(sweep, "sweep.h5")
sweep.export("forces.csv", "history")
tabled: fecm.SweepResult = fecm.sweep(deck, cases=sweep.to_dataframe())
reopened: fecm.SweepResult = fecm.load_sweep("sweep.h5")
changed: tuple[fecm.Deck, ...] = (result.deck.with_(velocity=3.0), reopened.deck)
replaced: fecm.Result = fecm.run_one(deck, output=Path("plate.h5"), overwrite=True)
names: list[str] = [*result.keys(), *result.history, *sweep.keys(), result.unit("force")]
columns: dict[str, NDArray[np.float64]] = dict(result.history)
ended: NDArray[np.bool_] = sweep.completed & ~sweep.still_in_contact & sweep.contact_over
peaks: xarray.DataArray = sweep.to_xarray().peak_force
drawn: fecm.SweepResult = fecm.sweep(
    deck,
    random={"k": "lognormal:1.9e6,0.15"},
    samples=4096,
    seed=0,
    design="sobol",
    sensitivity=True,
    exceed={"peak_force": [500.0]},
)


class Measured:
    """A law with the quantiles of three measured values."""

    def ppf(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return quantiles."""
        return np.quantile([1.8e6, 1.9e6, 2.1e6], probabilities)


joint: fecm.SweepResult = fecm.sweep(
    deck,
    random={"k": Measured(), "e1": "weibull:140e3,20", "e2": "truncnormal:9e3,5e2,0,2e4"},
    correlation={("e1", "e2"): 0.6},
    samples=16,
)
matched: fecm.SweepResult = fecm.sweep(
    deck, random={"k": "normal:1e6,1e5", "q": "uniform:2,3"}, correlation=np.eye(2), samples=16
)
if drawn.random is not None:
    mean: float = float(drawn.random.statistics["peak_force"].mean)
    first: NDArray[np.float64] = drawn.random.sensitivity["peak_force"].first_interval
    chance: NDArray[np.float64] = drawn.random.exceedance.probability
    scattered: Axes = drawn.plot("scatter", quantity="peak_force")
plate: fecm.Plate = fecm.Plate.from_mesh("plate.msh", {"rim": "clamped"})
ply: fecm.Ply = fecm.Ply(1.6e-9, 0.3, 140e3, 9e3, 5e3, 5e3, 3e3)
laminates: list[fecm.Laminate] = [fecm.Laminate(x, ply, 0.2) for x in ("[0/90]s", [0, 45.0])]
rods: tuple[fecm.Rod | fecm.RigidMass, ...] = (fecm.RigidMass(1e-3),)
made: fecm.Deck = fecm.impact(
    fecm.Plate.rectangle((100, 80), (10, 8), support="simple", edges={"top": "free"}),
    laminates[0],
    rods[0],
    fecm.Contact.estimate(8.0),
    energy=500.0,
    duration=1e-3,
    units="mm-N-s",
    plies=(20, 4),
    failure=True,
).with_(velocity=3.0, layup="[0/90]2s")
angles: NDArray[np.float64] = np.array([1e-5, 45.0])
turned: fecm.Deck = made.with_(layup=angles, projectile=rods[0], contact=fecm.Contact(k=1e5))
other: fecm.Deck = made.with_(plate=plate, laminate=laminates[1], at=(30, 20), energy="10J")
stored: fecm.Deck = turned.with_program(every=5, plies=True, failure=10)
modes: fecm.Deck = stored.with_program("LMAS\nEIGE,,3")


class Linear:
    """A contact law without memory."""

    def start(self) -> None:
        """No memory."""

    def trial(
        self, memory: None, last: fecm.ContactPoint, indentation: float
    ) -> tuple[float, None]:
        """A spring."""
        return max(1e5 * indentation, 0.0), None

    def accept(self, memory: None, last: fecm.ContactPoint, indentation: float) -> None:
        """No memory."""

    def permanent(self, memory: None, last: fecm.ContactPoint) -> float:
        """The law is elastic."""
        return 0.0 * last.force


class TwoMasses:
    """A projectile."""

    def mass(self) -> list[float]:
        """Both masses."""
        return [1e-4, 2e-4]

    def stiffness(self) -> NDArray[np.float64]:
        """A spring between them."""
        return 1e5 * np.array([[1.0, -1.0], [-1.0, 1.0]])


def fibre_stress(
    ply: fecm.Strengths,
    s1: NDArray[np.float64],
    s2: NDArray[np.float64],
    tau: NDArray[np.float64],
) -> dict[str, NDArray[np.float64]]:
    """A failure criterion."""
    return {"fibre tension": s1 / ply.xt, "fibre compression": -s1 / ply.xc}


law: fecm.Law = Linear()
own: fecm.Result = fecm.run_one(
    deck, law=law, projectile=TwoMasses(), criteria=[fibre_stress, "norris"]
)
of_law: fecm.SweepResult = fecm.sweep(deck, {"velocity": [1.0]}, law="bilinear")
fit: fecm.Identification = fecm.identify(deck, own.time, own.force, "velocity", law=law)
place: fecm.Location = fecm.locate(deck, "strains.csv", noise=1e-6, region=(0.0, 0.0, 1.0, 1.0))
around: NDArray[np.float64] = fecm.load_location("located.h5").ellipse(0.95)
quick: float = fecm.estimate(deck).models["run"].peak_force
speeds: NDArray[np.float64] = fecm.waves(laminates[0], units="mm-ms-kg").fronts([0.0]).velocity
fitted: fecm.Contact | None = fecm.fit_indentation("test.csv", units=("mm", "N")).law
struck: NDArray[np.float64] = fecm.pulse_test(deck, (force, force), stations=[0.5]).forces
modulus: float | None = fecm.materials()["IM7/8552"].value("E1", "mm-ms-kg")
coefficient: float = fecm.contacts()["report-0.5"].converted("mm-N-s").k

result.plot("forse")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
result.forse  # type: ignore[attr-defined]  # pyright: ignore[reportAttributeAccessIssue]  # noqa: B018
result.metrics.peak_forse  # type: ignore[attr-defined]  # pyright: ignore[reportAttributeAccessIssue]  # noqa: B018
result.tape3.u  # type: ignore[attr-defined]  # pyright: ignore[reportAttributeAccessIssue]  # noqa: B018
several.force  # type: ignore[union-attr]  # pyright: ignore[reportAttributeAccessIssue]  # noqa: B018
fecm.run_one("plate.inp", mode="raport")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.run_one("plate.inp", solver="gpu")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.sweep(deck, {"velocity": 5.0})  # type: ignore[dict-item]  # pyright: ignore[reportArgumentType]
fecm.sweep(deck, random={"k": 3.0}, samples=16)  # type: ignore[dict-item]  # pyright: ignore[reportArgumentType]
fecm.sweep(deck, correlation={"e1": 0.6})  # type: ignore[dict-item]  # pyright: ignore[reportArgumentType]
fecm.sweep(deck, until="treshold")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.sweep(deck, {"k": [1e6]}, executor=2)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
result.export("plate.vtu", to="vtu")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.diff(deck, result)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.runn("plate.inp")  # type: ignore[attr-defined]  # pyright: ignore[reportAttributeAccessIssue]
fecm.Plate.from_mesh("plate.msh", {"rim": 5})  # type: ignore[dict-item]  # pyright: ignore[reportArgumentType]
fecm.run_one(deck, law=TwoMasses())  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.run_one(deck, projectile=law)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.run_one(deck, criteria=[law])  # type: ignore[list-item]  # pyright: ignore[reportArgumentType]
fecm.pulse_test(deck, "sine:1,1", integrator="euler")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
fecm.impact(plate, laminates[0], 5.0)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
made.with_(velosity=3.0)  # type: ignore[call-arg]  # pyright: ignore[reportCallIssue]
made.with_(projectile=5.0)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
made.with_(support="glued")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
made.with_program(ply=20)  # type: ignore[call-arg]  # pyright: ignore[reportCallIssue]
