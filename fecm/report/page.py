"""From the content of a page to its HTML.

The page is one file: style and pictures stand inside, nothing is fetched, no script runs.  Equal
content gives equal bytes.  Jinja2, an optional library, fills the template and escapes all texts.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import resources
from pathlib import Path

from fecm._errors import FecmError
from fecm._files import OPTION, beside, check_outputs
from fecm._text import printable
from fecm._version import __version__
from fecm.plot.pictures import require_matplotlib
from fecm.report.content import Page

MISSING = "reports need Jinja2: pip install 'fecm[report]'"
SUFFIXES = (".html", ".htm")


class ReportError(FecmError, ValueError):
    """A page can't be made of these results."""


class Jinja2Error(FecmError, ImportError):
    """Jinja2 is not installed."""


def require_jinja2() -> None:
    """Raise Jinja2Error, which says what to install, if Jinja2 is absent."""
    try:
        import jinja2  # noqa: F401
    except ImportError:
        raise Jinja2Error(MISSING) from None


def render(page: Page) -> str:
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
    template = environment.from_string(room.joinpath("page.html").read_text("utf-8"))
    style = room.joinpath("page.css").read_text("utf-8")
    return template.render(page=page, style=style, version=__version__)


def _shown(value: object) -> object:
    """Texts without control characters, which HTML does not allow."""
    if type(value) is not str:
        return value
    return "\n".join(printable(line) for line in value.split("\n"))


def write(page: Page, path: Path, *, overwrite: bool) -> None:
    """Write a page as a file, completely or not at all; see :func:`check_page`."""
    text = render(page)
    with beside(path, overwrite=overwrite) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def check_page(
    path: Path, overwrite: bool, inputs: Iterable[Path] = (), *, allowed_by: str = OPTION
) -> None:
    """Refuse a page that can't be written, before anything is computed.

    Raises ReportError for a name without the suffix .html, OutputError if the file exists and may
    not be replaced, is one of the inputs, or can't be written, ImportError without Jinja2 or
    matplotlib.
    """
    require_jinja2()
    require_matplotlib()
    if path.suffix.lower() not in SUFFIXES:
        raise ReportError(f"{path}: a report is written as {SUFFIXES[0]}")
    check_outputs([path], overwrite, inputs, allowed_by=allowed_by)
