"""check_libraries.py DIRECTORY: whether libraries in wheels export and need what they should."""

from __future__ import annotations

import fnmatch
import re
import sys
import zipfile
from pathlib import Path
from typing import Any

import lief

# Libraries that are part of each system.
NEEDED = {
    "manylinux": ["libc.so.6", "libm.so.6", "libpthread.so.0"],
    "musllinux": ["libc.so"],
    "macosx": ["/usr/lib/libSystem.B.dylib", "@rpath/libfecm.dylib"],
    "win": ["KERNEL32.dll", "ntdll.dll", "api-ms-win-crt-*.dll"],
}
PROCESSORS = {
    "x86_64": ["X86_64", "AMD64"],
    "amd64": ["AMD64"],
    "aarch64": ["AARCH64"],
    "arm64": ["ARM64"],
}


def check(wheel: Path) -> str:
    """Describe a wheel's library in one line; SystemExit if it is not what the name says."""
    platform = wheel.stem.split("-")[-1]
    with zipfile.ZipFile(wheel) as archive:
        found = [archive.read(name) for name in archive.namelist() if "/libfecm." in name]
        (source,) = (name for name in archive.namelist() if name.endswith("/kernels.c"))
        functions = set(re.findall(r"^EXPORT .*?(fecm_\w+)\(", archive.read(source).decode(), re.M))
    if len(found) != (platform != "any"):
        raise SystemExit(f"{wheel.name} has {len(found)} libraries")
    if not found:
        return f"{platform}: no library"
    library: Any = lief.parse(list(found[0]))
    exported, needed, processor = described(library)
    allowed = next(value for begin, value in NEEDED.items() if platform.startswith(begin))
    foreign = [name for name in needed if not any(fnmatch.fnmatch(name, a) for a in allowed)]
    machines = next(value for end, value in PROCESSORS.items() if platform.endswith(end))
    if functions - exported or foreign or processor not in machines:
        raise SystemExit(f"{wheel.name}: {processor}, {sorted(exported)}, {sorted(needed)}")
    return f"{platform}: {processor}, {len(functions)} functions, needs {', '.join(needed)}"


def described(library: Any) -> tuple[set[str], list[str], str]:
    """Names of exported functions and of needed libraries, and the processor."""
    if isinstance(library, lief.PE.Binary):
        exported = {entry.name for entry in library.get_export().entries}
        return exported, [entry.name for entry in library.imports], library.header.machine.name
    exported = {function.name.removeprefix("_") for function in library.exported_functions}
    if isinstance(library, lief.ELF.Binary):
        return exported, list(library.libraries), library.header.machine_type.name
    return exported, [entry.name for entry in library.libraries], library.header.cpu_type.name


if __name__ == "__main__":
    for path in sorted(Path(sys.argv[1]).glob("*.whl")):
        print(check(path))
