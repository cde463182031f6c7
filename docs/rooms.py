"""Draw the rooms of the package, ``docs/architecture.svg``: order, size and imports.

The order is that of the layers in pyproject.toml.  The thickness of a line says how many names a
room imports from another.

    python docs/rooms.py docs/architecture.svg
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections import Counter
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).resolve().parents[1]
WIDTH, HEIGHT, GAP = 150.0, 34.0, 20.0
MARGIN, REACH = 10.0, 190.0  # of the picture, and of the arcs beside the rooms


def layers() -> list[list[str]]:
    """Rooms of each layer of the import contract, from the top, without modules such as _files."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    rows = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    rooms = [[room.strip() for room in row.split("|") if "_" not in room] for row in rows]
    return [row for row in rooms if row]


def files_of(room: str) -> list[Path]:
    """Python files of a room, which is a folder or a module."""
    folder = ROOT / "fecm" / room
    return sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]


def imports_of(room: str, rooms: list[str]) -> Counter[str]:
    """Count the names that a room imports from each other room."""
    count: Counter[str] = Counter()
    for path in files_of(room):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fecm."):
                other = str(node.module).split(".")[1]
                if other in rooms and other != room:
                    count[other] += len(node.names)
    return count


def drawing() -> str:
    """Return the picture as SVG."""
    rows = layers()
    rooms = [room for row in rows for room in row]
    place = {
        room: (MARGIN + (WIDTH + GAP) * column, MARGIN + (HEIGHT + GAP) * line)
        for line, row in enumerate(rows)
        for column, room in enumerate(row)
    }
    columns = max(map(len, rows))
    right = MARGIN + columns * (WIDTH + GAP) - GAP
    parts = []
    for room in rooms:
        for other, names in imports_of(room, rooms).items():
            (_, y), (_, end) = place[room], place[other]
            reach = right + 8.0 + (REACH - 20.0) * abs(end - y) / ((HEIGHT + GAP) * len(rows))
            parts.append(
                f'<path d="M{right:.0f} {y + HEIGHT * 0.65:.0f}C{reach:.0f} {y + HEIGHT:.0f} '
                f'{reach:.0f} {end:.0f} {right:.0f} {end + HEIGHT * 0.35:.0f}" class="arc" '
                f'stroke-width="{0.4 + names**0.5 / 4.0:.1f}"><title>{room} imports {names} names '
                f"of {other}</title></path>"
            )
    for room, (x, y) in place.items():
        files = files_of(room)
        lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
        wide = right - x if len([r for r in place if place[r][1] == y]) == 1 else WIDTH
        parts.append(
            f'<rect x="{x:.0f}" y="{y:.0f}" width="{wide:.0f}" height="{HEIGHT:.0f}" rx="4"/>'
            f'<text x="{x + 8:.0f}" y="{y + 15:.0f}" class="room">{escape(room)}</text>'
            f'<text x="{x + 8:.0f}" y="{y + 28:.0f}">{len(files)} files, {lines:,} lines</text>'
        )
    height = MARGIN * 2.0 + (HEIGHT + GAP) * len(rows) - GAP
    style = (
        "text{font:10px sans-serif;fill:#333}.room{font-weight:bold;font-size:12px}"
        "rect{fill:#eef3f8;stroke:#4a6785}.arc{fill:none;stroke:#4a6785;stroke-opacity:.55}"
        "@media(prefers-color-scheme:dark){text{fill:#ddd}rect{fill:#22303c;stroke:#9db8d2}"
        ".arc{stroke:#9db8d2}}"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right + REACH:.0f} {height:.0f}" '
        f'width="{right + REACH:.0f}" height="{height:.0f}" role="img">'
        f"<title>Rooms of the package</title><style>{style}</style>{''.join(parts)}</svg>\n"
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(drawing(), encoding="utf-8")
