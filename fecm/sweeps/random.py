"""Random sweeps: laws of the random values, and designs of the samples that are drawn."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Literal, NamedTuple, get_args

import numpy as np

from fecm._typing import Floats
from fecm.sweeps.case import Case, CasesError, check_count
from fecm.sweeps.values import (
    NAMES,
    PLATE_NAMES,
    RESIDUAL_NAMES,
    Kind,
    check_free,
    kind_of,
    plate_values,
)

DesignKind = Literal["lhs", "sobol", "mc"]
DESIGNS: tuple[DesignKind, ...] = get_args(DesignKind)
FEWEST_SAMPLES = 16
MARGIN = 2.0**-31  # from unit samples to 0 and 1: half the resolution of a Sobol' sequence
LARGEST_SIGMA = 3.0  # of a lognormal law
DOUBTFUL_SIGMA = 1.0  # from which a note asks whether it is meant
REMEDY = "lognormal, uniform and triangular can be kept to possible values"


class Distribution(NamedTuple):
    """A distribution with the parameters of its text."""

    parameters: str
    rule: str  # what must hold for the parameters
    holds: Callable[..., bool]
    quantile: Callable[..., Floats]  # of probabilities between 0 and 1 and the parameters


def _standard_normal(probability: Floats) -> Floats:
    from scipy.special import ndtri  # takes 0.1 s to import

    return np.asarray(ndtri(probability))


def _normal(probability: Floats, mean: float, deviation: float) -> Floats:
    return mean + deviation * _standard_normal(probability)


def _lognormal(probability: Floats, median: float, sigma: float) -> Floats:
    return median * np.exp(sigma * _standard_normal(probability))


def _uniform(probability: Floats, a: float, b: float) -> Floats:
    return a + (b - a) * probability


def _triangular(probability: Floats, a: float, mode: float, b: float) -> Floats:
    below = a + np.sqrt(probability * (b - a) * (mode - a))
    above = b - np.sqrt((1.0 - probability) * (b - a) * (b - mode))
    return np.where(probability * (b - a) < mode - a, below, above)


NORMAL = "normal"
LOGNORMAL = "lognormal"
LAWS = {
    NORMAL: Distribution(
        "MEAN,SD", "SD must be positive", lambda mean, deviation: deviation > 0.0, _normal
    ),
    LOGNORMAL: Distribution(
        "MEDIAN,SIGMA",
        "MEDIAN and SIGMA must be positive",
        lambda median, sigma: median > 0.0 and sigma > 0.0,
        _lognormal,
    ),
    "uniform": Distribution("A,B", "A must be less than B", lambda a, b: a < b, _uniform),
    "triangular": Distribution(
        "A,MODE,B",
        "MODE must be from A to B, and A less than B",
        lambda a, mode, b: a < b and a <= mode <= b,
        _triangular,
    ),
}


class Law(NamedTuple):
    """Distribution of a value: one of :data:`LAWS` with its parameters."""

    kind: str
    parameters: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.kind}:{','.join(f'{value:.12g}' for value in self.parameters)}"

    def values(self, unit: Floats) -> Floats:
        """Values at which the distribution function takes these values, between 0 and 1."""
        return LAWS[self.kind].quantile(unit, *self.parameters)


def parse_law(name: str, text: str, *, free: bool = False) -> Law:
    """Read ``LAW:PARAMETERS`` of a name (any with `free`); CasesError if one of them is invalid."""
    _check_random(name, free=free)
    kind, _, given = (part.strip() for part in str(text).partition(":"))
    if kind not in LAWS:
        laws = ", ".join(f"{known}:{LAWS[known].parameters}" for known in LAWS)
        raise CasesError(f"{name}: `{text}` is not a law; the laws are {laws}")
    known = LAWS[kind]
    parameters: tuple[float, ...] = ()
    with suppress(ValueError):
        parameters = tuple(map(float, given.split(",")))
    wanted = known.parameters.count(",") + 1
    if len(parameters) != wanted or not all(map(math.isfinite, parameters)):
        raise CasesError(f"{name}: `{text}` is not {kind}:{known.parameters} with finite numbers")
    if not known.holds(*parameters):
        raise CasesError(f"{name}: `{text}`: {known.rule}")
    law = Law(kind, parameters)
    if kind == LOGNORMAL and parameters[1] > LARGEST_SIGMA:
        raise CasesError(f"{name}: {_of_logarithm(law)}; it is at most {LARGEST_SIGMA:g}")
    return law


def _check_random(name: str, *, free: bool) -> None:
    """Raise CasesError if a name can't have random values."""
    if free:
        check_free(name, "random")
        return
    numbers = [known for known in NAMES if kind_of(known) is Kind.NUMBER]
    if name not in numbers:
        raise CasesError(f"`{name}` cannot be random; the names are {', '.join(numbers)}")


def _of_logarithm(law: Law) -> str:
    """Say that SIGMA of a lognormal law is that of the logarithm, and what it would be of an SD."""
    median, sigma = law.parameters
    # The variance is m^2 s (s - 1) with the median m and s = exp(SIGMA^2).
    meant = math.sqrt(math.log(0.5 + 0.5 * math.hypot(1.0, 2.0 * sigma / median)))
    text = f"SIGMA of {law} is the standard deviation of the logarithm"
    return f"{text}; a standard deviation of {sigma:g} is SIGMA {meant:.2g}"


def parse_random(text: str) -> tuple[str, Law]:
    """Read ``NAME=LAW:PARAMETERS``; CasesError if the text has another form, or is invalid."""
    name, equals, law = (part.strip() for part in text.partition("="))
    if not equals:
        raise CasesError(f"`{text}`: write NAME=LAW, such as k=lognormal:1.9e6,0.15")
    return name, parse_law(name, law)


class Design(NamedTuple):
    """Design of a random sweep."""

    laws: dict[str, Law]  # by the names of the random values
    samples: int
    seed: int = 0
    kind: DesignKind = "lhs"
    sensitivity: bool = False  # whether all cases of the sensitivity indices are run

    @property
    def draws(self) -> int:
        """Independent draws, which come before the others."""
        return self.samples * (2 if self.sensitivity else 1)

    @property
    def rows(self) -> int:
        """Cases of every combination of varied values."""
        return self.samples * (len(self.laws) + 2 if self.sensitivity else 1)


def design_of(
    laws: Mapping[str, Law], samples: int | None, seed: int, kind: DesignKind, sensitivity: bool
) -> Design:
    """Check and create a design.  Raises CasesError if it is invalid."""
    for name, value in (("samples", samples), ("seed", seed)):
        if not isinstance(value, int | np.integer):
            raise CasesError(f"the {name} of random values must be an integer, not {value!r}")
    if samples is None or samples < FEWEST_SAMPLES:
        raise CasesError(f"{samples} samples are too few; take at least {FEWEST_SAMPLES}")
    if kind not in DESIGNS:
        raise CasesError(f"unknown design {kind}; the designs are {', '.join(DESIGNS)}")
    if seed < 0:
        raise CasesError(f"the seed must not be negative, not {seed}")
    return Design(dict(laws), int(samples), int(seed), kind, sensitivity)


def doubt(design: Design) -> str:
    """What is doubtful about a design; empty if nothing is."""
    texts = [
        f"{name}: {_of_logarithm(law)}"
        for name, law in design.laws.items()
        if law.kind == LOGNORMAL and law.parameters[1] >= DOUBTFUL_SIGMA
    ]
    if design.kind == "sobol" and design.samples & (design.samples - 1):
        why = "no power of 2, which a Sobol' design needs to be balanced"
        nearest = 2 ** round(math.log2(design.samples))
        texts.append(f"{design.samples} samples are {why}; take {nearest}")
    return "; ".join(texts)


def unit_samples(kind: DesignKind, samples: int, columns: int, seed: int) -> Floats:
    """Draw a design in the unit cube, (samples, columns)."""
    generator = np.random.default_rng(seed)
    if kind == "sobol":
        from scipy.stats import qmc  # takes 0.3 s to import

        with warnings.catch_warnings(action="ignore"):  # of other numbers than powers of 2
            unit: Floats = qmc.Sobol(columns, seed=generator).random(samples)
    else:
        unit = generator.random((samples, columns))
    if kind == "lhs":  # one sample in each of N equal intervals
        cells = np.tile(np.arange(samples), (columns, 1))
        unit = (generator.permuted(cells, axis=1).T + unit) / samples
    return np.clip(unit, MARGIN, 1.0 - MARGIN)


def matrix(design: Design) -> Floats:
    """Return the random values of a design, (rows, names).

    With `sensitivity` the rows are the matrices A and B, the halves of the columns of one design,
    and for each name A with the column of B (Saltelli et al., 2010).  CasesError if one overflows.
    """
    count, halves = len(design.laws), 2 if design.sensitivity else 1
    unit = unit_samples(design.kind, design.samples, count * halves, design.seed)
    values = np.empty_like(unit)
    for place, (name, law) in enumerate(design.laws.items()):
        with np.errstate(over="ignore"):
            values[:, place::count] = law.values(unit[:, place::count])
        if not np.isfinite(values[:, place::count]).all():
            raise CasesError(f"{name}: {law} is beyond the range of numbers")
    if not design.sensitivity:
        return values
    a, b = np.hsplit(values, 2)
    return np.concatenate([a, b, *(np.where(chosen, b, a) for chosen in np.eye(count, dtype=bool))])


def random_cases(design: Design, varied: Sequence[Case]) -> list[Case]:
    """Cases of a design for each of some varied values; CasesError if there are too many."""
    for name in design.laws:
        if name in varied[0]:
            raise CasesError(f"{name} is both varied and random")
    check_count(len(varied) * design.rows)
    rows = [dict(zip(design.laws, row, strict=True)) for row in matrix(design).tolist()]
    return [{**case, **row} for case in varied for row in rows]


def cost(cases: Sequence[Case], design: Design, *, shared: bool, motions: bool) -> str:
    """Say how many plates a random sweep needs, and which names cause them.

    Cases may share the response of a plate, or motions that do not depend on residual stresses.
    """
    given = f"{design.draws} draws"
    if len(cases) != design.draws:
        given = f"{len(cases)} cases of {given}"
    if not shared:
        residual = [name for name in cases[0] if motions and name in RESIDUAL_NAMES]
        how = (
            f"; those that differ in {residual[0]} alone, together" if residual else ", one by one"
        )
        return f"{given} are run in full{how}"
    plates = len({frozenset(plate_values(case).items()) for case in cases})
    causes = [name for name in design.laws if name in PLATE_NAMES]
    if not causes:
        return f"{given} share {plates} plate{'s' * (plates > 1)}"
    why = f"because {' and '.join(causes)} {'is' if len(causes) == 1 else 'are'} random"
    others = "velocity, k, alpha_p, s_p, q and the projectile share one"
    return f"{given} need {plates} plates, {why}; {others}"
