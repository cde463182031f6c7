"""Random cases of a sweep: distributions of values, and designs that draw from them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from fecm._typing import Floats
from fecm.sweeps.cases import (
    INTEGERS,
    MOST,
    NAMES,
    PLATE,
    TEXTS,
    Case,
    CasesError,
    name_fault,
    plate_values,
)

# Parameters of the laws, and what must hold for them.
LAWS: dict[str, tuple[str, str, Callable[..., bool]]] = {
    "normal": ("MEAN,SD", "SD must be positive", lambda _, sd: sd > 0.0),
    "lognormal": ("MEDIAN,SIGMA", "MEDIAN and SIGMA must be positive", lambda *v: min(v) > 0.0),
    "uniform": ("A,B", "A must be less than B", lambda a, b: a < b),
    "triangular": ("A,MODE,B", "MODE must be from A to B, and A less than B",
                   lambda a, mode, b: a <= mode <= b > a),
}  # fmt: skip
DesignKind = Literal["lhs", "sobol", "mc"]
DESIGNS: tuple[DesignKind, ...] = get_args(DesignKind)
FEWEST = 16  # fewest draws
# Unit samples are kept this far from 0 and 1: half the resolution of a Sobol' sequence.
MARGIN = 2.0**-31
REMEDY = "lognormal, uniform and triangular can be kept to possible values"


@dataclass(frozen=True)
class Law:
    """Distribution of a value: one of `LAWS` with its parameters."""

    kind: str
    parameters: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.kind}:{','.join(f'{number:.12g}' for number in self.parameters)}"

    def values(self, unit: Floats) -> Floats:
        """Values at which the distribution function takes these values, between 0 and 1."""
        from scipy.special import ndtri  # slow to import

        first, *_, last = self.parameters
        if self.kind == "normal":
            return np.asarray(first + last * ndtri(unit))
        if self.kind == "lognormal":
            return np.asarray(first * np.exp(last * ndtri(unit)))
        if self.kind == "uniform":
            return first + (last - first) * unit
        mode = self.parameters[1]
        below = first + np.sqrt(unit * (last - first) * (mode - first))
        above = last - np.sqrt((1.0 - unit) * (last - first) * (last - mode))
        return np.where(unit * (last - first) < mode - first, below, above)


def parse_law(name: str, text: str, *, free: bool = False) -> Law:
    """Read ``LAW:PARAMETERS`` of a name (any with `free`); CasesError if one of them is invalid."""
    numbers = [known for known in NAMES if known not in (*TEXTS, *INTEGERS)]
    if fault := name_fault(name) if free else "":
        raise CasesError(f"random: {fault}")
    if not free and name not in numbers:
        raise CasesError(f"`{name}` cannot be random; the names are {', '.join(numbers)}")
    kind, _, given = (part.strip() for part in str(text).partition(":"))
    if kind not in LAWS:
        laws = ", ".join(f"{kind}:{known[0]}" for kind, known in LAWS.items())
        raise CasesError(f"{name}: `{text}` is not a law; the laws are {laws}")
    names, rule, holds = LAWS[kind]
    parameters: tuple[float, ...] = ()
    with suppress(ValueError):
        parameters = tuple(map(float, given.split(",")))
    if len(parameters) != names.count(",") + 1 or not all(map(math.isfinite, parameters)):
        raise CasesError(f"{name}: `{text}` is not {kind}:{names} with finite numbers")
    if not holds(*parameters):
        raise CasesError(f"{name}: `{text}`: {rule}")
    return Law(kind, parameters)


def parse_random(text: str) -> tuple[str, Law]:
    """Read ``NAME=LAW:PARAMETERS``; CasesError if the text has another form, or is invalid."""
    name, equals, law = (part.strip() for part in text.partition("="))
    if not equals:
        raise CasesError(f"`{text}`: write NAME=LAW, such as k=lognormal:1.9e6,0.15")
    return name, parse_law(name, law)


@dataclass(frozen=True)
class Design:
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
    if samples is None or samples < FEWEST:
        raise CasesError(f"{samples} samples are too few; take at least {FEWEST}")
    if kind not in DESIGNS:
        raise CasesError(f"unknown design {kind}; the designs are {', '.join(DESIGNS)}")
    if seed < 0:
        raise CasesError(f"the seed must not be negative, not {seed}")
    return Design(dict(laws), int(samples), int(seed), kind, sensitivity)


def doubt(design: Design) -> str:
    """What is doubtful about a design; empty if nothing is."""
    if design.kind == "sobol" and design.samples & (design.samples - 1):
        why = "no power of 2, which a Sobol' design needs to be balanced"
        return f"{design.samples} samples are {why}; take {2 ** round(math.log2(design.samples))}"
    return ""


def unit_samples(kind: DesignKind, samples: int, columns: int, seed: int) -> Floats:
    """Draw a design in the unit cube, (samples, columns)."""
    generator = np.random.default_rng(seed)
    if kind == "sobol":
        from scipy.stats import qmc  # slow to import

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
    and for each name A with the column of B (Saltelli et al., 2010).  Raises CasesError if a value
    is beyond the range of numbers.
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
    """Return the cases of a design for every combination of varied values.

    Raises CasesError if a name is varied too, or there are too many cases.
    """
    for name in design.laws:
        if name in varied[0]:
            raise CasesError(f"{name} is both varied and random")
    if (count := len(varied) * design.rows) > MOST:
        raise CasesError(f"{count} cases; at most {MOST} are allowed")
    rows = [dict(zip(design.laws, row, strict=True)) for row in matrix(design).tolist()]
    return [{**case, **row} for case in varied for row in rows]


def cost(cases: Sequence[Case], design: Design, *, shared: bool) -> str:
    """Say how many plates a random sweep needs, and which names cause them."""
    more = "" if len(cases) == design.draws else f"{len(cases)} cases of "
    given = f"{more}{design.draws} draws"
    if not shared:
        return f"{given} are run in full, one by one"
    plates = len({frozenset(plate_values(case).items()) for case in cases})
    causes = [name for name in design.laws if name in PLATE]
    if not causes:
        return f"{given} share {plates} plate{'s' * (plates > 1)}"
    why = f"because {' and '.join(causes)} {'is' if len(causes) == 1 else 'are'} random"
    others = "velocity, k, alpha_p, s_p, q and the projectile share one"
    return f"{given} need {plates} plates, {why}; {others}"
