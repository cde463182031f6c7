"""Build hook: compiles the kernels where there is a C compiler; fecm runs on NumPy without."""

from __future__ import annotations

import shutil
import sysconfig
import tempfile
import zlib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

KERNELS = "fecm/mechanics/kernels"
# These undo -Ofast and -ffast-math of CFLAGS, also for the linker, which would otherwise add code
# that flushes small numbers to zero in the whole process.
EXACT = ["-O3", "-fno-fast-math", "-fno-unsafe-math-optimizations"]
# Without them the time of a step changes by some per cent with the place of a loop in the library.
ALIGNED = ["-falign-functions=64", "-falign-loops=32"]
FLAGS = [*EXACT, *ALIGNED, "-g0", "-std=gnu11", "-Wno-psabi", "-fvisibility=hidden"]


class CustomBuildHook(BuildHookInterface[Any]):
    """Adds the compiled kernels to a wheel, or to the source tree of an editable installation."""

    folder: Path | None = None

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile; a failure is a warning."""
        if self.target_name != "wheel":
            return
        root, self.folder = Path(self.root), Path(tempfile.mkdtemp())
        try:
            built = _compiled(root, self.folder)
        except (Exception, SystemExit) as error:  # whatever setuptools makes of a lacking compiler
            self.app.display_warning(f"the kernels are not compiled ({error}); fecm uses NumPy")
            return
        target = f"{KERNELS}/{built.name}"
        if version == "editable":
            shutil.copy(built, root / target)
            return
        build_data["force_include"][str(built)] = target
        build_data["pure_python"] = False
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"cp311-abi3-{platform}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Delete what was compiled."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def _compiled(root: Path, folder: Path) -> Path:
    """Compile the kernels into a folder, for every Python from 3.11 on."""
    from setuptools import Distribution, Extension
    from setuptools.command.build_ext import build_ext

    # As fecm.mechanics.kernels.stamp computes it.
    sources = sorted((root / KERNELS).glob("*.[ch]"))
    stamp = zlib.crc32(b"".join(path.read_bytes() for path in sources)) >> 1
    extension = Extension(
        "_compiled",
        [str(root / KERNELS / "kernels.c")],
        define_macros=[("FECM_STAMP", str(stamp))],
        extra_compile_args=FLAGS,
        extra_link_args=EXACT,
        libraries=["m", "pthread"],
        py_limited_api=True,
    )
    command = build_ext(Distribution({"ext_modules": [extension]}))
    command.build_lib, command.build_temp = str(folder), str(folder / "objects")
    command.ensure_finalized()
    command.run()
    built = folder / command.get_ext_filename("_compiled")
    if not built.is_file():
        raise FileNotFoundError("the compiler wrote no library")
    return built
