"""The printed output: what the original program sent to its printer, in a readable layout.

PRIN and NOPR switch the echo of the mesh on and off, PAGE gives the carriage control at the head of
a page: ``1`` a new page (a form feed), ``0`` a blank line, ``-`` two of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.deck.macros import WORDS
from fecm.deck.model import (
    Boundary,
    Coordinates,
    Deck,
    Elements,
    Forces,
    Impact,
    Indentation,
    Material,
    Page,
    PrintOption,
    Segment,
)
from fecm.deck.records import DOF_NAMES
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import GENERALISED_STRAINS, RESULTANTS
from fecm.problem.build import build_constants

CARRIAGE = {"1": "\f", "0": "\n", "-": "\n\n"}


class Printer:
    """Writes the printed output of a run.

    Parameters
    ----------
    file : text file, optional
        Where to; without one nothing is printed.
    """

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = file
        self._title = ""
        self._control = "1"
        self._pages = 0

    @property
    def is_on(self) -> bool:
        """Whether anything is printed."""
        return self._file is not None

    def state(self) -> dict[str, Any]:
        """What was printed so far, and what the next page needs."""
        text = ""
        if self._file is not None:
            self._file.flush()
            text = Path(self._file.name).read_text(encoding="utf-8")
        return {
            "title": self._title, "control": self._control, "pages": self._pages, "text": text
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Print what :meth:`state` gave, and go on behind it."""
        self._title, self._control = state["title"], state["control"]
        self._pages = state["pages"]
        if self._file is not None:
            self._file.write(state["text"])

    def _write(self, lines: Iterable[str]) -> None:
        if self._file is not None:
            self._file.writelines(f"{line.rstrip()}\n" for line in lines)

    def _page(self, heading: str) -> None:
        """Begin a page: carriage control, title, heading."""
        head = CARRIAGE.get(self._control, "") if self._pages else ""
        self._pages += 1
        self._write([f"{head}{self._title}", "", f"  {heading}", ""])

    def _table(self, names: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """A table of right-aligned columns."""
        if self._file is not None:
            self._write(["  " + "".join(name.rjust(13) for name in names)])
            self._write("  " + "".join(_cell(value) for value in row) for row in rows)
            self._write([""])

    # Input ---------------------------------------------------------------------------------------

    def problem(self, deck: Deck, mesh: Mesh, plate: PlateModel) -> None:
        """Echo a problem: control, segments in the deck's order, equations, macro program."""
        if not self.is_on:
            return
        self._title = deck.title
        self._control_information(deck)
        echo = True
        for segment in deck.segments:
            if isinstance(segment, PrintOption):
                echo = segment.on
            elif isinstance(segment, Page):
                self._control = segment.carriage_control
            else:
                self._segment(segment, mesh, plate, echo)
        if echo:
            self._page("Equation numbers")
            self._nodes(mesh.equations)
        self._program(deck)

    def _control_information(self, deck: Deck) -> None:
        control = deck.control
        self._page("Control information")
        for name, value in (
            ("Nodes", control.numnp),
            ("Elements", control.numel),
            ("Layers", control.layers),
            ("Dimensions of space", control.ndm),
            ("Unknowns a node", control.ndf),
            ("Nodes an element, at the most", control.nen),
        ):
            self._write([f"  {name:32}{value:8d}"])
        self._write([""])

    def _segment(self, segment: Segment, mesh: Mesh, plate: PlateModel, echo: bool) -> None:
        """Echo one segment; mesh data only while echoing is on."""
        if isinstance(segment, Material):
            self._material(segment, plate)
        elif isinstance(segment, Indentation):
            self._page("Indentation law")
            law = build_constants(segment)
            for name, value in (
                ("Contact coefficient k", law.k),
                *(
                    [("Critical indentation alpha_cr", segment.alpha_p)]
                    if segment.word
                    else [
                        ("Critical indentation alpha_p", segment.alpha_p),
                        ("Constant s_p", segment.s_p),
                    ]
                ),
                ("Power of the unloading law q", law.q),
            ):
                self._write([f"  {name:32}{value:14.6g}"])
            self._write([""])
        elif isinstance(segment, Impact):
            self._page("Impact")
            self._write(
                [
                    f"  {'Node':32}{segment.node:8d}",
                    f"  {'Unknown':32}{segment.dof:8d} ({DOF_NAMES[segment.dof - 1]})",
                    f"  {'Approach velocity':32}{segment.velocity:14.6g}",
                    "",
                ]
            )
        elif not echo:
            return
        elif isinstance(segment, Coordinates):
            self._page("Nodal coordinates")
            rows = ((n, *place) for n, place in enumerate(mesh.coordinates.tolist(), start=1))
            self._table(("node", "x", "y"), rows)
        elif isinstance(segment, Elements):
            self._page("Elements")
            names = ("element", *(f"node {i + 1}" for i in range(mesh.elements.shape[1])))
            rows_ = ((n, *nodes) for n, nodes in enumerate(mesh.elements.tolist(), start=1))
            self._table(names, rows_)
        elif isinstance(segment, Boundary):
            self._page("Restraint codes")
            self._nodes(mesh.codes, only=(mesh.codes != 0).any(axis=1))
        elif isinstance(segment, Forces):
            self._page("Nodal forces and displacements")
            self._nodes(mesh.forces, only=(mesh.forces != 0).any(axis=1))

    def _nodes(self, values: NDArray[np.generic], only: NDArray[np.bool_] | None = None) -> None:
        """A table of every unknown of every node, or of some nodes."""
        chosen = np.arange(len(values)) if only is None else np.flatnonzero(only)
        self._table(("node", *DOF_NAMES), ((n + 1, *values[n].tolist()) for n in chosen.tolist()))

    def _material(self, material: Material, plate: PlateModel) -> None:
        ply, card, laminate = material.ply, material.integration, plate.laminate
        self._page("Material")
        self._write(
            [
                f"  {len(material.layers)} layers, total thickness {card.thickness:g}",
                f"  E1 {ply.e1:g}   E2 {ply.e2:g}   NU12 {ply.nu12:g}",
                f"  G12 {ply.g12:g}   G13 {ply.g13:g}   G23 {ply.g23:g}",
                f"  density {ply.density:g}",
                f"  Gauss orders L1 {card.bending}, L2 {card.shear}; stress points K {card.points}",
                "",
            ]
        )
        layers = (
            (n, layer.angle, layer.thickness) for n, layer in enumerate(material.layers, start=1)
        )
        self._table(("layer", "angle", "thickness"), layers)
        for name in ("A", "B", "D", "shear"):
            self._write([f"  {name}", *_matrix(getattr(laminate, name)), ""])

    def _program(self, deck: Deck) -> None:
        self._page("Macro program")
        depth = 0
        for macro in deck.macros:
            depth -= macro.word == "NEXT"
            value = f"{macro.value:g}" if macro.value else ""
            indent = "  " * max(0, depth)
            meaning = WORDS[macro.word].meaning if macro.word in WORDS else ""
            self._write([f"  {indent + macro.word:16}{value:>12}   {meaning}"])
            depth += macro.word == "LOOP"
        self._write([""])

    # Output --------------------------------------------------------------------------------------

    def displacements(self, field: Floats, time: float) -> None:
        """Displacements of every node."""
        if self.is_on:
            self._page(f"Nodal displacements at time {time:.6g}")
            self._nodes(field)

    def reactions(self, force: Floats, mesh: Mesh, time: float) -> None:
        """Forces of the supports, and the sum of all."""
        if self.is_on:
            self._page(f"Reactions at time {time:.6g}")
            supports = np.where(mesh.equations == 0, force, 0.0)
            largest = np.abs(supports).max(axis=1)
            self._nodes(supports, only=np.asarray(largest > 1e-12 * max(1.0, largest.max())))
            self._table(("sum", *DOF_NAMES[:3]), [("", *supports.sum(axis=0)[:3].tolist())])

    def stresses(
        self, values: Mapping[str, Floats], places: tuple[Floats, Floats], clock: float
    ) -> None:
        """Strains, and below each line the stress resultants, at every point."""
        if not self.is_on:
            return
        self._page(f"Element strains and stress resultants at time {clock:.6g}")
        x, y = places
        self._write(
            ["  " + "".join(f"{n:>13}" for n in ("element", "x", "y", *GENERALISED_STRAINS))]
        )
        self._write(["  " + " " * 39 + "".join(f"{n:>13}" for n in RESULTANTS)])
        for element in range(x.shape[0]):
            for point in range(x.shape[1]):
                at = (element, point)
                strains = (float(values[name][at]) for name in GENERALISED_STRAINS)
                head = (element + 1, float(x[at]), float(y[at]))
                self._write(["  " + "".join(_cell(v) for v in (*head, *strains))])
                resultants = "".join(_cell(float(values[name][at])) for name in RESULTANTS)
                self._write(["  " + " " * 39 + resultants])
        self._write([""])

    def modes(self, angular_frequency: Floats) -> None:
        """Natural frequencies."""
        if self.is_on:
            self._page("Natural modes")
            rows = (
                (n, omega**2, omega, omega / (2.0 * np.pi))
                for n, omega in enumerate(angular_frequency.tolist(), start=1)
            )
            self._table(("mode", "eigenvalue", "angular", "frequency"), rows)

    def check(self, plate: PlateModel, profile: int) -> None:
        """Mesh and storage."""
        if self.is_on:
            self._page("Mesh and storage")
            stored = plate.stiffness.nnz
            for name, value in (
                ("Equations", plate.neq),
                ("Entries of the profile, JDIAG(NEQ)", profile),
                ("Entries of the sparse stiffness", stored),
            ):
                self._write([f"  {name:36}{value:12d}"])
            self._write([f"  {'Area':36}{plate.area():12.6g}", ""])


def _cell(value: object) -> str:
    """A table's cell."""
    return f"{value:13.5g}" if isinstance(value, float) else str(value).rjust(13)


def _matrix(values: Floats) -> list[str]:
    return ["  " + "".join(_cell(value) for value in row) for row in values.tolist()]
