"""The commands and snippets of the README and the pages run, and print what the pages show."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.decks import ROOT
from tests.pages import read_page
from tests.printed import differences, outputs

PAGES = ["README.md"] + [
    f"docs/{page.name}"
    for page in sorted((ROOT / "docs").glob("*.md"))
    if re.search(r"^ *```(sh|python|text\n *\$ )", page.read_text(encoding="utf-8"), re.M)
]


@pytest.fixture(autouse=True)
def _close_figures() -> object:
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


def test_the_readme_shows_what_its_commands_print_and_the_figures_of_its_page(
    tmp_path: Path,
) -> None:
    readme = ROOT / "README.md"
    blocks = [differences(shown, output) for shown, output in outputs(readme, tmp_path)]
    assert len(blocks) == 2
    assert not any(blocks)
    page = read_page((tmp_path / "plate.html").read_text(encoding="utf-8"))
    text = readme.read_text(encoding="utf-8")
    figures = [[cell.text for cell in figure[:3]] for figure in page.terms]
    assert len(figures) == 6
    assert [row for row in figures if f"| {' | '.join(row)} |" not in text] == []


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES)
def test_the_blocks_of_a_page_run_and_print_what_it_shows(page: str, tmp_path: Path) -> None:
    wrong = [differences(shown, output) for shown, output in outputs(ROOT / page, tmp_path)]
    assert [lines for lines in wrong if lines] == []


def test_an_output_follows_its_commands_or_stands_in_a_transcript(
    tmp_path: Path,
) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        """# A page
```sh
echo peak 85.0 N
```
```text
peak 85.0 N
```
```text
deck
```
```python
print(2 * 3)
```
## A section
```text
layout
```
```text
$ echo "contact 1 s"
contact 1 s
```
"""
    )
    assert list(outputs(page, tmp_path)) == [
        ("peak 85.0 N\n", ["peak 85.0 N"]),
        ('$ echo "contact 1 s"\ncontact 1 s\n', ['$ echo "contact 1 s"', "contact 1 s"]),
    ]


def test_a_number_that_a_command_does_not_print_is_a_difference() -> None:
    output = ["peak  85.0 N", "contact 1 s", "result  a.h5, 3.2 MB"]
    assert differences("peak 85.0 N\n...\nresult a.h5, 9 MB", output) == []
    assert differences("peak 85.1 N\ncontact 1 s", output) == ["peak 85.1 N"]
    assert differences("peak ...\n...\nresult a.h5, ...", output) == []
    assert differences("contact 1 s\npeak 85.0 N", output) == ["peak 85.0 N"]
