"""What sphinx-gallery needs to know of the scripts in examples/."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import thumbnails
from sphinx_gallery.scrapers import figure_rst

# In the gallery; others follow.
ORDER = (
    "drop_weight_test", "first_failure", "energy_of_delamination", "probability_of_delamination",
    "contact_from_a_measurement", "located_impact", "reports", "overlay_of_a_measurement",
    "posterior", "deck_without_text", "parametric_study", "table_of_cases", "animation",
    "plate_with_a_hole", "ply_stresses", "stretching_plate", "curved_panel", "sandwich_core",
    "mesh_convergence",
    "layup_optimisation", "sobol_indices", "process_pool", "dask_cluster", "trusted_result",
    "own_projectile", "own_contact_law", "axisymmetric_projectile",
)  # fmt: skip
# Variables of the scripts that were run, for their thumbnails.
_VARIABLES: dict[str, dict[str, Any]] = {}


def order(name: str) -> int:
    """Place of a script in the gallery."""
    stem = Path(name).stem
    return ORDER.index(stem) if stem in ORDER else len(ORDER)


def written_pictures(block: Any, variables: dict[str, Any], conf: dict[str, Any]) -> str:
    """Move the pictures that a script has written into the gallery, and show them."""
    _VARIABLES[Path(variables["src_file"]).stem] = dict(variables["example_globals"])
    shown = []
    for written in sorted((*Path().glob("*.gif"), *Path().glob("*.png"))):
        target = Path(next(variables["image_path_iterator"])).with_suffix(written.suffix)
        target.write_bytes(written.read_bytes())
        written.unlink()
        shown.append(target)
    pictures = figure_rst(shown, conf["src_dir"]) if shown else ""
    return f"{pictures}{_written_pages(Path(conf['src_dir']), variables['example_globals'])}"


def _written_pages(source: Path, names: dict[str, Any]) -> str:
    """Move the pages that a script has written to the site's static files, and link them."""
    items = []
    for written in sorted(Path().glob("*.html")):
        folder = source / "_static" / "reports"
        folder.mkdir(parents=True, exist_ok=True)
        thumbnails.of_page(names["pages"][written.stem], folder / f"{written.stem}.svg")
        (folder / written.name).write_bytes(written.read_bytes())
        written.unlink()
        address, name = f"../_static/reports/{written.stem}", written.stem.replace("-", " ")
        items.append(
            f'<a href="{address}.html"><img src="{address}.svg" width="160" alt=""><br>{name}</a>'
        )
    lines = "".join(f"    {item}\n" for item in items)
    return f'\n.. raw:: html\n\n    <div class="reports">\n{lines}    </div>\n\n' if items else ""


def draw_thumbnails(app: Any) -> None:
    """Draw thumbnails over those that are pictures made small."""
    folder = Path(app.srcdir) / "gallery" / "images" / "thumb"
    for script, names in _VARIABLES.items():
        for path in folder.glob(f"sphx_glr_{script}_thumb.*"):
            thumbnails.drawn(script, names, path)
