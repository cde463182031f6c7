"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.report.content import render as render
from fecm.report.report import page_of as page_of
