"""Drop-weight impacts by fecm and by CalculiX, on the same mesh.

    python benchmarks/calculix.py [--longer FACTOR]

Needs the program `ccx` (Debian: calculix-ccx).  A mass falls on plates of IM7/8552 in the fixture
D7136.  Both programs have the same elements, supports, mass and contact law, and the force acts on
the node in the middle.  CalculiX has its shells S8R:

- Laminates are composite shells.  CalculiX 2.20 refuses springs and masses beside them ("changekon:
  element type unknown"), so that it computes the plate's response to a short pulse of force, and
  the impact follows from it here, by convolution.
- A plate of one layer is struck in CalculiX itself, by a mass on a nonlinear spring of 150 straight
  pieces, with and without NLGEOM.

Prints the table of docs/other-programs.md, with the processor times of both.  Takes some minutes.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from math import cos, radians, sin
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fecm
from fecm.deck import model

PLY = fecm.materials()["IM7/8552"]
MESH = (8, 6)  # elements of the window
# Length of the contact spring (mm), and the deepest indentation of its table.
SPRING, DEEPEST = 100.0, 0.4
DEFLECTION = 2  # column of w among the dofs of a node
Floats = NDArray[np.float64]


class Case(NamedTuple):
    """Angles and thickness (mm) of plies, mass (t) and energy (mJ), time step of CalculiX (s)."""

    name: str
    angles: tuple[int, ...]
    ply_thickness: float
    mass: float
    energy: float
    step: float
    nonlinear: bool = False


HALF = (45, 0, -45, 90) * 3
CASES = (
    Case("[45/0/-45/90]3s, 4.4 mm, 5.5 kg, 3 J", HALF + HALF[::-1], 0.184, 5.5e-3, 3000.0, 1e-5),
    Case("[0], 3 mm, 0.5 kg, 3 J", (0,), 3.0, 5e-4, 3000.0, 5e-6),
    Case("[0], 3 mm, 0.5 kg, 3 J, stretching", (0,), 3.0, 5e-4, 3000.0, 5e-6, nonlinear=True),
)


class Impact(NamedTuple):
    """Contact force (N) and deflection under the load (mm) over time (s), and processor time."""

    time: Floats
    force: Floats
    w: Floats
    seconds: float

    def __str__(self) -> str:
        top = int(self.force.argmax())
        end = float(self.time[self.force > 0.0][-1])
        return (
            f"{self.force[top]:9.1f} N at {self.time[top] * 1e3:.3f} ms{self.w.max():9.4f} mm"
            f"   contact to {end * 1e3:.3f} ms{self.seconds:9.2f} s"
        )


def deck_of(case: Case) -> fecm.Deck:
    """Return the impact as a deck of fecm; a plate that stretches slides on the window."""
    return fecm.impact(
        fecm.Plate.on_fixture("D7136", MESH),
        fecm.Laminate([float(angle) for angle in case.angles], PLY, case.ply_thickness),
        fecm.RigidMass(case.mass),
        fecm.Contact.estimate(radius=8),
        energy=case.energy,
        patch=None,
        nonlinear=case.nonlinear,
        units="mm-N-s",
    )


def processor_time(command: list[str], folder: Path) -> float:
    """Run a command on one thread and return its processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    one_thread = os.environ | {"OMP_NUM_THREADS": "1"}
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, env=one_thread)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def by_fecm(deck: fecm.Deck, folder: Path) -> tuple[Impact, fecm.Result]:
    """Run a deck in a process of its own."""
    (folder / "deck.inp").write_text(deck.to_text())
    run = [sys.executable, "-W", "ignore", "-m", "fecm", "run", "deck.inp", "-o", "deck.h5"]
    seconds = processor_time(run, folder)
    result = fecm.load(folder / "deck.h5")
    history = result.history
    return Impact(history["time"], history["force"], history["plate_w"], seconds), result


class Shells:
    """The plate of a result as shells of CalculiX."""

    def __init__(self, case: Case, result: fecm.Result) -> None:
        self.case = case
        self.nodes = np.asarray(result["mesh/coordinates"])[:, :2]
        self.elements = np.asarray(result["mesh/elements"])[:, :8]
        self.used = sorted({int(node) for node in self.elements.ravel()})
        held = np.asarray(result["mesh/equations"])[:, DEFLECTION] == 0
        self.held = [node for node in self.used if held[node - 1]]
        away = np.hypot(*(self.nodes - self.nodes.mean(axis=0)).T)
        self.middle = int(away.argmin()) + 1

    def cards(self) -> str:
        """Nodes, elements, supports and material."""
        text = "*NODE, NSET=ALL\n"
        for node in self.used:
            x, y = self.nodes[node - 1]
            text += f"{node},{x:.12g},{y:.12g},0.\n"
        text += "*ELEMENT, TYPE=S8R, ELSET=PLATE\n"
        for number, row in enumerate(self.elements, 1):
            text += f"{number},{','.join(str(int(node)) for node in row)}\n"
        text += "*NSET, NSET=WINDOW\n" + "".join(f"{node},\n" for node in self.held)
        return text + self.laminate() + f"*BOUNDARY\nWINDOW,3,3\n{self.middle},1,2\n"

    def laminate(self) -> str:
        """Return the ply as an orthotropic solid, and the layers with their axes."""
        ply = PLY.constants("mm-N-s")
        e1, e2, nu12 = ply["E1"], ply["E2"], ply["nu12"]
        g12, g13, g23 = ply["G12"], ply["G13"], ply["G23"]
        nu23 = e2 / (2.0 * g23) - 1.0
        text = "*MATERIAL, NAME=PLY\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"
        text += f"{e1},{e2},{e2},{nu12},{nu12},{nu23},{g12},{g13}\n{g23},293.\n"
        text += f"*DENSITY\n{ply['density']}\n"
        for angle in sorted(set(self.case.angles)):
            c, s = cos(radians(angle)), sin(radians(angle))
            text += f"*ORIENTATION, NAME=A{angle % 180}\n"
            text += f"{c:.12f},{s:.12f},0.,{-s:.12f},{c:.12f},0.\n"
        thickness = self.case.ply_thickness
        if len(self.case.angles) == 1:
            (angle,) = self.case.angles
            only = f"MATERIAL=PLY, ORIENTATION=A{angle % 180}"
            return f"{text}*SHELL SECTION, ELSET=PLATE, {only}\n{thickness}\n"
        text += "*SHELL SECTION, ELSET=PLATE, COMPOSITE\n"
        return text + "".join(f"{thickness},,PLY,A{angle % 180}\n" for angle in self.case.angles)

    def run(self, cards: str, output: list[int], folder: Path) -> tuple[Floats, Floats, float]:
        """Run cards that end in a dynamic step: times, w of nodes (times, nodes), seconds."""
        printed = "*NSET, NSET=PRINTED\n" + "".join(f"{node},\n" for node in output)
        ending = "*NODE PRINT, NSET=PRINTED\nU\n*END STEP\n"
        (folder / "shell.inp").write_text(self.cards() + printed + cards + ending)
        seconds = processor_time(["ccx", "shell"], folder)
        rows: dict[float, dict[int, float]] = {}
        time = 0.0
        for line in (folder / "shell.dat").read_text().splitlines():
            if "time" in line:
                time = float(line.split()[-1])
            elif line.strip():
                node, *moved = line.split()
                rows.setdefault(time, {})[int(node)] = float(moved[DEFLECTION])
        w = np.array([[row[node] for node in output] for row in rows.values()])
        return np.array(list(rows)), w, seconds


def struck_in_calculix(
    shells: Shells, velocity: float, k: float, step: float, duration: float, folder: Path
) -> Impact:
    """Impact by a mass on a nonlinear spring, which pushes as the contact law does."""
    mass = len(shells.nodes) + 1
    x, y = shells.nodes[shells.middle - 1]
    spring, point = len(shells.elements) + 1, len(shells.elements) + 2
    text = f"*NODE\n{mass},{x:.12g},{y:.12g},{-SPRING}\n"
    text += f"*ELEMENT, TYPE=SPRINGA, ELSET=CONTACT\n{spring},{mass},{shells.middle}\n"
    text += f"*ELEMENT, TYPE=MASS, ELSET=PROJECTILE\n{point},{mass}\n"
    text += f"*MASS, ELSET=PROJECTILE\n{shells.case.mass}\n"
    text += "*SPRING, ELSET=CONTACT, NONLINEAR\n\n"
    for depth in DEEPEST * np.linspace(1.0, 0.0, 151) ** 1.5:
        text += f"{-k * depth**1.5:.12g},{-depth:.12g},293.\n"
    text += f"0.,{SPRING},293.\n*BOUNDARY\n{mass},1,2\n"
    text += f"*INITIAL CONDITIONS, TYPE=VELOCITY\n{mass},3,{velocity}\n"
    text += f"*STEP, INC=100000{', NLGEOM' if shells.case.nonlinear else ''}\n"
    text += f"*DYNAMIC, DIRECT, ALPHA=0.\n{step},{duration}\n"
    time, w, seconds = shells.run(text, [shells.middle, mass], folder)
    plate, projectile = w.T
    force = k * np.maximum(projectile - plate, 0.0) ** 1.5
    return Impact(time, force, plate, seconds)


def by_response(
    shells: Shells, velocity: float, k: float, step: float, duration: float, folder: Path
) -> Impact:
    """Impact from the plate's response to a triangular pulse of 1 N, two steps wide."""
    text = f"*AMPLITUDE, NAME=HAT\n0.,0.,{step},1.,{2 * step},0.,1.,0.\n"
    text += f"*STEP, INC=100000\n*DYNAMIC, DIRECT, ALPHA=0.\n{step},{duration}\n"
    text += f"*CLOAD, AMPLITUDE=HAT\n{shells.middle},3,1.\n"
    time, w, seconds = shells.run(text, [shells.middle], folder)
    response = w[:, 0]  # response[i] is w at (i + 1) steps after the pulse begins
    force, plate = np.zeros(len(time)), np.zeros(len(time))
    travel, speed, mass = 0.0, velocity, shells.case.mass
    for n in range(len(time)):
        before = force[n - 1] if n else 0.0
        memory = float(force[:n] @ response[1 : n + 1][::-1]) if n else 0.0
        low, high = 0.0, 1e6
        while high - low > 1e-6:  # the force for which indentation and law agree
            trial = 0.5 * (low + high)
            moved = travel + step * speed - step**2 / 6.0 * (2.0 * before + trial) / mass
            depth = moved - memory - trial * response[0]
            low, high = (trial, high) if k * max(depth, 0.0) ** 1.5 > trial else (low, trial)
        force[n] = low
        plate[n] = memory + low * response[0]
        travel += step * speed - step**2 / 6.0 * (2.0 * before + low) / mass
        speed -= 0.5 * step * (before + low) / mass
    return Impact(time, force, plate, seconds)


def main() -> None:
    """Run every case by both programs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--longer", type=float, default=1.0, help="factor of CalculiX's time steps")
    longer = parser.parse_args().longer
    for case in CASES:
        strike = struck_in_calculix if len(case.angles) == 1 else by_response
        with tempfile.TemporaryDirectory() as place:
            deck = deck_of(case)
            ours, result = by_fecm(deck, Path(place))
            velocity = deck.require(model.Impact).velocity
            k = deck.require(model.Indentation).k
            shells, end = Shells(case, result), float(ours.time[-1])
            theirs = strike(shells, velocity, k, longer * case.step, end, Path(place))
        print(f"{case.name}\n  fecm      {ours}\n  CalculiX  {theirs}", flush=True)


if __name__ == "__main__":
    main()
