"""Sphinx configuration; the site is built by ``sphinx-build -W docs site``."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from importlib.metadata import version as installed
from pathlib import Path
from textwrap import wrap
from typing import Any

from latex2mathml.converter import convert

WIDTH = 64  # of notes above tables: what fits between both side bars
# Pages to look up, and the level of the headings below which all but a first sentence is folded.
FOLDED = {"verification": 2, "findings": 2, "datasets": 2, "commands": 2, "changelog": 3}

project = "fecm"
author = "the fecm developers"
version = release = installed("fecm")

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_click",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
if os.environ.get("FECM_DOCS_ONLINE"):  # links to the documentation of other projects
    extensions.append("sphinx.ext.intersphinx")
intersphinx_mapping = {
    "python": ("https://docs.python.org/3", None),
    "numpy": ("https://numpy.org/doc/stable", None),
    "matplotlib": ("https://matplotlib.org/stable", None),
    "xarray": ("https://docs.xarray.dev/en/stable", None),
}

exclude_patterns = ["schemas"]
smartquotes_action = "qe"  # keeps two hyphens, those of options
myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_inline"]
myst_heading_anchors = 4
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"

sys.path.insert(0, str(Path(__file__).parent))
import scraper  # noqa: E402

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "",  # all run
    "within_subsection_order": "scraper.order",
    "image_scrapers": ("scraper.written_pictures",),
    "capture_repr": (),
    "download_all_examples": False,
    "show_signature": False,
    "default_thumb_file": str(Path(__file__).parent / "_static" / "logo.svg"),
    "min_reported_time": 60,
    "write_computation_times": False,
    "abort_on_example_error": True,
}

html_theme = "pydata_sphinx_theme"
html_title = "fecm"
html_logo = html_favicon = "_static/logo.svg"  # drawn by logo.py
# Of all versions of a page, search engines show the one at this address.
html_baseurl = os.environ.get("READTHEDOCS_CANONICAL_URL", "")
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "logo": {"text": "fecm"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "github_url": "https://github.com/fecm/fecm",
}
html_sidebars = {page: [] for page in ("install", "tutorial", "changelog")}  # no pages below them
html_show_sourcelink = False
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"


def _mathml(self: Any, node: Any) -> None:
    """Write LaTeX as MathML, which browsers draw without a script."""
    from docutils import nodes

    block = isinstance(node, nodes.math_block)
    drawn = convert(node.astext(), display="block" if block else "inline")
    self.body.append(f"<div>{drawn}</div>\n" if block else drawn)
    raise nodes.SkipNode


def _captions(app: Any, doctree: Any) -> None:
    """Show the text of a picture that stands alone in its paragraph below it."""
    from docutils import nodes

    if app.env.docname == "index":  # where the text beside it says so
        return
    for paragraph in list(doctree.findall(nodes.paragraph)):
        pictures = [part for part in paragraph if isinstance(part, nodes.image)]
        others = [part for part in paragraph if part not in pictures]
        if not pictures or any(part.astext().strip() for part in others):
            continue
        figures = [
            nodes.figure("", picture.deepcopy(), nodes.caption("", picture["alt"]))
            for picture in pictures
        ]
        for figure in figures:
            doctree.note_implicit_target(figure)  # its name, which Sphinx asks for
        paragraph.replace_self(figures)


def _is_row(line: str) -> bool:
    """Whether a line of output is one of a table, of three columns at least."""
    return len(re.split(" {2,}", line.strip())) > 2


def _folded(line: str) -> str:
    """Wrap a note."""
    return "\n".join(wrap(line, WIDTH)) if line.startswith("fecm: ") else line


def _wrap_output(app: Any, doctree: Any) -> None:
    """Let browsers wrap output; beside tables, whose lines must stay whole, wrap the notes here."""
    from docutils import nodes

    for block in doctree.findall(nodes.literal_block):
        if block.get("language") != "text":
            continue
        lines = block.astext().splitlines()
        if not any(map(_is_row, lines)):
            block["classes"].append("prose")
            continue
        block.rawsource = "\n".join(map(_folded, lines))
        block.children = []
        block += nodes.Text(block.rawsource)


def _folds(app: Any, doctree: Any) -> None:
    """Fold tables, options and parameters; browsers open what a link names."""
    from docutils import nodes
    from sphinx import addnodes

    for section in doctree.findall(nodes.section):
        depth = sum(isinstance(part, nodes.section) for part in _ancestors(section))
        if depth + 1 >= FOLDED.get(app.env.docname, 9):
            _fold(section)
        if depth > 1 and app.env.docname in FOLDED:
            _fold_parts(section)
    for described in doctree.findall(addnodes.desc):
        outer = any(isinstance(part, addnodes.desc) for part in _ancestors(described))
        if described["domain"] == "py" and not outer:
            _fold(described[-1])


def _ancestors(node: Any) -> Iterator[Any]:
    """Go from a node to the root."""
    while node := node.parent:
        yield node


def _fold(node: Any) -> None:
    """Fold a node's children but its title, first paragraph, and sections."""
    from docutils import nodes
    from sphinx import addnodes

    heads = nodes.title, nodes.paragraph, addnodes.index, nodes.target
    first = next((n for n, part in enumerate(node) if not isinstance(part, heads)), len(node))
    last = next((n for n, part in enumerate(node) if isinstance(part, nodes.section)), len(node))
    if first >= last:
        return
    rows = sum(len(body) for part in node[first:last] for body in part.findall(nodes.tbody))
    label = f"{rows} rows" if rows > 1 else "1 row" if rows else "Details"
    opening = f'<details class="fold"><summary>{label}</summary>'
    folded = [*node[first:last], nodes.raw("", "</details>", format="html")]
    node[first:last] = [nodes.raw("", opening, format="html"), *folded]


def _fold_parts(section: Any) -> None:
    """Fold the sections of a section, such as the commands of a command, as one."""
    from docutils import nodes

    parts = [n for n, part in enumerate(section) if isinstance(part, nodes.section)]
    if parts:
        opening = f'<details class="fold"><summary>{len(parts)} parts</summary>'
        section.insert(parts[-1] + 1, nodes.raw("", "</details>", format="html"))
        section.insert(parts[0], nodes.raw("", opening, format="html"))


def _literally(app: Any, context: Any, lines: list[str]) -> None:
    """Keep bars, stars and addresses in help texts from being markup."""
    lines[:] = [re.sub(r"[|*]|(?<=:)//", r"\\\g<0>", line) for line in lines]


def _explored(app: Any) -> None:
    """Write the page with sliders that the front page shows."""
    import fecm

    page = Path(__file__).parent / "_static" / "explore" / "drop-weight.html"
    page.parent.mkdir(exist_ok=True)
    fecm.explore(fecm.examples.path("drop-weight-held.inp")).save(page, overwrite=True)


def setup(app: Any) -> None:
    """Register the renderer of equations, and correct help texts."""
    app.connect("doctree-read", _wrap_output)
    app.connect("doctree-read", _folds)
    for part in ("description", "options"):
        app.connect(f"sphinx-click-process-{part}", _literally)
    app.connect("doctree-read", _captions)
    app.connect("builder-inited", scraper.draw_thumbnails, priority=900)  # after the gallery
    app.connect("builder-inited", _explored)
    app.add_html_math_renderer("mathml", (_mathml, None), (_mathml, None))
