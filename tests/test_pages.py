"""What the pages of the site say about the program holds: notes, units, logo, gallery."""

from __future__ import annotations

import ast
import re
import runpy
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

import fecm
from fecm.deck.units import COEFFICIENT, DENSITY, MASS, MODULUS, TOUGHNESS, VELOCITY, convert
from fecm.judge import limits, locations
from fecm.judge.end import ENDS
from fecm.judge.limits import ModelLimit
from tests.decks import ROOT
from tests.printed import text_of

DOCS = ROOT / "docs"
PACKAGE = ROOT / "fecm"
# Where the notes of runs and sweeps are written, with the names that hold them; none are all.
NOTES = {
    "simulation/notes.py": ("_numerical",),
    "simulation/macros.py": ("PINNED",),
    "judge/end.py": ("DECIDING_STEPS",),
    "judge/exposure_bands.py": ("coarse_mesh_note",),
    "judge/validity.py": ("OTHER", "PRELOADED", "UNSAFE", "of_face", "softness"),
    "sweeps/distributions.py": ("doubt", "_of_logarithm"),
    "sweeps/checks.py": (
        "doubtful_values",
        "unused_values",
        "_notes_of_places",
        "_thickness_notes",
        "_of_value",
    ),
    "sweeps/execute.py": ("expected",),
    "sweeps/random.py": ("REMEDY", "doubt", "cost"),
    "sweeps/statistics.py": ("_notes",),
    "sweeps/summary.py": ("doubtful_counts", "remarks"),
}
# Where notes are handed to the user as they are written.
HANDED_OVER = ("simulation/*.py", "sweeps/*.py", "cli/run.py", "cli/sweep.py")
FEWEST_WORDS = 3  # of a text that tells a note from others
# Quantities of the page on units, by the first words of their rows.
DIMENSIONS = {
    "length": "length",
    "ply thickness": "length",
    "density": DENSITY,
    "modulus": MODULUS,
    "strength": MODULUS,
    "toughness": TOUGHNESS,
    "mass": MASS,
    "velocity": VELOCITY,
    "energy": "force*length",
    "contact coefficient": COEFFICIENT,
    "force": "force",
    "duration": "time",
}


def table(page: str, first: str) -> list[list[str]]:
    """The rows of the table of a page whose head begins with a word."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    begin = next(n for n, line in enumerate(lines) if line.startswith(f"| {first}"))
    rows = []
    for line in lines[begin:]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return [rows[0], *rows[2:]]


def texts(node: ast.AST) -> Iterator[str]:
    """The texts in a piece of code, without those of docstrings and errors."""
    if isinstance(node, ast.Raise) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    ):
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    for part in ast.iter_child_nodes(node):
        yield from texts(part)


def named(tree: ast.Module, names: tuple[str, ...]) -> Iterator[ast.AST]:
    """Functions and constants of a module; the module itself without names."""
    if not names:
        yield tree
    for node in ast.walk(tree):
        held = [node.name] if isinstance(node, ast.FunctionDef) else []
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            held = [target.id for target in targets if isinstance(target, ast.Name)]
        if set(held) & set(names):
            yield node


def handed_over(tree: ast.Module) -> Iterator[ast.AST]:
    """Arguments of the calls that print a note, warn, or add to the notes of a run."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        function = ast.unparse(node.func)
        if function in ("note", "warn") or function.endswith("notes.append"):
            yield from node.args


def notes_of(path: Path, names: tuple[str, ...] | None) -> set[str]:
    """Texts of the notes in a module, as far as they are without numbers."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = handed_over(tree) if names is None else named(tree, names)
    return told(text for node in nodes for text in texts(node))


def told(templates: Iterable[str]) -> set[str]:
    """Texts that tell a note from others, between the sizes in templates."""
    parts = (part for text in templates for part in re.split(r"\{[^}]*\}", text))
    names = {" ".join(part.split()).removesuffix(",") for part in parts}
    return {text for text in names if len(text.split()) >= FEWEST_WORDS}


def rows() -> Iterator[str]:
    """Texts of the rows of limits and ends that runs, sweeps and locations note."""
    for row in (*vars(limits).values(), *vars(locations).values()):
        if isinstance(row, ModelLimit):
            yield from (row.note, row.case, *([row.remedy] if row.note else []))
    for meaning in ENDS.values():
        yield from (meaning.where, meaning.what_is_open, meaning.remedy)
        yield from () if meaning.doubt is None else (meaning.doubt.case,)


def sources() -> Iterator[tuple[Path, tuple[str, ...] | None]]:
    """Modules with notes, and the names that hold them; None: those that are handed over."""
    for name, names in NOTES.items():
        yield PACKAGE / name, names
    for pattern in HANDED_OVER:
        for path in PACKAGE.glob(pattern):
            yield path, None


def test_my_run_says_has_every_note_of_a_run_and_of_a_sweep() -> None:
    page = text_of("my-*-says*.md")
    page = " ".join(re.sub(r"^> ", "", page, flags=re.M).split())
    notes = told(rows()).union(*(notes_of(path, names) for path, names in sources()))
    assert len(notes) > 50
    assert {text for text in notes if text not in page} == set()


@pytest.mark.parametrize("call", ["note", "warn", "run.state.notes.append"])
def test_a_note_that_a_module_begins_to_hand_over_is_found(call: str, tmp_path: Path) -> None:
    module = tmp_path / "new.py"
    module.write_text(
        f'def f(run):\n    """One, two, three."""\n    {call}(f"{{3}} new doubts here")\n'
    )
    assert notes_of(module, None) == {"new doubts here"}


def test_the_quantities_on_the_page_of_units_are_the_same_in_every_system() -> None:
    (_, *systems), *rows = table("units.md", "quantity")
    systems = [system.strip("`") for system in systems]
    assert len(rows) == len(DIMENSIONS)
    for name, *cells in rows:
        dimension = next(DIMENSIONS[begin] for begin in DIMENSIONS if name.startswith(begin))
        values = [float(cell.split()[0]) for cell in cells]
        for system, value in zip(systems, values, strict=True):
            expected = convert(values[0], dimension, systems[0], system)
            assert value == pytest.approx(expected, rel=1e-3), (name, system)


@pytest.mark.parametrize("row", table("units.md", "slip in a deck")[1:], ids=lambda row: row[0])
@pytest.mark.few(2)  # of 13, 0.09 s each
def test_a_slip_on_the_page_of_units_is_found(row: list[str]) -> None:
    _, right, wrong, codes = row
    lines = fecm.examples.path("drop-weight.inp").read_text(encoding="utf-8").splitlines()
    slipped = next(n for n, line in enumerate(lines) if has(line, right))
    lines[slipped] = lines[slipped].replace(right, wrong)
    if lines[slipped] != wrong:  # with commas, a longer value needs no column
        lines[slipped] = ",".join(re.split(r" +|,", lines[slipped].strip()))
    names = {finding.code for finding in fecm.check("\n".join(lines) + "\n").findings}
    assert set(codes.split(", ")) <= names


def has(line: str, value: str) -> bool:
    """Whether a card is, or has, a value."""
    return line == value or value in re.split(r"[ ,]+", line)


def test_the_logo_is_what_its_script_draws() -> None:
    drawn = runpy.run_path(str(DOCS / "logo.py"))["picture"]()
    assert (DOCS / "_static" / "logo.svg").read_text(encoding="utf-8") == drawn


def test_the_page_about_reports_links_to_those_that_the_gallery_writes() -> None:
    page = (DOCS / "report.md").read_text(encoding="utf-8")
    linked = re.findall(
        r'href="_static/reports/([\w-]+)\.html"><img src="_static/reports/\1\.svg"', page
    )
    script = ast.parse((ROOT / "examples" / "reports.py").read_text(encoding="utf-8"))
    (pages,) = (
        node.value
        for node in script.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pages"
    )
    assert isinstance(pages, ast.Dict)
    written = [ast.literal_eval(key) for key in pages.keys if key]
    assert linked == written
