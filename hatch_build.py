"""Build hook: compiles the kernels where there is a C compiler; fecm runs on NumPy without.

The library needs no Python, so that one wheel serves all versions of it.
"""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zlib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

KERNELS = "fecm/mechanics/kernels"
# Platform of a wheel in the words of PyPI, such as manylinux_2_17_x86_64, where CC compiles for
# another machine; "any" for a wheel without kernels.
PLATFORM = "FECM_PLATFORM"
# These undo -Ofast and -ffast-math of CFLAGS, also for the linker, which would otherwise add code
# that flushes small numbers to zero in the whole process.
EXACT = ["-O3", "-fno-fast-math", "-fno-unsafe-math-optimizations"]
# Without them the time of a step changes by some per cent with the place of a loop in the library.
# For Windows, Clang takes minutes to align loops, or fails.
ALIGNED = ["-falign-functions=64"]
ALIGNED_LOOPS = ["-falign-loops=32"]
# GCC takes a fifth longer with this pass, and the code is no faster.
QUICK = ["-fno-gcse"]
FLAGS = [*EXACT, *ALIGNED, *QUICK, "-g0", "-std=gnu11", "-Wno-psabi", "-fvisibility=hidden"]


class CustomBuildHook(BuildHookInterface[Any]):
    """Adds the compiled kernels to a wheel, or to the source tree of an editable installation."""

    folder: Path | None = None

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile; a failure is a warning, or an error where a platform was asked for."""
        wanted = os.environ.get(PLATFORM)
        if self.target_name != "wheel" or wanted == "any":
            return
        root, self.folder = Path(self.root), Path(tempfile.mkdtemp())
        tag = wanted or _platform()
        try:
            built = _compiled(root, self.folder, tag)
        except (OSError, subprocess.SubprocessError) as error:
            if wanted:
                raise
            self.app.display_warning(f"the kernels are not compiled ({error}); fecm uses NumPy")
            return
        target = f"{KERNELS}/{built.name}"
        if version == "editable":
            shutil.copy(built, root / target)
            return
        build_data["force_include"][str(built)] = target
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Delete what was compiled."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def _platform() -> str:
    """Give this machine in the words of a wheel's name."""
    if sys.platform == "darwin":  # Python itself may be for two kinds of processor
        return f"macosx_11_0_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _compiled(root: Path, folder: Path, tag: str) -> Path:
    """Compile the kernels into a folder, for a platform."""
    # As fecm.mechanics.kernels.stamp computes it, and under the name that it loads.
    sources = sorted((root / KERNELS).glob("*.[ch]"))
    stamp = zlib.crc32(b"".join(path.read_bytes() for path in sources)) >> 1
    suffix = {"win": ".dll", "mac": ".dylib"}.get(tag[:3], ".so")
    built = folder / f"libfecm{suffix}"
    given = [*_words("CFLAGS"), *_words("LDFLAGS")]
    flags = [*FLAGS, *([] if tag.startswith("win") else ALIGNED_LOOPS)]
    if tag.startswith("macosx_11_0"):
        flags += ["-mmacosx-version-min=11.0", f"-Wl,-install_name,@rpath/{built.name}"]
    command = [*_compiler(), *given, *flags, f"-DFECM_STAMP={stamp}", "-shared", "-fPIC"]
    command += [str(root / KERNELS / "kernels.c"), "-o", str(built), "-lm", "-lpthread"]
    subprocess.run(command, cwd=folder, check=True)
    if not built.is_file():
        raise FileNotFoundError("the compiler wrote no library")
    return built


def _compiler() -> list[str]:
    """Command of the C compiler: that of CC, or the first that is found."""
    if given := _words("CC"):
        return given
    found = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if found is None:
        raise FileNotFoundError("there is no C compiler")
    return [found]


def _words(name: str) -> list[str]:
    """Words of an environment variable, quoted as in a shell."""
    return shlex.split(os.environ.get(name, ""))
