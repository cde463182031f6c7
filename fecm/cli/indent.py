"""``fecm indent``: indentation tests, and the contact law that follows from them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from click import option

from fecm._errors import StudyError
from fecm._typing import Floats
from fecm.cli.common import RefusedError, echo, echo_findings, note
from fecm.cli.laminate_options import LaminateOptions, as_options, laminate_options
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    NOT_NEGATIVE,
    POSITIVE,
    SYSTEM,
    Finite,
    Format,
    HelpGroup,
    OneOf,
    collected,
    list_of,
    stack_options,
    typical,
)
from fecm.cli.outputs import OutputPaths, outputs
from fecm.deck import catalogue
from fecm.deck.catalogue import CONTACTS
from fecm.deck.model import Deck, Indentation
from fecm.deck.reader import Reader, load_text
from fecm.deck.units import KNOWN, convert, unit_names, units_of
from fecm.mechanics import contact_law
from fecm.mechanics.contact_law import LinearPermanent, YangSunPermanent, hertz_coefficient
from fecm.mechanics.half_space import effective_stiffness, indentation_modulus
from fecm.problem.check import check_segment
from fecm.problem.parts import build_constants
from fecm.studies.indentation_test.curves import LIMITS_Q
from fecm.studies.indentation_test.study import fit_law
from fecm.studies.indentation_test.turns import read_test

PARAMETERS = ("acr", "columns", "units")  # of fits, which messages name
# Largest indentation over the critical one, where --permanent ends by default.
REACH = 6.0
REACH_ACR = 2.0  # of equation 3-7, whose critical indentation is larger
Row = tuple[object, ...]  # of a table; the first value is the name of the law
RATE = (
    "The report loaded at about 10 lb/s. k hardly depended on the rate from 5 to 50 lb/s, and fell "
    "below\n1 lb/s; the k of yang-0.5, read from a dial gage under held loads, is 27 % less than "
    "the k of report-0.5.\nThe report uses q = 2.5 and 2.0; q = 2.2 and 1.8 (the laws -fit) fit "
    "its unloading curves best."
)


@click.group("indent", cls=HelpGroup)
def indent_command() -> None:
    """Fit, evaluate and list contact laws (the report's chapter 3)."""


@dataclass(frozen=True)
class FitOptions:
    """Argument and options of ``fecm indent fit``."""

    test: Path
    acr: bool
    q: float | None
    turn: float | None
    columns: tuple[str, str] | None
    units: tuple[str, str] | None
    targets: OutputPaths
    form: Format


@indent_command.command(
    "fit",
    epilog=typical(
        "fecm indent fit indentation-test.csv --plot fit.png",
        "fecm indent fit indentation-test.csv --unit mm,N --acr",
    ),
)
@click.argument("test", type=DECK_PATH, metavar="TEST.csv")
@option(
    "--acr",
    is_flag=True,
    help="Fit alpha_cr of the law with one unloading rigidity (q = 5/2) instead of s_p and "
    "alpha_p.",
)
@option("--q", type=Finite(*LIMITS_Q), help="Prescribed unloading power; fitted by default.")
@option(
    "--turn",
    type=POSITIVE,
    metavar="LENGTH",
    help="Decrease of the indentation that counts as a turn.  [default: 2 % of its range, or 8 "
    "standard deviations of its noise]",
)
@option(
    "--columns",
    type=list_of("INDENTATION,FORCE", click.STRING, [2]),
    help="Names or numbers (from 1) of the two columns; a minus before one changes its sign.  "
    "[default: indentation, displacement, extension, stroke or depth; force or load]",
)
@option(
    "--unit",
    "--units",
    "units",
    type=list_of("LENGTH,FORCE", click.STRING, [2]),
    help="Units of the card, to which a file that names its units is converted.  [default: "
    "in,lbf or mm,N or m,N, whichever is nearest to the file's]",
)
@outputs("test", table=False)
@FORMAT_OPTION
@collected(FitOptions)
def fit_command(options: FitOptions) -> None:
    """Fit the indentation law to a test, and print its parameters and EXPE card.

    TEST.csv has the columns indentation and force, with rows in the order of measurement: first
    loading, unloading, reloading, in any number of cycles.  Commas, semicolons or tabs separate
    the columns.  Units are in brackets after the names, or in the line below.
    """
    test = options.test
    if options.acr and options.q not in (None, contact_law.ACR_POWER):
        raise click.UsageError("--acr requires q = 5/2: equation 3-7 holds for no other power")
    try:
        read = read_test(test, options.columns or (), options.units)
    except StudyError as error:
        raise RefusedError(as_options(str(error), PARAMETERS)) from None
    try:
        fit = fit_law(read, q=options.q, acr=options.acr, turn=options.turn)
    except StudyError as error:
        raise RefusedError(as_options(f"{test}: {error}", PARAMETERS)) from None
    names = {**read.units, "time": "s"} if read.units else {}
    options.targets.draw(
        "studies:indentation_fit_picture", read.indentation, read.force, fit.fit, names
    )
    note(*(as_options(text, PARAMETERS) for text in fit.notes))
    if options.form is Format.JSON:
        click.echo(json.dumps({"file": str(test), **fit.to_dict()}))
    else:
        echo(fit)


def _law(deck: Path) -> tuple[Deck, Indentation]:
    """Return the first problem of a deck that has an EXPE segment, and the segment."""
    reader = Reader(load_text(deck)[0])
    decks = [problem.deck for problem in reader.problems() if problem.deck is not None]
    laws = [(deck, law) for deck in decks if (law := deck.last(Indentation)) is not None]
    if laws:
        check_segment(laws[0][1], reader.findings)
    echo_findings(reader.findings, str(deck))
    if reader.findings.errors:
        raise RefusedError(f"{deck} has errors")
    if not laws:
        raise RefusedError(f"{deck} has no indentation law: it has no EXPE segment")
    return laws[0]


@dataclass(frozen=True)
class CurveOptions:
    """Argument and options of ``fecm indent curve``."""

    deck: Path | None
    contacts: tuple[str, ...] | None
    units: str | None
    path: tuple[float, ...] | None  # indentations at which it turns, or a range of them
    points: int
    permanent: bool
    rigidity: bool
    q: float | None
    alpha_cr: float | None
    line: tuple[float, float] | None  # alpha_p and s_p
    targets: OutputPaths

    def laws(self) -> tuple[dict[str, Indentation], dict[str, str]]:
        """Return the named laws, or the law of the deck, and the names of their units."""
        if (self.deck is None) == (self.contacts is None):
            raise click.UsageError("give a DECK or --contact, not both")
        if self.deck is not None:
            if self.units is not None:
                raise click.UsageError("--units are the units of --contact; a deck has its own")
            problem, card = _law(self.deck)
            return {"": card}, unit_names(problem)
        system = self.units or catalogue.SYSTEM
        names = self.contacts or ()
        return {name: CONTACTS[name].converted(system) for name in names}, units_of(system)

    def write(self, columns: dict[str, str], units: dict[str, str], rows: Iterable[Row]) -> None:
        """Write the rows of a table. The rows of named laws begin with the name."""
        named = {"contact": "", **columns} if self.contacts else columns
        skipped = 0 if self.contacts else 1
        self.targets.write(named, units, (row[skipped:] for row in rows))


@indent_command.command(
    epilog=typical(
        "fecm indent curve impact-patch.inp --path 1.5e-3,0,2.5e-3,0 -o path.csv",
        "fecm indent curve --contact report-0.5,report-0.75 --path 2e-3,0 --plot laws.png",
        "fecm indent curve impact-patch.inp --rigidity --q 2.5 --plot rigidity.png",
    )
)
@click.argument("deck", type=DECK_PATH, required=False)
@option(
    "--contact",
    "contacts",
    type=list_of("NAME,...", OneOf(list(CONTACTS))),
    help="Named laws (`fecm indent contacts`) instead of DECK's.",
)
@option(
    "--units",
    type=SYSTEM,
    help=f"Units of --contact and of --path.  [default: {catalogue.SYSTEM}]",
)
@option(
    "--path",
    type=list_of("A,B,C,...", Finite()),
    help="Indentations at which the path turns, from 0; with --permanent and --rigidity the range "
    "FROM,TO of alpha_m.",
)
@option(
    "--points",
    type=click.IntRange(min=1, max=100_000),
    default=100,
    show_default=True,
    help="Points between two turns.",
)
@option(
    "--permanent",
    is_flag=True,
    help="Tabulate the permanent indentation alpha_0 over alpha_m instead, by equation 3-8, or by "
    "3-7 of a law with ACR.",
)
@option(
    "--rigidity",
    is_flag=True,
    help="Tabulate the unloading rigidity s over alpha_m by equations 3-9 and 3-7 instead.",
)
@option("--q", type=POSITIVE, help="With --rigidity: power of 3-9.  [default: the law's]")
@option(
    "--alpha-cr",
    type=POSITIVE,
    help="With --rigidity: alpha_cr of 3-7.  [default: the law's, or the report's]",
)
@option(
    "--line",
    type=list_of("ALPHA_P,S_P", NOT_NEGATIVE, [2]),
    help="With --rigidity: parameters of 3-8.  [default: the law's, or the report's]",
)
@outputs("deck")
@collected(CurveOptions)
def curve(options: CurveOptions) -> None:
    """Write the force along an indentation path as CSV (figures 3.2 to 3.19).

    The law is the law of DECK, or --contact names one or several.  The columns are indentation,
    force and the branch of the law; with --permanent alpha_m and alpha_0; with --rigidity alpha_m,
    s_3_9 and s_3_7.  The rows of named laws begin with the name.
    """
    if options.permanent and options.rigidity:
        raise click.UsageError("--permanent and --rigidity exclude each other")
    if options.rigidity:
        _rigidities(options)
        return
    if any(value is not None for value in (options.q, options.alpha_cr, options.line)):
        raise click.UsageError("--q, --alpha-cr and --line require --rigidity")
    if options.permanent:
        _permanents(options)
        return
    if not options.path:
        raise click.UsageError("--path is missing: indentations separated by commas")
    cards, units = options.laws()
    curves, rows = {}, []
    branches = ("loading", "unloading", "reloading")
    for name, card in cards.items():
        law = contact_law.HystereticLaw(build_constants(card))
        try:
            walk = list(contact_law.follow(law, options.path, options.points))
        except OverflowError:
            walk = []
        if not walk or not all(math.isfinite(point.force) for point, _ in walk):
            raise RefusedError("the forces along --path overflow")
        curves[name] = np.array([point for point, _ in walk]).T
        rows += [(name, *point, branches[branch]) for point, branch in walk]
    options.targets.draw("studies:path_picture", curves, units)
    options.write({"indentation": "length", "force": "force", "branch": ""}, units, rows)


def _peaks(options: CurveOptions, name: str, default: float) -> Floats:
    """Return the largest indentations of --path, by default from 0 to a value."""
    path = options.path
    if path and (len(path) != 2 or not 0.0 <= path[0] < path[1]):
        raise click.BadParameter(f"with --{name} the range FROM,TO", param_hint="--path")
    low, high = path or (0.0, default)
    if not high > 0.0:
        raise click.UsageError(f"the law has no permanent indentation; --{name} needs --path")
    return np.linspace(low, high, options.points + 1)


def _permanents(options: CurveOptions) -> None:
    """Write largest and permanent indentations by 3-8, or 3-7 (figure 3.6)."""
    cards, units = options.laws()
    reach = max((REACH_ACR if law.word else REACH) * law.alpha_p for law in cards.values())
    peaks = _peaks(options, "permanent", reach)
    curves = {
        name: np.array([peaks, build_constants(card).permanent(peaks)])
        for name, card in cards.items()
    }
    options.targets.draw("studies:permanent_picture", curves, units)
    rows = [(name, *point) for name, curve in curves.items() for point in curve.T.tolist()]
    options.write({"alpha_m": "length", "alpha_0": "length"}, units, rows)


def _rigidities(options: CurveOptions) -> None:
    """Write largest indentations and rigidities by both equations (figure 3.19)."""
    line, targets = options.line, options.targets
    if line is not None and line[1] >= 1.0:
        raise click.BadParameter("s_p must be below 1", param_hint="--line")
    cards, names = options.laws()
    if len(cards) > 1:
        raise click.UsageError("--rigidity takes one law")
    ((name, card),) = cards.items()
    slope, critical = _permanent(names, card, options)
    if slope.q != contact_law.ACR_POWER:
        units = f"s of 3-9 is force/length^{slope.q:g} here, s of 3-7 is force/length^2.5"
        if targets.picture:
            raise RefusedError(f"{units}: they can't share axes; --q 2.5 makes them comparable")
        note(f"{units}: --q 2.5 makes them comparable")

    peaks = _peaks(options, "rigidity", 2.0 * max(critical.alpha_cr, slope.alpha_p))
    peaks = peaks[peaks > 0.0]
    with np.errstate(all="ignore"):
        by = [np.asarray(relation.rigidity(peaks)) for relation in (slope, critical)]
    if not np.all(np.isfinite(by)):
        raise RefusedError("the rigidities along --path overflow")
    named = dict(zip(("equation 3-9", "equation 3-7"), by, strict=True))
    targets.draw("studies:rigidity_picture", peaks, named, slope.q, names)
    dimensions = {
        "alpha_m": "length",
        "s_3_9": f"force/length^{slope.q:g}",
        "s_3_7": f"force/length^{contact_law.ACR_POWER:g}",
    }
    rows = np.column_stack([peaks, *by]).tolist()
    options.write(dimensions, names, ((name, *row) for row in rows))


def _permanent(
    units: dict[str, str], card: Indentation, options: CurveOptions
) -> tuple[LinearPermanent, YangSunPermanent]:
    """Return the permanent indentations of 3-8 and 3-7: of the options, the law, or the report."""
    constants = build_constants(card)
    line, alpha_cr = options.line, options.alpha_cr
    if line is None and isinstance(constants, LinearPermanent):
        line = float(constants.alpha_p), float(constants.s_p)
    elif line is None:
        line = _report_length(units, catalogue.ALPHA_P, "alpha_p", "--line"), catalogue.S_P
    if alpha_cr is None and isinstance(constants, YangSunPermanent):
        alpha_cr = float(constants.alpha_cr)
    elif alpha_cr is None:
        alpha_cr = _report_length(units, catalogue.ALPHA_CR, "alpha_cr", "--alpha-cr")
    q = constants.q if options.q is None else options.q
    return LinearPermanent(card.k, *line, q), YangSunPermanent(card.k, alpha_cr)


def _report_length(units: dict[str, str], value: float, name: str, flag: str) -> float:
    """Convert a length of the report to the unit of a law, by default inches, and note it."""
    unit = units.get("length", "in")
    if unit not in KNOWN["length"]:
        message = f"the report's {name} is in inches and the deck's in {unit}: give {flag}"
        raise RefusedError(message)
    note(f"{name} is the report's {value:g} in; {flag} replaces it")
    return convert(value, "length", catalogue.SYSTEM, f"{unit}-N-s")


@dataclass(frozen=True)
class SphereOptions:
    """Options of an indenter."""

    radius: float
    e_s: float  # Young's modulus
    nu_s: float  # Poisson's ratio

    def coefficient(self, modulus: float) -> float:
        """Return the contact coefficient k (equation 3-2) of a solid with a modulus."""
        try:
            return hertz_coefficient(self.radius, self.e_s, self.nu_s, modulus)
        except ValueError as error:
            raise click.UsageError(str(error)) from None


@dataclass(frozen=True)
class CardOptions:
    """Parameters of an EXPE card other than its coefficient."""

    alpha_p: float
    s_p: float
    q: float

    def print(self, k: float, form: Format, **others: float) -> None:
        """Print the card of a coefficient, and in JSON the coefficient and other values."""
        law = Indentation(float(f"{k:.6g}"), self.alpha_p, self.s_p, self.q).text()
        click.echo(json.dumps({"k": k, **others, "card": law}) if form is Format.JSON else law)


SPHERE = stack_options(
    option("--radius", type=float, required=True, help="Radius of the sphere."),
    option("--es", "e_s", type=float, required=True, help="Young's modulus of the sphere."),
    option("--nus", "nu_s", type=float, required=True, help="Poisson's ratio of the sphere."),
    collected(SphereOptions, "sphere"),
)
CARD = stack_options(
    option(
        "--alpha-p",
        type=NOT_NEGATIVE,
        default=0.0,
        show_default=True,
        help="Critical indentation for the card.",
    ),
    option(
        "--s-p",
        type=Finite(0.0, 1.0, max_open=True),
        default=0.0,
        show_default=True,
        help="Slope of permanent indentation for the card.",
    ),
    option(
        "--q",
        type=POSITIVE,
        default=1.5,
        show_default=True,
        help="Unloading power for the card; 1.5 is elastic.",
    ),
    collected(CardOptions, "card"),
)


@indent_command.command(
    epilog=typical(
        "fecm indent hertz --radius 0.25 --es 30e6 --nus 0.3 --et 1.15e6",
        "fecm indent hertz --radius 8 --es 207000 --nus 0.3 --et 11400 --format json",
    )
)
@SPHERE
@option(
    "--et",
    "e_t",
    type=float,
    required=True,
    help="Young's modulus of the laminate through its thickness.",
)
@CARD
@FORMAT_OPTION
def hertz(sphere: SphereOptions, e_t: float, card: CardOptions, form: Format) -> None:
    """Print the EXPE card of a sphere in Hertzian contact, with k of equation 3-2.

    All values are in one system of units.  By default the law is elastic.
    """
    k = sphere.coefficient(e_t)
    if not 0.0 < k < math.inf:
        raise click.UsageError("k is not a finite number: check radius and moduli, and their units")
    card.print(k, form)


@indent_command.command(
    "estimate",
    epilog=typical(
        'fecm indent estimate --layup "[0/90]4s" --ply-thickness .131 --material IM7/8552 '
        "--units mm-N-s --radius 8 --es 207000 --nus 0.3",
        'fecm indent estimate --layup "[0/90]4s" --ply-thickness .25 '
        "--ply 1.6e-9,.3,140000,9000,5000,5000,3000 --radius 8 --es 207000 --nus 0.3",
    ),
)
@laminate_options(required=True, thickness_required=True)
@option(
    "--nu23",
    type=Finite(),
    help="Poisson's ratio of the ply across the fibres.  [default: the named ply's, or "
    "E2/(2 G23) - 1]",
)
@SPHERE
@CARD
@FORMAT_OPTION
def estimate_k_command(
    laminate: LaminateOptions,
    nu23: float | None,
    sphere: SphereOptions,
    card: CardOptions,
    form: Format,
) -> None:
    """Estimate k of a laminate from its elastic constants, and print its EXPE card.

    By the indentation modulus M of the laminate's effective solid, and by its E2 for comparison.
    Measured coefficients may be larger: the report's plate under the 0.5 in indenter has
    1.330e6 lb/in^1.5, where M gives 1.084e6 and E2 0.741e6.  By default the law is elastic.
    """
    layup, thickness = laminate.angles, laminate.thickness
    if thickness is None:
        raise click.UsageError("--ply-thickness is of a layup without letters here")
    constants = laminate.constants()
    if nu23 is None:
        nu23 = (
            laminate.named.nu23 if laminate.named else catalogue.nu23_of(constants, laminate.units)
        )
    stiffness = effective_stiffness(constants, layup, [thickness] * len(layup), nu23)
    modulus = indentation_modulus(stiffness)
    k, by_e2 = sphere.coefficient(modulus), sphere.coefficient(constants.e2)
    if form is Format.TEXT:
        echo(f"modulus M   {modulus:.6g}")
        echo(f"k by M      {k:.6g}")
        echo(f"k by E2     {by_e2:.6g}")
    card.print(k, form, modulus=modulus, k_by_e2=by_e2)


@indent_command.command(
    "contacts",
    epilog=typical(
        "fecm indent contacts",
        "fecm indent contacts report-0.5 --units mm-N-s",
    ),
)
@click.argument("name", type=OneOf(list(CONTACTS)), metavar="[NAME]", required=False)
@option(
    "--units",
    type=SYSTEM,
    default=catalogue.SYSTEM,
    show_default=True,
    help="Units of the parameters.",
)
@FORMAT_OPTION
def contacts_command(name: str | None, units: str, form: Format) -> None:
    """List the named laws of `fecm new --contact`, or print the EXPE card of one."""
    for contact in [CONTACTS[name]] if name else list(CONTACTS.values()):
        law = contact.converted(units)
        if form is Format.JSON:
            values = {field: getattr(law, field) for field in ("k", "alpha_p", "s_p", "q", "word")}
            about = {"units": units, "source": contact.source, "card": law.text()}
            click.echo(json.dumps({"name": contact.name, **values, **about}))
        elif name:
            echo(law.text())
        else:
            critical = "alpha_cr" if law.word else "alpha_p"
            line = "" if law.word else f", s_p {law.s_p:g}"
            echo(f"{contact.name} ({units})")
            echo(f"  k {law.k:g}, {critical} {law.alpha_p:g}{line}, q {law.q:g}")
            echo(f"  {contact.source}")
    if name is None and form is Format.TEXT:
        echo(f"\n{RATE}")
