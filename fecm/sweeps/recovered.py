"""Strains, slopes and exposures of impacts on a reduced plate.

The displacement fields follow from the coordinates of the plate and the contact force. They are
given to what evaluates the fields of a full run, at the same times: FAIL's monitor, the gages, and
the midplane at the rows of RODP.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.authoring.time_values import lengthened, step_of
from fecm.deck.macros import steps_at
from fecm.deck.material_cards import Allowables, Cure
from fecm.deck.model import Deck
from fecm.judge.criteria import ALL_CRITERIA
from fecm.judge.exposure_bands import mesh_band
from fecm.judge.limits import SLOPE, STRAIN, ModelLimit
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.exposures import TIE, FailureEnvelope
from fecm.mechanics.failure_monitor import FailureMonitor
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.kernels.failure import CompiledMonitor
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.mechanics.reduced_plate import ReducedFields, small_products
from fecm.mechanics.stretching import principal_values
from fecm.mechanics.symmetry import symmetry_reduction
from fecm.problem.build import ImpactModel, build_model
from fecm.problem.problem import Problem
from fecm.results.metrics import BAND, EVALUATIONS, GAGE
from fecm.sweeps.in_full import CasePeaks, criteria_of_deck, without_output
from fecm.sweeps.task import Measure

# Displacement fields that are computed at a time.
FIELDS = 16


class Measured(NamedTuple):
    """What is measured on request in many cases, (cases,) each."""

    peaks: Mapping[str, CasePeaks]
    largest: Mapping[ModelLimit, Floats]  # of quantities that are judged
    columns: Mapping[str, Floats]  # more columns


NOTHING = Measured({}, {}, {})


class NeededTimes(NamedTuple):
    """Times at which the coordinates of a plate are needed, and where each use has its times."""

    times: Floats  # ascending
    failure: Indices
    midplane: Indices
    gages: Indices


class CaseValues(NamedTuple):
    """What is measured in one case."""

    exposures: Mapping[str, tuple[float, float]]  # largest and last value by criterion
    evaluations: int
    gages: Floats  # (2, gages): largest and last absolute strain
    slope: float
    strain: float


@dataclass(frozen=True)
class Recovery:
    """Evaluator of the displacement fields of impacts on a reduced plate."""

    problem: Problem
    measures: Sequence[Measure]
    fields: ReducedFields

    @cached_property
    def model(self) -> ImpactModel:
        """Model of a full run."""
        return build_model(without_output(self.problem, self.measures))

    def rows(self, dt: float, steps: int) -> NeededTimes:
        """Return the times in `steps` steps of the reduced plate."""
        program, size = self.problem.program, step_of(self.problem)
        factor = dt * steps / (size * self.problem.work.steps)
        if factor > 1.0 + 1e-9:
            program = lengthened(self.problem, factor).program
        most = dt * steps / size * (1.0 + 1e-9)
        words = ["FAIL"] if Measure.FAILURE in self.measures else []
        by_word = {word: steps_at(program, word) for word in [*words, "RODP"]}
        uses = {word: size * at[at <= most] for word, at in by_word.items()}
        uses["GAGE"] = np.empty(0)
        if Measure.GAGES in self.measures:
            uses["GAGE"] = dt * np.arange(1, steps + 1)
        times = np.unique(np.concatenate([*uses.values()]))
        places = {word: np.searchsorted(times, at) for word, at in uses.items()}
        none = np.empty(0, dtype=np.intp)
        return NeededTimes(times, places.get("FAIL", none), places["RODP"], places["GAGE"])

    def measured(
        self,
        rows: NeededTimes,
        coordinates: Floats,
        force: Floats,
        dt: float,
        decks: Sequence[Deck],
    ) -> Measured:
        """Measure cases: coordinates (cases, rows, n), contact forces (steps, cases), decks."""
        times = np.append(0.0, np.add.accumulate(np.full(len(force), dt)))
        cases = [
            self.of_case(rows, q, np.interp(rows.times, times, np.append(0.0, f)), deck)
            for q, f, deck in zip(coordinates, force.T, decks, strict=True)
        ]
        peaks: dict[str, CasePeaks] = {}
        columns: dict[str, Floats] = {}
        if self.model.gages is not None and Measure.GAGES in self.measures:
            gages = np.array([case.gages for case in cases])
            for number, values in zip(self.model.gages.numbers, gages.T, strict=True):
                peaks[f"{GAGE}{number}"] = CasePeaks(*values)
        for name in cases[0].exposures:
            values = np.array([case.exposures[name] for case in cases])
            peaks[f"exposure_{name}"] = CasePeaks(*values.T)
        if Measure.FAILURE in self.measures:
            counts = np.array([float(case.evaluations) for case in cases])
            bands = np.array([self._band(case) for case in cases])
            columns = dict.fromkeys(EVALUATIONS, counts) | dict(zip(BAND, bands.T, strict=True))
        largest = {
            SLOPE: np.array([case.slope for case in cases]),
            STRAIN: np.array([case.strain for case in cases]),
        }
        return Measured(peaks, largest, columns)

    def _band(self, case: CaseValues) -> tuple[float, float]:
        """Return the lowest and highest value that finer meshes may give the largest exposure."""
        mesh = self.model.load_mesh
        if mesh is None or not case.exposures:
            return np.nan, np.nan
        bands = [mesh_band(value, name, mesh) for name, (value, _) in case.exposures.items()]
        low, high = (max(ends) for ends in zip(*bands, strict=True))
        return low, high

    def of_case(self, rows: NeededTimes, q: Floats, force: Floats, deck: Deck) -> CaseValues:
        """Measure one case: coordinates (rows, n) and contact forces (rows,)."""
        amplitudes = self.fields.amplitudes(q, force)
        gages = self._gages(rows, amplitudes)
        strain = self._largest_strain(rows, amplitudes)
        if strain <= STRAIN.value:
            strain = max(strain, self._largest_bending(rows, amplitudes))
        return CaseValues(
            self._exposures(rows, amplitudes, deck) if len(rows.failure) else {},
            int(np.count_nonzero(force[rows.failure] > 0.0)),
            gages,
            self._largest_slope(rows, amplitudes),
            max(strain, float(gages.max(initial=0.0))),
        )

    def _exposures(
        self, rows: NeededTimes, amplitudes: Floats, deck: Deck
    ) -> dict[str, tuple[float, float]]:
        """Return the largest and the last exposure of each criterion."""
        monitor, envelope = self._monitor(deck)
        self._raise(monitor, envelope, rows, amplitudes, rows.failure[:-1])
        before = monitor.largest(envelope).exposure[monitor.order]
        self._raise(monitor, envelope, rows, amplitudes, rows.failure[-1:])
        largest = monitor.largest(envelope).exposure[monitor.order]
        # A largest exposure that is reached before the last evaluation has fallen.
        last = np.where(before >= largest * (1.0 - TIE), 0.0, largest)
        values = zip(ALL_CRITERIA, largest.tolist(), last.tolist(), strict=True)
        return {name: (value, at_end) for name, value, at_end in values if not np.isnan(value)}

    def _raise(
        self,
        monitor: FailureMonitor,
        envelope: FailureEnvelope,
        rows: NeededTimes,
        amplitudes: Floats,
        chosen: Indices,
    ) -> None:
        """Raise the exposures to those at some of the times."""
        for start in range(0, len(chosen), FIELDS):
            at = chosen[start : start + FIELDS]
            fields = self.fields.fields(amplitudes[at])
            monitor.raise_largest(envelope, fields, rows.times[at].tolist())

    @cached_property
    def _failure(self) -> FailureMonitor:
        """Monitor of FAIL for the largest exposures."""
        monitor = self.model.failure
        assert monitor is not None  # the program has FAIL
        return monitor.for_largest(self._half_of_plate)

    @cached_property
    def _half_of_plate(self) -> Bools:
        """Mask of the elements, (elements,), without those that are images under a half turn."""
        plate = replace(self.problem.plate, nonlinear=False)
        return np.asarray(symmetry_reduction(plate, self.problem.contact).weights > 0)

    def _half(self, rule: Quadrature) -> Floats:
        """Return half the thickness at the points of a rule, (points,), 0 near the load."""
        problem = self.problem
        x, y = problem.plate.strain_field(rule).places(problem.mesh.coordinates)
        left_out = problem.under_load(x, y) | ~self._half_of_plate[:, None]
        half = np.broadcast_to(problem.plate.thicknesses / 2.0, x.shape)
        return np.ascontiguousarray(np.where(left_out, 0.0, half).ravel())

    @cached_property
    def _envelopes(self) -> tuple[FailureEnvelope, FailureEnvelope]:
        """Envelope of FAIL's monitor that all cases use, and one without exposures."""
        return self._failure.start(), self._failure.start()

    def _monitor(self, deck: Deck) -> tuple[FailureMonitor, FailureEnvelope]:
        """Return FAIL's monitor with strengths and residual stresses of a deck, and its start."""
        if all(deck.last(kind) == self.problem.deck.last(kind) for kind in (Allowables, Cure)):
            envelope, start = self._envelopes
            envelope.reset_to(start)
            return self._failure, envelope
        monitor = criteria_of_deck(self._failure, deck, self.problem.plate)
        return monitor, monitor.start()

    @cached_property
    def _strains(self) -> tuple[CompiledMonitor, FailureEnvelope] | None:
        """Evaluator of the strains of the faces; None without kernels."""
        if LIBRARY is None:
            return None
        plate, rule = self.problem.plate, self.problem.plate.rules.bending
        stresses = PlyStresses(
            self.problem.mesh,
            plate.rows_by_laminate,
            rule,
            initial=plate.preload_strain if plate.is_preloaded else None,
            curvature=plate.curvature,
            nonlinear=True,
        )
        none = [[None] * zone.plies for zone in stresses.zones]
        monitor = CompiledMonitor(stresses, none).for_strains(self._half(rule))
        return monitor, monitor.start()

    @cached_property
    def _preload_strain(self) -> float:
        """Largest principal strain of the preload."""
        stretching = self.model.stretching
        return 0.0 if stretching is None else stretching.preload_strain

    @cached_property
    def _face_strains(self) -> Floats:
        """Largest strain of a face in the field of each amplitude, (amplitudes,)."""
        stretching = self.model.stretching
        assert stretching is not None  # the plate stretches
        fields = self.fields.fields(np.eye(self.fields.count))
        return np.array([stretching.largest_linear(field) for field in fields])

    def _bounds_of_strain(self, rows: NeededTimes, amplitudes: Floats) -> Floats:
        """Return bounds of the largest strain of a face at the rows of RODP, (rows,)."""
        absolute = np.abs(amplitudes[rows.midplane])
        x, y = self._slopes
        slope = np.einsum("rs,s", absolute[:, : len(x)], np.hypot(x, y).max(axis=1))
        # Tied quadratic strains are at most twice those of the largest slope.
        linear = np.einsum("ra,a", absolute, self._face_strains)
        return np.asarray(linear + slope**2 + self._preload_strain)

    def _largest_strain(self, rows: NeededTimes, amplitudes: Floats) -> float:
        """Return the largest strain of a face at the rows of RODP."""
        if self.model.stretching is None or not len(rows.midplane):
            return 0.0
        bound = self._bounds_of_strain(rows, amplitudes)
        order = np.argsort(-bound, kind="stable")
        near, largest = rows.midplane[order[bound[order] > STRAIN.value]], 0.0
        for start in range(0, len(near), FIELDS):
            if largest > STRAIN.value:  # which is all that the judge asks
                break
            fields = self.fields.fields(amplitudes[near[start : start + FIELDS]])
            largest = max(largest, self._strain_of(fields))
        return largest if len(near) else float(bound.max())

    @cached_property
    def _bending(self) -> tuple[Floats, Floats]:
        """Strains of bending, (3, shapes, points), at a face, and the largest of each shape.

        They are xx, yy, xy at the points of tape8, without the quadratic strains and u and v.
        """
        model = self.model
        shapes = self.fields.moving
        curvatures = model.strains.evaluate(shapes)[:3].reshape(3, len(shapes), -1)
        half = self._half(model.strains.rule)
        strains = np.ascontiguousarray(half * curvatures * np.reshape([1.0, 1.0, 0.5], (3, 1, 1)))
        mean, radius = principal_values(np.moveaxis(strains, 0, -1))
        return strains, (np.abs(mean) + radius).max(axis=1)

    def _largest_bending(self, rows: NeededTimes, amplitudes: Floats) -> float:
        """Return the largest strain of bending at the rows of RODP, or a bound below the limit."""
        if self.model.stretching is None or not len(rows.midplane):
            return 0.0
        strains, largest = self._bending
        moved = amplitudes[rows.midplane, : len(largest)]
        preload = self._preload_strain
        bound = np.einsum("rs,s", np.abs(moved), largest) + preload
        near = moved[bound > STRAIN.value]
        if not len(near):
            return float(bound.max())
        mean, radius = principal_values(
            np.stack([small_products(near, part) for part in strains], axis=-1)
        )
        return float((np.abs(mean) + radius).max()) + preload

    def _strain_of(self, fields: Floats) -> float:
        """Return the largest strain of a face in fields, (fields, numnp, 5)."""
        if self._strains is not None:
            monitor, envelope = self._strains
            return monitor.largest_strain(envelope, fields)
        stretching = self.model.stretching
        assert stretching is not None  # the plate stretches
        return max(stretching.largest(field).strain for field in fields)

    @cached_property
    def _slopes(self) -> Floats:
        """Slopes of w of the moving shapes, (2, shapes, points)."""
        stretching = self.model.stretching
        assert stretching is not None  # the plate stretches
        shapes = self.fields.moving
        return np.stack([stretching.slopes(shape) for shape in shapes], axis=1).T.copy()

    def _largest_slope(self, rows: NeededTimes, amplitudes: Floats) -> float:
        """Return the largest slope at the rows of RODP, or a bound of it below the limit."""
        if self.model.stretching is None or not len(rows.midplane):
            return 0.0
        x, y = self._slopes
        moved = amplitudes[rows.midplane, : len(x)]
        bound = np.einsum("rs,s", np.abs(moved), np.hypot(x, y).max(axis=1))
        near = moved[bound > SLOPE.value]
        if not len(near):
            return float(bound.max())
        return float(np.hypot(small_products(near, x), small_products(near, y)).max())

    @cached_property
    def _of_gages(self) -> Floats:
        """Sums of the gages per amplitude, (amplitudes, rows of the gages)."""
        gages = self.model.gages
        assert gages is not None
        count = self.fields.count
        fields = self.fields.fields(np.eye(count)).reshape(count, -1)
        return np.asarray((fields[:, gages.dof_indices] * gages.weights).sum(axis=2))

    def _gages(self, rows: NeededTimes, amplitudes: Floats) -> Floats:
        """Return the largest and the last absolute strain of each gage, (2, gages)."""
        gages = self.model.gages
        if gages is None or not len(rows.gages):
            return np.empty((2, 0))
        sums = np.einsum("ra,ag->rg", amplitudes[rows.gages], self._of_gages)
        strains = np.abs(gages.strains(sums))
        return np.stack([strains.max(axis=0), strains[-1]])
