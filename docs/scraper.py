"""What sphinx-gallery needs to know of the scripts in examples/."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst

# In the gallery; others follow.
ORDER = (
    "deck_without_text", "overlay_of_a_measurement", "parametric_study", "animation",
    "plate_with_a_hole", "ply_stresses", "stretching_plate", "sandwich_core", "mesh_convergence",
    "table_of_cases", "layup_optimisation", "sobol_indices", "posterior", "process_pool",
    "dask_cluster", "trusted_result", "own_projectile", "own_contact_law",
    "axisymmetric_projectile",
)  # fmt: skip


def order(name: str) -> int:
    """Place of a script in the gallery."""
    stem = Path(name).stem
    return ORDER.index(stem) if stem in ORDER else len(ORDER)


def written_pictures(block: Any, variables: dict[str, Any], conf: dict[str, Any]) -> str:
    """Move the pictures that a script has written into the gallery, and show them."""
    shown = []
    for written in sorted((*Path().glob("*.gif"), *Path().glob("*.png"))):
        target = Path(next(variables["image_path_iterator"])).with_suffix(written.suffix)
        target.write_bytes(written.read_bytes())
        written.unlink()
        shown.append(target)
    return figure_rst(shown, conf["src_dir"]) if shown else ""
