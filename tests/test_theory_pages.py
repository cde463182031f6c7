"""The pages on theory: their references, and the numbers of the report's equations."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import fromstring

import pytest

from tests.decks import ROOT

PAGES = sorted((ROOT / "docs").glob("theory*.md"))
LIST = "## References"
YEAR = r"(?:19|20)\d\d"
NAME = r"[A-ZÅ][\w-]+"
# Authors and year, such as "Irons and Treharne 1971" or "Saltelli et al. 2010".
CITED = re.compile(rf"({NAME})(?:(?:, {NAME})* and {NAME}| et al\.)? ({YEAR})\b")
# First author and year of an entry of the list.
LISTED = re.compile(rf"^- [^,]*?({NAME})(?: and |,)(?:(?!\n- ).)*?\b({YEAR})\b", re.M | re.S)
# Largest number of an equation in each chapter of the report.
EQUATIONS = {2: 87, 3: 12, 4: 26}


def body(text: str) -> str:
    """The text before the references, in one line."""
    return " ".join(text.split(LIST)[0].split())


def test_every_work_that_is_cited_is_listed_and_every_one_that_is_listed_is_cited() -> None:
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    (references,) = (text.split(LIST)[1] for text in texts if LIST in text)
    cited = {actual for text in texts for actual in CITED.findall(body(text))}
    listed = set(LISTED.findall(references))
    assert len(listed) > 30
    assert cited == listed


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_equations_of_the_report_that_are_named_exist(page: Path) -> None:
    text = body(page.read_text(encoding="utf-8"))
    named = re.findall(r"(?<![\d.–-])([2-4])-(\d+)(?![\d-])", text)
    assert all(1 <= int(number) <= EQUATIONS[int(chapter)] for chapter, number in named)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
@pytest.mark.few(3)  # of 7, 0.05 s each
def test_every_formula_becomes_mathml_without_commands_that_are_left_over(page: Path) -> None:
    convert = pytest.importorskip("latex2mathml.converter").convert
    text = page.read_text(encoding="utf-8")
    for formula in map("".join, re.findall(r"\$\$(.+?)\$\$|\$([^$]+)\$", text, re.S)):
        drawn = convert(formula)
        fromstring(drawn)  # a ParseError if an environment such as `aligned` is unknown
        assert "\\" not in drawn, formula
