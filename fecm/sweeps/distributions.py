"""Distributions of random values: named ones with parameters, and objects of the caller."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from fecm._errors import did_you_mean
from fecm._text import short_text
from fecm._typing import Floats
from fecm.authoring.case import CasesError
from fecm.authoring.values import NAMES, ValueKind, check_free, kind_of

LARGEST_SIGMA = 3.0  # of a lognormal law
DOUBTFUL_SIGMA = 1.0  # from which a note asks whether it is meant
DOUBTFUL_SHAPE = 200.0  # of a Weibull law, likewise
LEAST_PART = 1e-6  # least probability of a normal law between the ends of a truncation
LONGEST = 80  # characters of the text of an object


class HasQuantiles(Protocol):
    """Distribution with a quantile function ``ppf``, as frozen ones of :mod:`scipy.stats`."""

    def ppf(self, probabilities: Any, /) -> Any:
        """Return the values (n,) at which the distribution function is `probabilities` (n,)."""


class HasInverse(Protocol):
    """Distribution with a quantile function ``icdf``, as the new ones of :mod:`scipy.stats`."""

    def icdf(self, probabilities: Any, /) -> Any:
        """Return the values (n,) at which the distribution function is `probabilities` (n,)."""


OwnDistribution = HasQuantiles | HasInverse


class Distribution(NamedTuple):
    """Distribution with the parameters of its text."""

    parameters: str
    rule: str  # what must hold for the parameters
    holds: Callable[..., bool]
    quantile: Callable[..., Floats]  # of probabilities between 0 and 1 and the parameters


def standard_normal(probability: Floats) -> Floats:
    """Return quantiles of the standard normal distribution."""
    from scipy.special import ndtri  # takes 0.1 s to import

    return np.asarray(ndtri(probability))


def standard_normal_probability(values: Floats | float) -> Floats:
    """Return values of the distribution function of the standard normal distribution."""
    from scipy.special import ndtr  # takes 0.1 s to import

    return np.asarray(ndtr(values))


def _normal(probability: Floats, mean: float, deviation: float) -> Floats:
    return mean + deviation * standard_normal(probability)


def _truncated(probability: Floats, mean: float, deviation: float, a: float, b: float) -> Floats:
    if a > mean:  # mirrored, because the upper tail has fewer digits than the lower
        return -_truncated(1.0 - probability, -mean, deviation, -b, -a)
    below, up_to = standard_normal_probability((np.array([a, b]) - mean) / deviation)
    values = mean + deviation * standard_normal(below + probability * (up_to - below))
    return np.clip(values, a, b)


def _has_part(mean: float, deviation: float, a: float, b: float) -> bool:
    """Return whether a normal law can be truncated to the range between two ends."""
    if not (deviation > 0.0 and a < b):
        return False
    ends = (np.array([a, b]) - mean) / deviation
    below, up_to = standard_normal_probability(ends if a <= mean else -ends[::-1])
    return bool(up_to - below >= LEAST_PART)


def _lognormal(probability: Floats, median: float, sigma: float) -> Floats:
    return median * np.exp(sigma * standard_normal(probability))


def _weibull(probability: Floats, scale: float, shape: float) -> Floats:
    return scale * (-np.log1p(-probability)) ** (1.0 / shape)


def _uniform(probability: Floats, a: float, b: float) -> Floats:
    return a + (b - a) * probability


def _triangular(probability: Floats, a: float, mode: float, b: float) -> Floats:
    below = a + np.sqrt(probability * (b - a) * (mode - a))
    above = b - np.sqrt((1.0 - probability) * (b - a) * (b - mode))
    return np.where(probability * (b - a) < mode - a, below, above)


NORMAL = "normal"
LOGNORMAL = "lognormal"
WEIBULL = "weibull"
LAWS = {
    NORMAL: Distribution(
        "MEAN,SD", "SD must be positive", lambda mean, deviation: deviation > 0.0, _normal
    ),
    "truncnormal": Distribution(
        "MEAN,SD,A,B",
        f"SD must be positive, A less than B, and {LEAST_PART:g} or more of normal:MEAN,SD from "
        "A to B",
        _has_part,
        _truncated,
    ),
    LOGNORMAL: Distribution(
        "MEDIAN,SIGMA",
        "MEDIAN and SIGMA must be positive",
        lambda median, sigma: median > 0.0 and sigma > 0.0,
        _lognormal,
    ),
    WEIBULL: Distribution(
        "SCALE,SHAPE",
        "SCALE and SHAPE must be positive",
        lambda scale, shape: scale > 0.0 and shape > 0.0,
        _weibull,
    ),
    "uniform": Distribution("A,B", "A must be less than B", lambda a, b: a < b, _uniform),
    "triangular": Distribution(
        "A,MODE,B",
        "MODE must be from A to B, and A less than B",
        lambda a, mode, b: a < b and a <= mode <= b,
        _triangular,
    ),
}
FORMS = tuple(f"{name}:{law.parameters}" for name, law in LAWS.items())


class ValueDistribution(NamedTuple):
    """Distribution of a value: one of :data:`LAWS` with its parameters."""

    kind: str
    parameters: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.kind}:{','.join(f'{value:.12g}' for value in self.parameters)}"

    def values(self, unit: Floats) -> Floats:
        """Return the values at which the distribution function has these probabilities."""
        with np.errstate(over="ignore"):
            values = LAWS[self.kind].quantile(unit, *self.parameters)
        if not np.isfinite(values).all():
            raise CasesError(f"{self} is beyond the range of numbers")
        return values

    def doubt(self) -> str:
        """Return a doubt about the parameters, or an empty text."""
        last = self.parameters[-1]
        if self.kind == LOGNORMAL and last >= DOUBTFUL_SIGMA:
            return _of_logarithm(self)
        if self.kind == WEIBULL and last >= DOUBTFUL_SHAPE:
            # The standard deviation is pi/(sqrt(6) SHAPE) of SCALE for a large SHAPE.
            share = math.pi / (math.sqrt(6.0) * last)
            return f"SHAPE of {self} is a standard deviation of {share:.2g} SCALE"
        return ""


@dataclass(frozen=True)
class CustomDistribution:
    """Distribution of a value, given by an object of the caller."""

    text: str  # that describes it
    source: OwnDistribution | None = field(default=None, compare=False)  # None if it was read

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the text, so that a result does not depend on whether its laws can be pickled."""
        return CustomDistribution, (self.text,)

    def values(self, unit: Floats) -> Floats:
        """Return the values at which the distribution function has these probabilities."""
        if self.source is None:
            raise CasesError(f"a stored result has the draws of {self}, not the law")
        name = _quantile_method(self.source)
        assert name is not None  # checked by law_of
        try:
            values = np.asarray(getattr(self.source, name)(unit.ravel()), dtype=float)
        except Exception as error:  # of the caller's function
            raise CasesError(f"{name} of {self} failed: {error}") from error
        if values.shape != (unit.size,):
            shape = f"{values.shape} for probabilities {(unit.size,)}"
            raise CasesError(f"{name} of {self} gives values of the shape {shape}")
        if not np.isfinite(values).all():
            raise CasesError(f"{name} of {self} gives values that are not finite")
        return values.reshape(unit.shape)

    def doubt(self) -> str:
        """Return an empty text: nothing is known about the object."""
        return ""


def _quantile_method(law: object) -> str | None:
    """Return the name of the method that gives the quantiles of a distribution, or None."""
    names = ("ppf", "icdf")
    return next((name for name in names if callable(getattr(law, name, None))), None)


def distribution_of(
    name: str, distribution: str | OwnDistribution, *, free: bool = False
) -> ValueDistribution | CustomDistribution:
    """Return the law of a name from a text, or from an object with ``ppf`` or ``icdf``.

    `free` allows any name. Raises CasesError if the law is neither a text nor such an object, lacks
    its parameters, or has an invalid one.
    """
    if isinstance(distribution, str):
        return parse_law(name, distribution, free=free)
    _check_random(name, free=free)
    if _quantile_method(distribution) is None:
        raise CasesError(
            f"{name}: {distribution!r} is not a law; write a text such as 'normal:115,10', or an "
            "object with the method ppf or icdf, as the distributions of scipy.stats are"
        )
    # A distribution of scipy.stats before it is called has the mean 0 and the deviation 1.
    if isinstance(distribution, type) or callable(getattr(distribution, "freeze", None)):
        what = getattr(distribution, "name", None) or getattr(
            distribution, "__name__", type(distribution).__name__
        )
        raise CasesError(f"{name}: {what} has no parameters; call it with them first")
    return CustomDistribution(_text_of(distribution), distribution)


def _text_of(law: OwnDistribution) -> str:
    """Describe an object: name and parameters of a frozen distribution, or else the repr."""
    text = type(law).__name__ if type(law).__repr__ is object.__repr__ else str(law)
    if isinstance(name := getattr(getattr(law, "dist", None), "name", None), str):
        named = [f"{key}={value}" for key, value in getattr(law, "kwds", {}).items()]
        text = f"{name}({', '.join([*map(str, getattr(law, 'args', ())), *named])})"
    return short_text(" ".join(text.split()), LONGEST)


def parse_law(name: str, text: str, *, free: bool = False) -> ValueDistribution:
    """Parse ``LAW:PARAMETERS`` of a name. `free` allows any name.

    Raises CasesError if the law or a parameter is invalid.
    """
    _check_random(name, free=free)
    kind, _, numbers_text = (part.strip() for part in str(text).partition(":"))
    if kind not in LAWS:
        raise CasesError(f"{name}: `{text}` is not a law; the laws are {', '.join(FORMS)}")
    named_law = LAWS[kind]
    parameters: tuple[float, ...] = ()
    with suppress(ValueError):
        parameters = tuple(map(float, numbers_text.split(",")))
    needed = named_law.parameters.count(",") + 1
    if len(parameters) != needed or not all(map(math.isfinite, parameters)):
        raise CasesError(
            f"{name}: `{text}` is not {kind}:{named_law.parameters} with finite numbers"
        )
    if not named_law.holds(*parameters):
        raise CasesError(f"{name}: `{text}`: {named_law.rule}")
    law = ValueDistribution(kind, parameters)
    if kind == LOGNORMAL and parameters[1] > LARGEST_SIGMA:
        raise CasesError(f"{name}: {_of_logarithm(law)}; it is at most {LARGEST_SIGMA:g}")
    return law


def _check_random(name: str, *, free: bool) -> None:
    """Raise CasesError if a name can't have random values."""
    if free:
        check_free(name, "random")
        return
    numbers = [candidate for candidate in NAMES if kind_of(candidate) is ValueKind.NUMBER]
    if name not in numbers:
        alternatives = did_you_mean(name, numbers) or f"; the names are {', '.join(numbers)}"
        raise CasesError(f"`{name}` cannot be random{alternatives}")


def _of_logarithm(law: ValueDistribution) -> str:
    """Say that SIGMA of a lognormal law belongs to the logarithm, and give its value for an SD."""
    median, sigma = law.parameters
    # The variance is m^2 s (s - 1) with the median m and s = exp(SIGMA^2).
    sigma_of_logarithm = math.sqrt(math.log(0.5 + 0.5 * math.hypot(1.0, 2.0 * sigma / median)))
    text = f"SIGMA of {law} is the standard deviation of the logarithm"
    return f"{text}; a standard deviation of {sigma:g} is SIGMA {sigma_of_logarithm:.2g}"
