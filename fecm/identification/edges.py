"""Stiffness of the edges of a plate from measured natural frequencies: a tap test.

Springs along edges resist the rotation across them (kr, moment per rotation and length) and w (kw,
force per length and deflection).  Their stiffness minimises the squares of the differences of ln f
over ln k, from the best of starts over five decades.  With unit modal mass,

    d omega^2/dk = phi^T dK/dk phi.

The trial values share a basis of shapes (Ritz): modes of the plate for some stiffnesses, of the
plate without these springs, and of the plate with rigid ones.  The modes of the whole plate at each
optimum are added to the basis until both agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated, NamedTuple, TypedDict

import numpy as np

from fecm._errors import OptionsError
from fecm._table import Row, ShownNumber, Table, html_table, text_lines
from fecm._text import significant
from fecm._typing import Bools, Floats, Indices
from fecm.deck.grid import EDGES, ON_SPRINGS, RESTRAINTS, EdgeStiffness
from fecm.deck.model import NodeValues, Springs
from fecm.deck.units import MODULUS, column_name, in_si, uncertain, unit_names, unit_of
from fecm.identification.alignment import IdentifyError
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import MeshArrays, extent
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.projectile import CONSISTENT, LUMPED, MassMatrix
from fecm.mechanics.solutions import modes, tangent_stiffness
from fecm.mechanics.supports import NodeSupports
from fecm.mechanics.symmetry import with_codes
from fecm.problem.loading import AnyDeck
from fecm.problem.problem import Problem
from fecm.problem.supports import SAME_PLACE, NoLineError, line_weights
from fecm.problem.symmetry import symmetry_lines
from fecm.studies.modes import FrequenciesJson, problem_of_modes

KR, KW = "kr", "kw"
DIMENSIONS = {KR: "force", KW: MODULUS}
OUTSIDE = 0.02  # of a frequency beyond what any edge stiffness gives, above which it is refused
RESOLUTION = 1e-3  # of a frequency: smaller misfits are chance, or less than the error of the mesh
DECADES = np.logspace(-1.0, 3.0, 5)  # starts, over the scale of a stiffness
RANGE = 1e-5, 1e7  # of the values, over their scale
AGREEMENT = 1e-6  # of the frequencies of the basis and of the whole plate
MOST_ROUNDS = 6  # in which the basis grows
INDEPENDENT = 1e-8  # least singular value of a basis, over the largest
# What holds the edges, without kw and with it.
SIMPLE, ALONE = "on springs; w and the rotation along them held", "on springs alone"
SPARE = 2  # modes of the basis beside those that are fitted


class FittedStiffness(NamedTuple):
    """Fitted stiffness of edges.

    Attributes
    ----------
    name : str
        ``"kr"`` or ``"kw"``.
    value : float
        The stiffness, or its bound.
    error : float
        Standard error; NaN for a bound, and where there are as many frequencies as parameters.
    bound : str
        ``">"`` or ``"<"`` if no frequency feels the value beyond this bound; empty otherwise.
    unit : str
        Unit of the value; empty if the deck names none.
    """

    name: str
    value: float
    error: float
    bound: str
    unit: str

    def __str__(self) -> str:
        if self.bound:
            return f"{self.bound} {significant(self.value, 2)} {self.unit}".rstrip()
        if math.isnan(self.error):
            return f"{significant(self.value)} {self.unit}".rstrip()
        return uncertain(self.value, self.error, self.unit)


class FittedModeJson(TypedDict):
    """Measured and computed frequency in JSON."""

    number: int
    measured: float
    computed: float


class StiffnessJson(TypedDict):
    """Fitted stiffness in JSON."""

    name: str
    value: float
    error: Annotated[float, "Standard error; NaN for a bound."]
    bound: Annotated[str, "> or < if the value is a bound; empty otherwise."]
    unit: str


class EdgeFitJson(FrequenciesJson):
    """Fit of edge stiffness in JSON."""

    edges: list[str]
    stiffness: list[StiffnessJson]
    misfit: Annotated[float, "Root mean square of ln f measured over computed."]
    correlation: Annotated[float | None, "Of ln kr and ln kw; null unless both have values."]
    modes: list[FittedModeJson]
    cards: Annotated[list[str], "Lines of a SPRI segment with the values."]


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """Stiffness of edges from measured frequencies; ``str()`` is the page of the command.

    Attributes
    ----------
    title : str
        Title of the deck.
    edges : tuple of str
        The edges, which share the stiffness.
    stiffness : tuple of FittedStiffness
        The fitted values.
    misfit : float
        Root mean square of the differences of ln f.
    correlation : float
        Of ln kr and ln kw; NaN unless both have values.
    number : tuple of int
        Numbers of the modes.
    measured, computed : ndarray (n,)
        Frequencies.
    frequency_unit : str
        ``"Hz"`` if the deck's unit of time is known.
    cards : tuple of str
        Lines of a SPRI segment with the values; empty if all are bounds.
    units : dict of str to str
        Names of the deck's units; empty if it states none.
    """

    title: str
    edges: tuple[str, ...]
    stiffness: tuple[FittedStiffness, ...]
    misfit: float
    correlation: float
    number: tuple[int, ...]
    measured: Floats
    computed: Floats
    frequency_unit: str
    cards: tuple[str, ...]
    units: dict[str, str]

    def to_dict(self) -> EdgeFitJson:
        """Return plain values, as `fecm modes --measured --format json` prints them."""
        fitted: list[FittedModeJson] = [
            {"number": n, "measured": measured, "computed": computed}
            for n, measured, computed in self._modes()
        ]
        stiffness: list[StiffnessJson] = [
            {"name": k.name, "value": k.value, "error": k.error, "bound": k.bound, "unit": k.unit}
            for k in self.stiffness
        ]
        return {
            "title": self.title,
            "units": self.units,
            "frequency_unit": self.frequency_unit,
            "edges": [*self.edges],
            "stiffness": stiffness,
            "misfit": self.misfit,
            "correlation": None if math.isnan(self.correlation) else self.correlation,
            "modes": fitted,
            "cards": [*self.cards],
        }

    def _modes(self) -> Iterator[tuple[int, float, float]]:
        return zip(self.number, self.measured.tolist(), self.computed.tolist(), strict=True)

    def _tables(self) -> tuple[Table, Table]:
        """Return a table of the values, and a table of the modes."""
        has_kw = any(k.name == KW for k in self.stiffness)
        rows: list[Row] = [("edges", ", ".join(self.edges)), ("", ALONE if has_kw else SIMPLE)]
        rows += [(k.name, str(k)) for k in self.stiffness]
        rows.append(("misfit", f"{self.misfit:.2%}"))
        if not math.isnan(self.correlation):
            rows.append(("correlation", f"{self.correlation:.2f}"))
        modes_of_fit = tuple(
            (
                ShownNumber(n, str(n)),
                ShownNumber(measured, significant(measured, 6)),
                ShownNumber(computed, significant(computed, 6)),
                ShownNumber(computed / measured - 1.0, f"{computed / measured - 1.0:+.2%}"),
            )
            for n, measured, computed in self._modes()
        )
        header = (
            "mode",
            column_name("measured", self.frequency_unit),
            column_name("computed", self.frequency_unit),
            "difference",
        )
        return Table(tuple(rows), title=self.title or "(no title)"), Table(modes_of_fit, header)

    def __str__(self) -> str:
        values, fitted = self._tables()
        lines = [*text_lines(values, 13), "", *text_lines(fitted)]
        return "\n".join([values.title, *(f"  {line}".rstrip() for line in lines), "", *self.cards])

    def _repr_html_(self) -> str:
        """Return tables of the values and the modes, for notebooks."""
        return html_table(*self._tables())


def fit_edges(
    deck: AnyDeck,
    measured: Sequence[float],
    free: Sequence[str] = (KR,),
    *,
    edges: Sequence[str] = EDGES,
    of: Sequence[int] = (),
    mass: MassMatrix = LUMPED,
) -> EdgeFit:
    """Fit the stiffness of edges to measured natural frequencies of a rectangular plate.

    The edges share the values. Springs replace what the deck has there: with kr alone an edge holds
    w and the rotation along it, as a simple support does; with kw all rotations along it are free.
    A value that no frequency feels is a bound.

    Parameters
    ----------
    deck : str, Path, file or Deck
        Deck with a single problem. It needs no projectile and no macro program.
    measured : sequence of float
        Frequencies, ascending; in Hz if the deck names a known unit of time.
    free : sequence of str
        ``"kr"``, the moment per rotation across an edge and length, and ``"kw"``, the force per
        deflection and length.
    edges : sequence of str
        Some of left, right, bottom and top.
    of : sequence of int
        Numbers of the modes that were measured, ascending. By default they are the first ones.
    mass : {"lumped", "consistent"}
        Mass matrix.

    Returns
    -------
    EdgeFit
        Values with standard errors. With few frequencies they are widened by Student's factor: two
        of them hold 95 %.

    Raises
    ------
    DeckError
        If the deck has errors.
    OptionsError
        If the deck does not have exactly one problem, or an argument is not valid.
    IdentifyError
        If no stiffness gives a frequency, the plate is not a rectangle, or an edge is held as a
        line of symmetry is.

    Examples
    --------
    >>> import fecm
    >>> fit = fecm.fit_edges("plate.inp", [363.4, 598.4, 880.7, 1020.3])  # doctest: +SKIP
    """
    number = tuple(of) or tuple(range(1, len(measured) + 1))
    _check_arguments(measured, free, edges, of)
    problem = problem_of_modes(deck, max(number), mass=mass)
    units = unit_names(problem.deck)
    second = in_si("time", units)
    plate = ElasticPlate(
        problem, [n for n in DIMENSIONS if n in free], edges, max(number), mass == CONSISTENT
    )
    frequencies = np.asarray(measured, dtype=float)
    omega = 2.0 * np.pi * frequencies * (1.0 if second is None else second)
    fit = _Fit(plate, omega, np.array(number) - 1)
    solution = fit.solve()
    frequency_unit = "Hz" if second is not None else unit_of("1/time", units)
    values = {k.name: k.value for k in solution.stiffness if not k.bound}
    return EdgeFit(
        title=problem.deck.title,
        edges=tuple(edges),
        stiffness=tuple(
            k._replace(unit=unit_of(DIMENSIONS[k.name], units)) for k in solution.stiffness
        ),
        misfit=solution.misfit,
        correlation=solution.correlation,
        number=number,
        measured=frequencies,
        computed=frequencies * np.exp(-solution.residual),
        frequency_unit=frequency_unit,
        cards=tuple(plate.cards(values)),
        units=units,
    )


def _check_arguments(
    measured: Sequence[float], free: Sequence[str], edges: Sequence[str], of: Sequence[int]
) -> None:
    """Raise OptionsError if an argument is not valid."""
    for given, known, what in ((free, DIMENSIONS, "free"), (edges, EDGES, "edges")):
        if not given or len(set(given)) < len(given) or not set(given) <= set(known):
            raise OptionsError(f"{what} is {', '.join(given)}; choose from {', '.join(known)}")
    if not all(0.0 < f < math.inf for f in measured) or list(measured) != sorted(measured):
        raise OptionsError("measured frequencies are positive and ascend")
    if len(measured) < len(free):
        raise OptionsError(
            f"{len(free)} parameters need as many frequencies, and better more; "
            f"measured has {len(measured)}"
        )
    is_valid = list(of) == sorted(set(of)) and all(n >= 1 for n in of)
    if of and (len(of) != len(measured) or not is_valid):
        raise OptionsError("of has the number of the mode of each frequency, ascending, from 1")


class Edge(NamedTuple):
    """Edge of a rectangular plate: a line of element sides."""

    name: str
    nodes: Indices  # from 0
    weights: Floats  # (n,): length that each node stands for
    ends: tuple[int, int]  # nodes from 1


def edges_of(mesh: MeshArrays) -> dict[str, Edge]:
    """Return the edges of a rectangular plate, by name.

    Raises IdentifyError if the outline is not a rectangle along x and y.
    """
    low, high = extent(mesh.coordinates[mesh.used])
    near = SAME_PLACE * float((high - low).max())
    edges = {}
    for name, axis, place in zip(EDGES, (0, 0, 1, 1), (low, high, low, high), strict=True):
        on_edge = mesh.used & (np.abs(mesh.coordinates[:, axis] - place[axis]) <= near)
        nodes = np.flatnonzero(on_edge)
        along = mesh.coordinates[nodes, 1 - axis]
        first, last = (int(nodes[n]) + 1 for n in (along.argmin(), along.argmax()))
        whole = float((high - low)[1 - axis])
        try:
            rows, weights = line_weights(mesh, first, last)
        except NoLineError:
            rows, weights = nodes, np.zeros(len(nodes))
        if abs(weights.sum() - whole) > near:
            raise IdentifyError(
                f"the {name} side of the plate is not a straight edge over its whole length: the "
                "edges of rectangles along x and y have a stiffness to fit"
            )
        edges[name] = Edge(name, rows, weights, (first, last))
    return edges


class ElasticPlate:
    """Plate whose edges have springs of trial stiffness; `names` are the parameters."""

    def __init__(
        self,
        problem: Problem,
        names: Sequence[str],
        edges: Sequence[str],
        count: int,
        consistent: bool,
    ) -> None:
        from scipy import sparse

        self.names, self.count, self.consistent = list(names), count + SPARE, consistent
        self._control = problem.deck.control
        all_edges = edges_of(problem.mesh)
        for line in symmetry_lines(problem.deck, problem.mesh):
            name = EDGES[2 * line.axis + line.is_high]
            if name in edges:
                raise IdentifyError(
                    f"the {name} edge is held as a line of symmetry is: name the other edges"
                )
        self._edges = [all_edges[name] for name in edges]
        self.plate = self._supported(problem.plate, all_edges)
        if self.count > self.plate.neq:
            raise IdentifyError(f"the mesh has too few dofs for mode {count}: refine it")
        free = self.plate.mesh.equations > 0
        lengths = {name: self._lengths(name) for name in self.names}
        self.D = np.array([lengths[name][free] for name in self.names])  # (p, neq): dK/dk
        self.K = tangent_stiffness(self.plate, None)
        mass = self.plate.mass
        self.M = self.plate.consistent_mass if consistent else sparse.diags_array(mass).tocsr()
        rigidity = float(np.abs(problem.laminate.D).max())
        side = math.sqrt(problem.plate.area())
        scales = {KR: rigidity / side, KW: math.pi**4 * rigidity / side**3}
        self.scale = np.array([scales[name] for name in self.names])

    def _supported(self, plate: PlateModel, edges: Mapping[str, Edge]) -> PlateModel:
        """Return the plate whose edges hold what springs do not."""
        restraint = RESTRAINTS[ON_SPRINGS if KW in self.names else "simple"]
        chosen = [edge.name for edge in self._edges]
        kept = [edge.nodes for name, edge in edges.items() if name not in chosen]
        nodes = np.unique(np.concatenate([edge.nodes for edge in self._edges]))
        released = np.setdiff1d(nodes, np.concatenate([[-1], *kept]))
        codes = plate.mesh.codes.copy()
        codes[released, W:] = 0
        for edge in self._edges:
            codes[edge.nodes, W:] |= np.array(restraint.of(edge.name), dtype=codes.dtype)
        bare = with_codes(plate, codes)
        if (supports := plate.supports) is None:
            return bare
        replaced = np.isin(supports.node, released)
        is_free = codes[supports.node, supports.dof] == 0
        return replace(bare, supports=supports.select(~replaced & is_free))

    def _lengths(self, name: str) -> Floats:
        """Return the lengths of the edges at the dofs of a stiffness, (numnp, 5)."""
        lengths = np.zeros(self.plate.mesh.equations.shape)
        for edge in self._edges:
            lengths[edge.nodes, self._dof(name, edge)] += edge.weights
        return lengths

    def _dof(self, name: str, edge: Edge) -> int:
        """Return the dof of an edge that a stiffness resists."""
        unit = EdgeStiffness(float(name == KW), float(name == KR))
        return int(np.flatnonzero(unit.along_y() if edge.name in EDGES[:2] else unit.along_x())[0])

    def whole(self, k: Floats) -> tuple[Floats, Floats]:
        """Return squares of frequencies and shapes, (n, neq), at a stiffness; infinite is rigid."""
        rigid = np.isinf(k)
        stiffness = np.where(rigid, 0.0, k) @ self.D
        held = (self.D[rigid] > 0.0).any(axis=0)
        free = self.plate.mesh.equations > 0
        codes = self.plate.mesh.codes.copy()
        codes[free] = np.where(held, 1, codes[free])
        plate = with_codes(self.plate, codes)
        node, dof = np.nonzero(self.plate.field(np.where(held, 0.0, stiffness), 0.0))
        zeros = np.zeros(len(node))
        values = self.plate.field(stiffness, 0.0)[node, dof]
        springs = NodeSupports(node, dof, zeros, values, zeros)
        kept = plate.supports
        if kept is not None:
            springs = kept.select(codes[kept.node, kept.dof] == 0).joined(springs)
        plate = replace(plate, supports=springs)
        natural = modes(plate, self.count, consistent=self.consistent)
        shapes = np.array([plate.field(shape, 0.0)[free] for shape in natural.shapes])
        return natural.angular_frequency**2, shapes

    def cards(self, values: Mapping[str, float]) -> Iterator[str]:
        """Yield the lines of a SPRI segment with values of the edges."""
        if not values:
            return
        records = []
        for edge in self._edges:
            stiffness = [0.0] * 5
            for name, value in values.items():
                stiffness[self._dof(name, edge)] = float(f"{value:.4g}")
            records.append(NodeValues(*edge.ends, tuple(stiffness)))
        yield from Springs(tuple(records), word="LINE").cards(self._control)


class RitzBasis:
    """Stiffness and mass of a plate in shapes that its trial values share."""

    def __init__(self, plate: ElasticPlate, shapes: Floats) -> None:
        from scipy import linalg

        lengths = np.sqrt(np.einsum("ij,ij->i", shapes, shapes))
        left, sizes, _ = linalg.svd((shapes / lengths[:, None]).T, full_matrices=False)
        B = left[:, sizes > INDEPENDENT * sizes[0]]
        self.K, self.M = B.T @ (plate.K @ B), B.T @ (plate.M @ B)
        self.D = np.array([(B.T * d) @ B for d in plate.D])

    def frequencies(self, k: Floats, which: Indices) -> tuple[Floats, Floats]:
        """Return ln omega of modes, (n,), and their derivatives by ln k, (n, p)."""
        from scipy import linalg

        values, vectors = linalg.eigh(self.K + np.tensordot(k, self.D, 1), self.M)
        squares, shapes = np.maximum(values[which], 1e-300), vectors[:, which]
        slopes = np.einsum("in,pij,jn->np", shapes, self.D, shapes) * k
        return 0.5 * np.log(squares), 0.5 * slopes / squares[:, None]


class _Solution(NamedTuple):
    """Fitted values, in the order of the parameters."""

    stiffness: list[FittedStiffness]
    residual: Floats  # (n,): ln of measured over computed frequencies
    misfit: float
    correlation: float


class _Fit:
    """Least squares of ln omega over ln k of an elastic plate; `which` are numbers from 0."""

    def __init__(self, plate: ElasticPlate, omega: Floats, which: Indices) -> None:
        self.plate, self.which, self.measured = plate, which, np.log(omega)
        p = len(plate.names)
        self._least, self._most = (np.log(plate.scale * share) for share in RANGE)
        limits = [plate.whole(np.full(p, end)) for end in (0.0, np.inf)]
        self._refuse_outside(*(np.sqrt(squares[which]) for squares, _ in limits))
        trials = [plate.scale * np.array(s) for s in product(DECADES[::2], repeat=p)]
        self._shapes = [shapes for _, shapes in (*limits, *map(plate.whole, trials))]
        self.basis = RitzBasis(plate, np.concatenate(self._shapes))

    def _refuse_outside(self, least: Floats, most: Floats) -> None:
        """Raise IdentifyError if no edge stiffness gives a frequency."""
        omega = np.exp(self.measured)
        for n, value, low, high in zip(self.which + 1, omega, least, most, strict=True):
            if value < (1.0 - OUTSIDE) * low or value > (1.0 + OUTSIDE) * high:
                end, place = (low, "below the one without springs")
                if value > high:
                    end, place = (high, "above the one of rigid edges")
                raise IdentifyError(
                    f"the frequency of mode {n} is {abs(value / end - 1.0):.1%} {place}: no edge "
                    "stiffness gives it; check the density, the moduli, the size and the number of "
                    "the mode"
                )

    def solve(self) -> _Solution:
        """Return the best values; those that no frequency feels are bounds."""
        p = len(self.plate.names)
        starts = [np.log(self.plate.scale * np.array(s)) for s in product(DECADES, repeat=p)]
        start = min(starts, key=lambda x: float(np.square(self._residual(x)[0]).sum()))
        x = self._settled(start, np.ones(p, dtype=bool))
        bounds = [self._bound(x, j) for j in range(len(x))]
        felt = np.array([bound is None for bound in bounds])
        if felt.any() and not felt.all():  # the others, with this one at its end
            at_end = x.copy()
            for j, bound in enumerate(bounds):
                if bound is not None:
                    at_end[j] = self._most[j] if bound[0] == ">" else self._least[j]
            x = self._settled(at_end, felt)
        residual, J = self._residual(x)
        freedom = len(residual) - int(felt.sum())
        variance = float(residual @ residual) / freedom if freedom else math.nan
        errors, correlation = self._errors(J[:, felt], variance, freedom)
        k, remaining = np.exp(x), iter(errors)
        stiffness = [
            FittedStiffness(name, value, value * next(remaining), "", "")
            if bound is None
            else FittedStiffness(name, bound[1], math.nan, bound[0], "")
            for name, value, bound in zip(self.plate.names, k.tolist(), bounds, strict=True)
        ]
        misfit = float(np.sqrt(np.mean(residual**2)))
        return _Solution(stiffness, residual, misfit, correlation)

    @staticmethod
    def _errors(J: Floats, variance: float, freedom: int) -> tuple[list[float], float]:
        """Return standard errors of ln k, widened for few frequencies, and the correlation."""
        from scipy import special

        p = J.shape[1]
        if not p or not freedom:
            return [math.nan] * p, math.nan
        covariance = np.linalg.pinv(J.T @ J) * variance
        errors = np.sqrt(np.diag(covariance))
        correlation = float(covariance[0, 1] / errors.prod()) if p == 2 else math.nan
        widened = float(special.stdtrit(freedom, 0.975)) / 2.0
        return (errors * widened).tolist(), correlation

    def _residual(self, x: Floats) -> tuple[Floats, Floats]:
        computed, slopes = self.basis.frequencies(np.exp(x), self.which)
        return self.measured - computed, slopes

    def _settled(self, x: Floats, free: Bools) -> Floats:
        """Fit the free parameters from a start until basis and whole plate agree."""
        x = self._least_squares(x, free)
        for _ in range(MOST_ROUNDS):
            squares, shapes = self.plate.whole(np.exp(x))
            error = 0.5 * np.log(squares[self.which]) - self.measured + self._residual(x)[0]
            if np.abs(error).max() < AGREEMENT:
                break
            self._shapes.append(shapes)
            self.basis = RitzBasis(self.plate, np.concatenate(self._shapes))
            x = self._least_squares(x, free)
        return x

    def _least_squares(self, start: Floats, free: Bools) -> Floats:
        """Return the best values of the free parameters in the basis, with the others."""
        from scipy.optimize import least_squares

        def at(y: Floats) -> tuple[Floats, Floats]:
            x = start.copy()
            x[free] = y
            residual, slopes = self._residual(x)
            return residual, -slopes[:, free]

        bounds = self._least[free], self._most[free]
        fit = least_squares(lambda y: at(y)[0], start[free], lambda y: at(y)[1], bounds=bounds)
        x = start.copy()
        x[free] = fit.x
        return x

    def _bound(self, x: Floats, j: int) -> tuple[str, float] | None:
        """Return a bound of a parameter that no frequency feels; None for one that they feel."""
        here = self._residual(x)[0]
        limit = max(RESOLUTION, float(np.sqrt(np.mean(here**2))))
        for sign, end in ((">", self._most[j]), ("<", self._least[j])):
            at_end = x.copy()
            at_end[j] = end
            of_end = self._residual(at_end)[0]
            if np.abs(of_end - here).max() > limit:
                continue
            unfelt, felt = end, self._least[j] if sign == ">" else self._most[j]
            for _ in range(40):
                at_end[j] = 0.5 * (unfelt + felt)
                if np.abs(self._residual(at_end)[0] - of_end).max() > limit:
                    felt = at_end[j]
                else:
                    unfelt = at_end[j]
            return sign, float(np.exp(unfelt))
        return None
