"""The page: template, style, script, data and kernel as one file that asks for nothing.

The policy of the page allows its own script and style, by their digests, the kernel, and the worker
that the script starts. Texts of
the deck are JSON, whose ``<`` is escaped, and the script puts them in as text nodes.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Mapping
from importlib import resources
from typing import Any

from fecm._text import printable
from fecm._typing import Floats
from fecm._version import __version__
from fecm.mechanics.kernels.webassembly import PATH

ROOM = "fecm.exploration"
POLICY = (
    "default-src 'none'; script-src 'sha256-{script}' 'wasm-unsafe-eval'; "
    "worker-src blob:; style-src 'sha256-{style}'; img-src data:; base-uri 'none'; "
    "form-action 'none'"
)
POINTS = 400  # of the picture of the deck's own run


def page(data: Mapping[str, Any], time: Floats, force: Floats) -> str:
    """Return the HTML of a page; `time` and `force` are of the deck's own run."""
    room = resources.files(ROOM)
    script, worker, style = (
        room.joinpath(name).read_text("utf-8") for name in ("page.js", "worker.js", "page.css")
    )
    values = {
        "policy": POLICY.format(script=_digest(script), style=_digest(style)),
        "version": html.escape(__version__),
        "title": html.escape(printable(data["title"])),
        "style": style,
        "script": script,
        "worker": worker,
        "picture": _picture(time, force),
        "data": script_json(data),
        "kernel": base64.b64encode(PATH.read_bytes()).decode("ascii"),
    }
    head, *parts = room.joinpath("page.html").read_text("utf-8").split("{{")
    for part in parts:  # no value is searched for the names of others
        name, _, text = part.partition("}}")
        head += values[name] + text
    return head


def script_json(value: object) -> str:
    """Return JSON that no text in it can end before its element."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _digest(text: str) -> str:
    """Return the digest of a script or a style for the policy."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _picture(time: Floats, force: Floats) -> str:
    """Return the picture of a force over time as a ``data:`` address."""
    every = max(1, len(time) // POINTS)
    x, y = 600.0 * time[::every] / time[-1], 200.0 - 190.0 * force[::every] / (force.max() or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 202"><rect width="600" '
        'height="202" fill="#fff"/><path d="M0 200H600" stroke="#888"/><polyline '
        f'points="{points}" fill="none" stroke="#0b5cad" stroke-width="1.5"/></svg>'
    )
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode('ascii')}"
