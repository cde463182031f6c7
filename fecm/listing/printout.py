"""The printed output of the original program, in a readable layout.

PRIN and NOPR switch the echo of the mesh on and off.  PAGE sets the carriage control at the head of
a page: ``1`` for a new page (a form feed), ``0`` for a blank line, ``-`` for two blank lines.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.macros import WORDS
from fecm.deck.material_cards import MATERIAL
from fecm.deck.mesh_cards import DOF_NAMES
from fecm.deck.model import Macro
from fecm.mechanics.contact_law import ACR_POWER
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import GENERALISED_STRAINS, RESULTANTS

CARRIAGE = {"1": "\f", "0": "\n", "-": "\n\n"}


class Printer:
    """Writer of a run's printed output.  It prints nothing without a file."""

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
        """Return the text printed so far, and the head of the next page."""
        text = ""
        if self._file is not None:
            self._file.flush()
            text = Path(self._file.name).read_text(encoding="utf-8")
        return {"head": (self._title, self._control, self._pages), "text": text}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Print the text of a :meth:`state` again, and restore the head of the next page."""
        self._title, self._control, self._pages = state["head"]
        if self._file is not None:
            self._file.write(state["text"])

    def _write(self, lines: Iterable[str]) -> None:
        if self._file is not None:
            self._file.writelines(f"{line.rstrip()}\n" for line in lines)

    def _page(self, heading: str, lines: Iterable[str] = ()) -> None:
        """Start a page with carriage control, title and heading, then print lines on it."""
        head = CARRIAGE.get(self._control, "") if self._pages else ""
        self._pages += 1
        self._write([f"{head}{self._title}", "", f"  {heading}", ""])
        self._write(lines)

    def _table(self, names: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Print a table of right-aligned columns."""
        self._write(map(_row, itertools.chain([names], rows, [()])))

    def problem(self, deck: model.Deck, mesh: MeshArrays, plate: PlateModel) -> None:
        """Echo a problem: control, segments in the deck's order, equations, macro program."""
        if not self.is_on:
            return
        self._title = deck.title
        control = deck.control
        counts = {
            "Nodes": control.numnp,
            "Elements": control.numel,
            "Layers": control.layers,
            "Dimensions of space": control.ndm,
            "Dofs per node": control.ndf,
            "Largest number of nodes": control.nen,
        }
        self._page("Control information", _values(counts))
        echo = True
        for segment in deck.segments:
            match segment:
                case model.PrintOption():
                    echo = segment.on
                case model.Page():
                    self._control = segment.carriage_control
                case _:
                    self._segment(segment, mesh, plate, echo)
        self._other_materials(deck, plate)
        if echo:
            self._page("Equation numbers")
            self._nodes(mesh.equations)
        self._program(deck.macros)

    def replaced(self, parts: Mapping[str, str]) -> None:
        """Print the names of the parts that replace parts of the deck."""
        if self.is_on and parts:
            self._page("In place of the deck's", _values(parts))

    def _program(self, macros: Iterable[Macro]) -> None:
        """Echo the macro program with indented loops."""
        self._page("Macro program")
        depth = 0
        for macro in macros:
            depth -= macro.word == "NEXT"
            value = f"{macro.value:g}" if macro.value else ""
            word = "  " * max(0, depth) + macro.word
            meaning = WORDS[macro.word].meaning if macro.word in WORDS else ""
            self._write([f"  {word:16}{value:>12}   {meaning}"])
            depth += macro.word == "LOOP"
        self._write([""])

    def _segment(
        self, segment: model.Segment, mesh: MeshArrays, plate: PlateModel, echo: bool
    ) -> None:
        """Echo one segment.  Mesh data are printed only while the echo is on."""
        match segment:
            case model.Material():
                self._material(segment, plate)
            case model.Indentation():
                self._indentation(segment)
            case model.Impact():
                dof = f"{segment.dof:8d} ({DOF_NAMES[segment.dof - 1]})"
                values: dict[str, float | str] = {
                    "Node": segment.node,
                    "Dof": dof,
                    "Approach velocity": segment.velocity,
                }
                self._page("Impact", _values(values))
            case model.Coordinates() if echo:
                self._page("Nodal coordinates")
                self._table(("node", "x", "y"), _numbered(mesh.coordinates))
            case model.Elements() if echo:
                names = (f"node {i + 1}" for i in range(mesh.elements.shape[1]))
                self._page("Elements")
                self._table(("element", *names), _numbered(mesh.elements))
            case model.Boundary() if echo:
                self._page("Restraint codes")
                self._nodes(mesh.codes, only=(mesh.codes != 0).any(axis=1))
            case model.Forces() if echo:
                self._page("Nodal forces and displacements")
                self._nodes(mesh.forces, only=(mesh.forces != 0).any(axis=1))

    def _indentation(self, segment: model.Indentation) -> None:
        values: dict[str, float | str] = {"Contact coefficient k": segment.k}
        if segment.word:
            values["Critical indentation alpha_cr"] = segment.alpha_p
        else:
            values["Critical indentation alpha_p"] = segment.alpha_p
            values["Constant s_p"] = segment.s_p
        values["Power of the unloading law q"] = ACR_POWER if segment.word else segment.q
        self._page("Indentation law", _values(values))

    def _nodes(self, values: NDArray[np.generic], only: NDArray[np.bool_] | None = None) -> None:
        """Print a table of all dofs of all nodes, or of the nodes marked by `only`."""
        chosen = np.arange(len(values)) if only is None else np.flatnonzero(only)
        self._table(("node", *DOF_NAMES), ((n + 1, *values[n].tolist()) for n in chosen.tolist()))

    def _material(self, material: model.Material, plate: PlateModel) -> None:
        ply, card = material.ply, material.integration
        lines = [
            f"  {len(material.layers)} layers, total thickness {card.thickness:g}",
            f"  E1 {ply.e1:g}   E2 {ply.e2:g}   NU12 {ply.nu12:g}",
            f"  G12 {ply.g12:g}   G13 {ply.g13:g}   G23 {ply.g23:g}",
            f"  density {ply.density:g}",
            f"  Gauss orders L1 {card.bending}, L2 {card.shear}; stress points K {card.points}",
            "",
        ]
        self._page("Material", lines)
        self._laminate(material.layers, plate.laminate)

    def _other_materials(self, deck: model.Deck, plate: PlateModel) -> None:
        """Print the materials and laminates that MATE does not define."""
        if (card := deck.last(model.Materials)) is not None:
            names = [field.label for field in model.Ply.fields]
            self._page("Other materials")
            rows = ((material.number, *map(float, material.ply.row())) for material in card.plies)
            self._table(("material", *names), rows)
        (_, *other_layers), (_, *laminates) = deck.layers.items(), plate.laminates
        for (number, layers), laminate in zip(other_layers, laminates, strict=True):
            self._page(f"Laminate {number}")
            self._laminate(layers, laminate)

    def _laminate(self, layers: Sequence[model.Layer], laminate: LaminateSection) -> None:
        """Print the layers and the stiffness of a laminate."""
        several = any(layer.material != MATERIAL for layer in layers)
        header = ("layer", "angle", "thickness", *(["material"] if several else []))
        rows = (
            (n, layer.angle, layer.thickness, *([layer.material] if several else []))
            for n, layer in enumerate(layers, start=1)
        )
        self._table(header, rows)
        for name in ("A", "B", "D", "shear"):
            self._write([f"  {name}", *map(_row, getattr(laminate, name).tolist()), ""])

    def displacements(self, field: Floats, time: float) -> None:
        """Print the displacements of every node."""
        self._page(f"Nodal displacements at time {time:.6g}")
        self._nodes(field)

    def reactions(self, force: Floats, mesh: MeshArrays, time: float) -> None:
        """Print the forces of the supports and their sum."""
        supports = np.where(mesh.equations == 0, force, 0.0)
        largest = np.abs(supports).max(axis=1)
        self._page(f"Reactions at time {time:.6g}")
        self._nodes(supports, only=np.asarray(largest > 1e-12 * max(1.0, largest.max())))
        self._table(("sum", *DOF_NAMES[:3]), [("", *supports.sum(axis=0)[:3].tolist())])

    def stresses(
        self, values: Mapping[str, Floats], places: tuple[Floats, Floats], clock: float
    ) -> None:
        """Print the strains at every point, each line followed by the stress resultants."""
        strains = [*places, *(values[name] for name in GENERALISED_STRAINS)]
        resultants = [values[name] for name in RESULTANTS]

        def rows() -> Iterator[Sequence[object]]:
            yield "", "", "", *RESULTANTS
            for point in np.ndindex(places[0].shape):
                yield point[0] + 1, *(float(column[point]) for column in strains)
                yield "", "", "", *(float(column[point]) for column in resultants)

        self._page(f"Element strains and stress resultants at time {clock:.6g}")
        self._table(("element", "x", "y", *GENERALISED_STRAINS), rows())

    def modes(self, angular_frequency: Floats) -> None:
        """Print the natural frequencies."""
        omega = angular_frequency
        rows = np.column_stack([omega**2, omega, omega / (2.0 * np.pi)])
        self._page("Natural modes")
        self._table(("mode", "eigenvalue", "angular", "frequency"), _numbered(rows))

    def check(self, plate: PlateModel, profile: int) -> None:
        """Print the size of the mesh and of the stored matrices."""
        values = {
            "Equations": f"{plate.neq:12d}",
            "Entries of the profile, JDIAG(NEQ)": f"{profile:12d}",
            "Entries of the sparse stiffness": f"{plate.stiffness.nnz:12d}",
            "Area": f"{plate.area():12.6g}",
        }
        self._page("Mesh and storage", _values(values, width=36))


def _values(values: Mapping[str, float | str], width: int = 32) -> list[str]:
    """Format names and values, one pair a line, and a blank line."""
    formats = {int: "8d", float: "14.6g", str: ""}
    lines = [f"  {name:{width}}{value:{formats[type(value)]}}" for name, value in values.items()]
    return [*lines, ""]


def _numbered(rows: NDArray[np.generic]) -> Iterator[Sequence[object]]:
    """Prefix the rows of a table with their numbers, from 1."""
    return ((n, *row) for n, row in enumerate(rows.tolist(), start=1))


def _row(values: Iterable[object]) -> str:
    """Format a line of right-aligned cells."""
    cells = (f"{v:13.5g}" if isinstance(v, float) else str(v).rjust(13) for v in values)
    return "  " + "".join(cells)
