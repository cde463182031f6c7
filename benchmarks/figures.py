"""Figures that are kept: JSON with the machine in its name, and the versions that made it."""

from __future__ import annotations

import json
import multiprocessing
import platform
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import scipy

import fecm


def keep(figures: Mapping[str, object], suffix: str = "") -> Path:
    """Write figures into the folder of results; the file's path."""
    versions = {m.__name__: m.__version__ for m in (fecm, np, scipy, h5py)}
    machine = f"{platform.system()}-{platform.machine()}-{multiprocessing.cpu_count()}cores"
    path = Path(__file__).parent / "results" / f"{machine.lower()}{suffix}.json"
    path.parent.mkdir(exist_ok=True)
    content = {"machine": machine, "python": platform.python_version(), **versions, **figures}
    path.write_text(json.dumps(content, indent=2) + "\n")
    return path
