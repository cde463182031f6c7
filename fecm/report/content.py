"""Content of a page, and its HTML.

A page begins with a first sheet: title and particulars, answers, headline figures, and some blocks.
Sections of tables, judgements, notes, pictures and listings follow. Numbers keep their value beside
the text that shows them, so that a program can read them from the page: ``<data
value="16169.7">16170 N</data>``.

The page is one file. It contains style and pictures, fetches nothing and runs no script. Equal
content gives equal bytes. Jinja2, an optional library, fills the template and escapes all texts.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from fecm._errors import FecmError
from fecm._files import beside, check_outputs
from fecm._table import Cell, Row, ShownNumber, Table
from fecm._text import DIGITS, printable
from fecm._version import __version__
from fecm.deck.units import prefixed
from fecm.judge.limits import Judgement, TrustLevel
from fecm.plot.pictures import require_matplotlib
from fecm.results.written import PageOptions

UNKNOWN = "–"  # of a value that is not known
MOST_TEXT = 200_000  # characters of a listing


@dataclass(frozen=True)
class Judgements:
    """Table of judgements."""

    rows: tuple[Judgement, ...]
    title: str = ""


@dataclass(frozen=True)
class Notes:
    """List of sentences."""

    texts: tuple[str, ...]
    title: str = ""


@dataclass(frozen=True)
class PagePicture:
    """A picture inside the page."""

    source: str  # ``data:`` address
    alternative: str  # what it shows, in words, for readers who do not see it
    caption: str
    wide: bool = False


@dataclass(frozen=True)
class Listing:
    """Long text, folded."""

    title: str
    text: str


# Parts of a section.  Each kind has a macro of its name in page.html.
PageBlock = Table | Judgements | Notes | PagePicture | Listing


class PageSection(NamedTuple):
    """Heading and the blocks below it."""

    title: str
    blocks: tuple[PageBlock, ...]


class Answer(NamedTuple):
    """Answer to a question, in the verdict."""

    question: str
    answer: str  # a word or two
    rest: str = ""


class Headline(NamedTuple):
    """Figure of the first sheet, with what qualifies it."""

    name: str
    value: Cell
    remarks: tuple[str, ...] = ()  # lines below the value


class ReportPage(NamedTuple):
    """Page about one or more results."""

    title: str
    verdict: tuple[str | Answer, ...]  # answers, and sentences
    level: TrustLevel  # the worst of the page
    sections: tuple[PageSection, ...]
    subject: str = ""  # a sentence below the title
    headlines: tuple[Headline, ...] = ()
    first_sheet: tuple[PageBlock, ...] = ()  # below the headlines
    particulars: tuple[tuple[str, str], ...] = ()  # of the page, by name
    logo: str = ""  # ``data:`` address


def number_with_unit(value: float, unit: str = "", digits: int = DIGITS) -> Cell:
    """Return a number with its unit, or a dash if the number is not known."""
    return (
        UNKNOWN if math.isnan(value) else ShownNumber(float(value), prefixed(value, unit, digits))
    )


def share(value: float, digits: int = 3) -> Cell:
    """Return a ratio in per cent."""
    return (
        UNKNOWN if math.isnan(value) else ShownNumber(float(value), f"{100.0 * value:.{digits}g} %")
    )


def page_table(rows: Iterable[Row], header: Sequence[str] = (), title: str = "") -> list[PageBlock]:
    """Return a list of one table, which is empty without rows."""
    table = Table(tuple(rows), tuple(header), title)
    return [table] if table.rows else []


def note_list(texts: Iterable[str], title: str = "") -> list[PageBlock]:
    """Return a list of one list of sentences, which is empty without sentences."""
    unique = tuple(dict.fromkeys(texts))
    return [Notes(unique, title)] if unique else []


def listing(title: str, text: str) -> Listing:
    """Return a listing, cut where it would make the page large."""
    if len(text) <= MOST_TEXT:
        return Listing(title, text)
    kept = text[:MOST_TEXT].rpartition("\n")[0]
    omitted = text.count("\n") - kept.count("\n") - 1
    return Listing(title, f"{kept}\n... {omitted} more lines, which the result has")


def sections(titled: Iterable[tuple[str, Iterable[PageBlock]]]) -> tuple[PageSection, ...]:
    """Return sections of titles and blocks, without those that have no blocks."""
    filled = ((title, tuple(blocks)) for title, blocks in titled)
    return tuple(PageSection(title, blocks) for title, blocks in filled if blocks)


def worst(judgements: Iterable[Judgement]) -> TrustLevel:
    """Return the worst level of judgements."""
    order = (TrustLevel.OUTSIDE, TrustLevel.DOUBTFUL)
    levels = {judgement.level for judgement in judgements}
    return next((level for level in order if level in levels), TrustLevel.WITHIN)


LOGOS = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".svg": "image/svg+xml",
}
MOST_LOGO = 300_000  # bytes
PARTICULARS = ("author", "client", "project", "specimen", "date")


def with_head(page: ReportPage, options: PageOptions) -> ReportPage:
    """Return a page with the title, the particulars and the logo of the options.

    Raises ReportError if the logo is no picture that a page can contain.
    """
    values = [(name, getattr(options, name)) for name in PARTICULARS]
    return page._replace(
        title=options.title or page.title,
        particulars=tuple((name, value) for name, value in values if value),
        logo=_logo(Path(options.logo)) if options.logo else "",
    )


def _logo(path: Path) -> str:
    """Return a picture as a ``data:`` address."""
    kind = LOGOS.get(path.suffix.lower())
    if kind is None:
        raise ReportError(f"{path}: a logo is a picture in {', '.join(LOGOS)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ReportError(f"{path}: the logo can't be read: {error.strerror}") from None
    if len(data) > MOST_LOGO:
        most = f"{MOST_LOGO // 1000} kB"
        raise ReportError(f"{path}: the logo has {len(data) / 1000:.0f} kB; at most {most} fit")
    return data_address(data, kind)


def data_address(data: bytes, kind: str) -> str:
    """Return bytes of a media type as a ``data:`` address."""
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


MISSING = "report pages need Jinja2: pip install 'fecm[report]'"
SUFFIXES = (".html", ".htm")


class ReportError(FecmError, ValueError):
    """A page can't be made from these results."""


class Jinja2Error(FecmError, ImportError):
    """Jinja2 is not installed."""


def require_jinja2() -> None:
    """Raise Jinja2Error, which says what to install, if Jinja2 is absent."""
    try:
        import jinja2  # noqa: F401
    except ImportError:
        raise Jinja2Error(MISSING) from None


def render(page: ReportPage) -> str:
    """Return the HTML of a page.  Raises Jinja2Error if Jinja2 is not installed."""
    require_jinja2()
    import jinja2  # 40 ms, and an extra that may be absent

    room = resources.files("fecm.report")
    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        finalize=_shown,
    )
    environment.filters["repr"] = repr
    environment.filters["kind"] = _kind
    environment.filters["css"] = _css_text
    template = environment.from_string(room.joinpath("page.html").read_text("utf-8"))
    style = room.joinpath("page.css").read_text("utf-8")
    return template.render(page=page, style=style, version=__version__)


def _kind(block: PageBlock) -> str:
    """Return the name of the macro of a block."""
    return type(block).__name__.removeprefix("Page").lower()


def _css_text(text: str) -> str:
    """Return a text as a string of CSS, in which all but letters and digits are escaped."""
    letters = (c if c.isascii() and c.isalnum() else f"\\{ord(c):x} " for c in printable(text))
    return f'"{"".join(letters)}"'


def _shown(value: object) -> object:
    """Return a text without control characters, which HTML does not allow."""
    if type(value) is not str:
        return value
    return "\n".join(printable(line) for line in value.split("\n"))


def write(page: ReportPage, path: Path, *, overwrite: bool) -> None:
    """Write a page as a file, completely or not at all; see :func:`check_page`."""
    text = render(page)
    with beside(path, overwrite=overwrite) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def check_page(path: Path, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse a page that can't be written, before anything is computed.

    Raises ReportError if the suffix of the name is not .html. Raises OutputError if the file can't
    be written, is one of the inputs, or exists and may not be replaced. Raises ImportError without
    Jinja2 or matplotlib.
    """
    require_jinja2()
    require_matplotlib()
    if path.suffix.lower() not in SUFFIXES:
        raise ReportError(f"{path}: a report page is written as {SUFFIXES[0]}")
    check_outputs([path], overwrite, inputs)
