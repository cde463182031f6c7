"""Cases of a sweep: a full grid of values, a table with one row per case, or random draws."""

from __future__ import annotations

import itertools
import math
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from fecm._errors import FecmError, did_you_mean
from fecm._measured_tables import read_rows
from fecm._typing import Floats
from fecm.deck.grid import SUPPORTS
from fecm.results.metrics import COLUMNS, VERDICTS
from fecm.studies import StudyError

Value = float | int | str
Case = dict[str, Value]
THRESHOLD = "threshold"  # instead of a number: the delamination threshold
PEAK_FORCE, EXPOSURE = SOUGHT = ("peak_force", "exposure")  # quantities of a search
Until = float | str | Mapping[str, float | str]  # what a search reaches; see sought_of
Limit = tuple[str, float | str]  # of a quantity whose probability of exceedance is asked for

# Names that change the projectile, its velocity or the contact law; where the force acts, which
# needs another response of the plate; and the plate or its time steps.
CONTACT = (
    "velocity", "energy", "k", "radius", "alpha_p", "s_p", "q",
    "mass", "rod_mass", "rod_length", "rod_modulus", "rod_density",
)  # fmt: skip
LOAD = ("at", "impact_node", "patch", "x0", "y0")
THICKNESS = "thickness"  # older name of laminate_thickness
LAMINATE = (
    "laminate_thickness", "ply_thickness", THICKNESS,
    "density", "nu12", "e1", "e2", "g12", "g13", "g23", "layup", "angle",
)  # fmt: skip
PLATE = (*LOAD, *LAMINATE, "size", "support", "dt", "duration")
NAMES = (*CONTACT, *PLATE)
REFINE = "refine"  # factor of a refinement study, which varies nothing else
OF_PLATE = frozenset((*PLATE, REFINE))  # those that need another response of the plate
EXCLUDING = (  # names of which only one can vary
    ("velocity", "energy"), ("k", "radius"), ("mass", "rod_mass", "rod_density"),
    ("at", "impact_node"), ("at", "x0"), ("at", "y0"),
    ("laminate_thickness", "ply_thickness", THICKNESS),
)  # fmt: skip
TEXTS = ("layup", "at", "size", "support")  # names with texts
PAIRS = {"at": ("({},{})", r"[,;\s]+"), "size": ("{}x{}", "[xX×]")}  # their forms and separators
INTEGERS = ("impact_node",)
# Names of results, which are no names of cases or of measured columns.
RESERVED = ("case", "step", "steps", "force", "unsettled_steps", *VERDICTS, *COLUMNS)
MOST = 1_000_000  # largest number of cases
# Parameters of the laws, and what must hold for them.
LAWS: dict[str, tuple[str, str, Callable[..., bool]]] = {
    "normal": ("MEAN,SD", "SD must be positive", lambda _, sd: sd > 0.0),
    "lognormal": ("MEDIAN,SIGMA", "MEDIAN and SIGMA must be positive", lambda *v: min(v) > 0.0),
    "uniform": ("A,B", "A must be less than B", lambda a, b: a < b),
    "triangular": ("A,MODE,B", "MODE must be from A to B, and A less than B",
                   lambda a, mode, b: a < b and a <= mode <= b),
}  # fmt: skip
# Largest SIGMA of a lognormal law, and the one from which a note asks whether it is meant.
WIDEST, WIDE = 3.0, 1.0
DesignKind = Literal["lhs", "sobol", "mc"]
DESIGNS: tuple[DesignKind, ...] = get_args(DesignKind)
FEWEST = 16  # fewest draws
MARGIN = 2.0**-31  # from unit samples to 0 and 1: half the resolution of a Sobol' sequence
REMEDY = "lognormal, uniform and triangular can be kept to possible values"


class CasesError(FecmError, ValueError):
    """The cases are invalid."""


def parse_vary(text: str) -> tuple[str, list[Value]]:
    """Read ``NAME=FROM:TO:N`` (N values with both ends) or ``NAME=a,b,c``; else CasesError."""
    name, equals, text_of_values = (part.strip() for part in text.partition("="))
    _known(name, text)
    if not equals or not text_of_values:
        raise CasesError(f"`{text}`: write {name}=FROM:TO:N or {name}=A,B,C")
    if name in TEXTS or ":" not in text_of_values:  # split at commas outside brackets
        parts = re.split(r",(?![^\[]*\]|[^(]*\))", text_of_values)
        if name == "at" and not re.search("[(; ]", text_of_values):
            parts = _points(parts)
        return name, [_value(name, part) for part in parts if part.strip()]
    parts = text_of_values.split(":")
    if len(parts) != 3 or not re.fullmatch(r"\d+", parts[2].strip()) or not int(parts[2]):
        raise CasesError(f"`{text}`: a range is FROM:TO:N with N of at least 1")
    begin, end, count = _number(name, parts[0]), _number(name, parts[1]), int(parts[2])
    if count > MOST:
        raise CasesError(f"`{text}`: {count} values; at most {MOST} are allowed")
    with np.errstate(all="ignore"):
        values = np.linspace(begin, end, count).tolist()
    if not all(map(math.isfinite, values)):
        raise CasesError(f"`{text}`: the range is beyond the range of numbers")
    return name, [_value(name, repr(v)) for v in values]


def _points(numbers: Sequence[str]) -> list[str]:
    """One point from two numbers; CasesError, with the brackets to write, if there are more."""
    if len(numbers) == 2:
        return [",".join(numbers)]
    pairs = [f"({','.join(numbers[n : n + 2])})" for n in range(0, len(numbers) - 1, 2)]
    example = ",".join(pairs) or f"({numbers[0]},Y)"
    raise CasesError(f"at has two numbers a point; write at={example}")


def parse_until(text: str) -> Until:
    """Read ``peak_force=VALUE`` or ``exposure=NUMBER``; CasesError if it is neither."""
    name, _, value = (part.strip() for part in text.partition("="))
    if name not in SOUGHT or not value:
        forms = f"peak_force=NUMBER or peak_force={THRESHOLD}, or exposure=NUMBER"
        raise CasesError(f"`{text}`: write {forms}")
    return {name: parse_exceed(text)[1]}


def sought_of(until: Until | None) -> tuple[str, float | str | None]:
    """Quantity and value of a search; a value alone is a peak force, None no search."""
    if not isinstance(until, Mapping):
        return PEAK_FORCE, until
    if len(until) != 1 or not {*until} <= {*SOUGHT}:
        example = '{"exposure": 1.0}'
        raise CasesError(f"until is {until!r}; write a number, {THRESHOLD!r} or {example}")
    return next(iter(until.items()))


def parse_exceed(text: str) -> Limit:
    """Read ``QUANTITY=NUMBER`` or ``peak_force=threshold``; CasesError if it is neither."""
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value or (value == THRESHOLD and name != "peak_force"):
        raise CasesError(f"`{text}`: write QUANTITY=NUMBER or peak_force={THRESHOLD}")
    return name, value if value == THRESHOLD else _number(name, value)


def check_names(names: Collection[str]) -> None:
    """Raise CasesError if names exclude each other."""
    for group in EXCLUDING:
        if len(given := [name for name in group if name in names]) > 1:
            raise CasesError(f"{given[0]} and {given[1]} exclude each other; vary one of them")


def pair(name: str, text: str) -> tuple[float, float]:
    """Two numbers of a text, as in ``(3,2)`` or ``6x4``; raises CasesError if it has none."""
    form, separators = PAIRS[name]
    parts = re.split(separators, text.strip().removeprefix("(").removesuffix(")").strip())
    if len(parts) != 2:
        raise CasesError(f"{name} must be two numbers as in {form.format(6, 4)}, not `{text}`")
    return _number(name, parts[0]), _number(name, parts[1])


def plate_values(case: Case) -> Case:
    """The values of a case, of :data:`OF_PLATE`."""
    return {name: value for name, value in case.items() if name in OF_PLATE}


def grid(varied: Sequence[tuple[str, Sequence[Value]]]) -> list[Case]:
    """Every combination of the values, the last name fastest; CasesError if there are too many."""
    names = [name for name, _ in varied]
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"{name} is varied twice")
    count = math.prod(len(values) for _, values in varied)
    if not count:
        raise CasesError("a sweep needs at least one case")
    if count > MOST:
        raise CasesError(f"{count} cases; at most {MOST} are allowed")
    combinations = itertools.product(*(values for _, values in varied))
    return [dict(zip(names, values, strict=True)) for values in combinations]


def read_cases(path: Path) -> list[Case]:
    """Read a CSV table, a header of names and one row per case; CasesError states a line."""
    try:
        rows = [(line, row) for line, row in read_rows(path) if any(row)]
    except StudyError as error:
        raise CasesError(str(error)) from None
    if len(rows) < 2:
        raise CasesError(f"{path}: a table of cases has a header of names and at least one row")
    header = rows[0][1]
    for name in header:
        _known(name, f"{path}:{rows[0][0]}")
        if header.count(name) > 1:
            raise CasesError(f"{path}:{rows[0][0]}: column {name} is repeated")
    cases: list[Case] = []
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise CasesError(f"{path}:{line}: {len(row)} values, but {len(header)} names")
        try:
            cases.append({n: _value(n, text) for n, text in zip(header, row, strict=True)})
        except CasesError as error:
            raise CasesError(f"{path}:{line}: {error}") from None
    if len(cases) > MOST:
        raise CasesError(f"{path} has {len(cases)} cases; at most {MOST} are allowed")
    return cases


def combined(vary: Mapping[str, Iterable[Any]], *, free: bool = False) -> list[Case]:
    """Return every combination of lists of values, given by name; with `free` both are any.

    Raises CasesError if a name is unknown, a value is invalid, or values are not in a list.
    """
    if not isinstance(vary, Mapping):
        raise CasesError(f'vary is {vary!r}; write a mapping such as {{"velocity": [50.0, 115.0]}}')
    lists: list[tuple[str, list[Value]]] = []
    for name, given in vary.items():
        values: list[Any] | None = None
        with suppress(TypeError):
            values = None if isinstance(given, str | bytes) else list(given)
        if values is None:
            raise CasesError(f'vary: {name} is one value; write a list: {{"{name}": [{given!r}]}}')
        if not values:
            raise CasesError(f"vary: {name} has no values")
        cases = checked(({name: value} for value in values), "vary", free=free)
        lists.append((name, [case[name] for case in cases]))
    return grid(lists)


def checked(
    cases: Iterable[Mapping[str, Any]], source: str = "", *, free: bool = False
) -> list[Case]:
    """Validate cases given as mappings, which must all have the same names.

    With `free`, the names are any but those of results, and a value is a number or a text.  Raises
    CasesError if a case is invalid; the message states the source, or else the case's number.
    """
    made: list[Case] = []
    remedy = 'write a list of mappings such as [{"velocity": 50.0}]'
    if not isinstance(cases, Iterable):
        raise CasesError(f"cases is {cases!r}; {remedy}")
    for number, case in enumerate(cases):
        where = source or f"case {number}"
        if not isinstance(case, Mapping):
            raise CasesError(f"{where} is {case!r}, not a mapping of names to values; {remedy}")
        for name in case:
            _known(name, where, free)
        if made and case.keys() != made[0].keys():
            raise CasesError(f"{where} has other names than case 0")
        made.append({name: _given(name, v, where, free) for name, v in case.items()})
    if not made:
        raise CasesError("a sweep needs at least one case")
    for name in made[0]:
        if len({isinstance(case[name], str) for case in made}) > 1:
            raise CasesError(f"{name} has numbers and texts")
    return made


def name_fault(name: object) -> str:
    """Why a name can't be that of a column; empty if it can."""
    if not (isinstance(name, str) and name.isidentifier()):
        return f"`{name}` is not a name such as width"
    return f"`{name}` is a name of the results; choose another" if name in RESERVED else ""


def _given(name: str, value: Any, where: str, free: bool) -> Value:
    if isinstance(value, np.generic):
        value = value.item()
    if free:
        if isinstance(value, str) or (isinstance(value, float | int) and math.isfinite(value)):
            return value
        raise CasesError(f"{where}: {name} is {value!r}, not a finite number or a text")
    if name in TEXTS and isinstance(value, Iterable) and not isinstance(value, str):
        value = {"at": ",", "size": "x"}.get(name, "/").join(map(str, value))
    try:
        return _value(name, value if isinstance(value, str) else repr(float(value)))
    except (TypeError, ValueError) as error:
        text = str(error) if isinstance(error, CasesError) else f"{name} can't be {value!r}"
        raise CasesError(f"{where}: {text}") from None


def _known(name: str, where: str, free: bool = False) -> None:
    if fault := name_fault(name) if free else "":
        raise CasesError(f"{where}: {fault}")
    if not free and name not in NAMES:
        others = did_you_mean(name, NAMES) or f"; the names are {', '.join(NAMES)}"
        raise CasesError(f"{where}: `{name}` cannot be varied{others}")


def _number(name: str, text: str) -> float:
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise CasesError(f"{name} must be a finite number, not `{text.strip()}`")


def _value(name: str, text: str) -> Value:
    if name in PAIRS:
        return PAIRS[name][0].format(*(repr(v).removesuffix(".0") for v in pair(name, text)))
    if name == "support" and text.strip() not in SUPPORTS:
        raise CasesError(f"support must be {', '.join(SUPPORTS)}, not `{text.strip()}`")
    if name in TEXTS:
        return text.strip()
    value = 0.0 if name == "dt" and text.strip() == "auto" else _number(name, text)
    if name not in INTEGERS:
        return value
    if not value.is_integer():
        raise CasesError(f"{name} must be an integer, not {value:g}")
    return int(value)


class Law(NamedTuple):
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
    if free:
        _known(name, "random", free)
    elif name not in numbers:
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
    law = Law(kind, parameters)
    if kind == "lognormal" and parameters[1] > WIDEST:
        raise CasesError(f"{name}: {_of_logarithm(law)}; it is at most {WIDEST:g}")
    return law


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
    if samples is None or samples < FEWEST:
        raise CasesError(f"{samples} samples are too few; take at least {FEWEST}")
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
        if law.kind == "lognormal" and law.parameters[1] >= WIDE
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
    if (count := len(varied) * design.rows) > MOST:
        raise CasesError(f"{count} cases; at most {MOST} are allowed")
    rows = [dict(zip(design.laws, row, strict=True)) for row in matrix(design).tolist()]
    return [{**case, **row} for case in varied for row in rows]


def cost(cases: Sequence[Case], design: Design, *, shared: bool) -> str:
    """Say how many plates a random sweep needs, and which names cause them."""
    given = f"{design.draws} draws"
    if len(cases) != design.draws:
        given = f"{len(cases)} cases of {given}"
    if not shared:
        return f"{given} are run in full, one by one"
    plates = len({frozenset(plate_values(case).items()) for case in cases})
    causes = [name for name in design.laws if name in PLATE]
    if not causes:
        return f"{given} share {plates} plate{'s' * (plates > 1)}"
    why = f"because {' and '.join(causes)} {'is' if len(causes) == 1 else 'are'} random"
    others = "velocity, k, alpha_p, s_p, q and the projectile share one"
    return f"{given} need {plates} plates, {why}; {others}"
