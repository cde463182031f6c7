"""The compiled library: what it is built with, and when it is not used."""

from __future__ import annotations

import importlib
import shlex
import shutil
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import h5py
import pytest

from fecm import FecmWarning
from fecm.mechanics import kernels

ROOT = Path(__file__).parent.parent
SOURCE = Path(kernels.__file__).parent / "kernels.c"
CC = shutil.which("cc") or shutil.which("gcc") or ""
compiled = pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")
needs_compiler = pytest.mark.skipif(not CC, reason="there is no C compiler")
FAST = ["-ffast-math", "-Ofast", "-funsafe-math-optimizations"]

# A number below the normal range, from an operation that the compiler can't do beforehand.
TINY = "double tiny(double x) { volatile double y = x; return y / 4.0; }"
ASK = """
import ctypes, sys
library = ctypes.CDLL(sys.argv[1])
library.tiny.restype, library.tiny.argtypes = ctypes.c_double, [ctypes.c_double]
print(library.tiny(2.0**-1022) > 0.0)
"""


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module of the build hook, without the program that calls it."""
    interface: Any = types.ModuleType("interface")
    interface.BuildHookInterface = dict  # any class with one parameter
    parts = ["hatchling", "builders", "hooks", "plugin", "interface"]
    for depth in range(1, len(parts) + 1):
        monkeypatch.setitem(sys.modules, ".".join(parts[:depth]), interface)
    monkeypatch.syspath_prepend(str(ROOT))
    monkeypatch.delitem(sys.modules, "hatch_build", raising=False)
    return importlib.import_module("hatch_build")


@needs_compiler
@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
@pytest.mark.few(1)  # of 3, 0.4 s each
def test_the_sources_refuse_a_compiler_that_takes_all_numbers_for_finite(
    flag: str, hook: Any
) -> None:
    def preprocessed(*flags: str) -> str:
        given = [CC, "-E", "-std=gnu11", "-DFECM_STAMP=1", *flags, str(SOURCE), "-o", "/dev/null"]
        done = subprocess.run(given, capture_output=True, text=True, check=False)
        return str(done.stderr)

    assert "compile without -ffast-math" in preprocessed(flag)
    assert "compile without -ffast-math" not in preprocessed()
    assert "compile without -ffast-math" not in preprocessed(flag, *hook.EXACT)


@needs_compiler
@pytest.mark.parametrize("flag", FAST)
def test_flags_of_the_user_do_not_flush_small_numbers_to_zero(
    flag: str, hook: Any, tmp_path: Path
) -> None:
    (tmp_path / "tiny.c").write_text(TINY)
    library = tmp_path / "tiny.so"
    subprocess.run(
        [CC, "-shared", "-fPIC", flag, tmp_path / "tiny.c", "-o", library, *hook.EXACT], check=True
    )
    asked = subprocess.run(
        [sys.executable, "-c", ASK, library], capture_output=True, text=True, check=True
    )
    assert asked.stdout == "True\n"


# A compiler that writes an empty library and its arguments.
COMPILER = """
import sys
from pathlib import Path
target = sys.argv[sys.argv.index("-o") + 1]
Path(target).touch()
Path(sys.argv[1]).write_text("\\n".join(sys.argv))
"""


def built(hook: Any, monkeypatch: pytest.MonkeyPatch, **environment: str) -> tuple[Any, list[str]]:
    """What the hook adds to a wheel, and its warnings."""
    said: list[str] = []
    for name in ("CC", "CFLAGS", "LDFLAGS", hook.PLATFORM):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    build = hook.CustomBuildHook()
    build.target_name, build.root = "wheel", str(ROOT)
    build.app = types.SimpleNamespace(display_warning=said.append)
    data: dict[str, Any] = {"force_include": {}}
    try:
        build.initialize("standard", data)
    finally:
        build.finalize("standard", data, "")
    return data, said


def test_a_compiler_that_writes_nothing_leaves_numpy(
    hook: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, (warning,) = built(hook, monkeypatch, CC="true")
    assert data == {"force_include": {}}
    assert "the compiler wrote no library" in warning
    assert "fecm uses NumPy" in warning


@pytest.mark.parametrize("compiler", ["true", "false", "no-such-compiler"])
def test_a_wheel_for_a_named_platform_has_kernels_or_is_not_built(
    compiler: str, hook: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises((OSError, subprocess.SubprocessError)):
        built(hook, monkeypatch, CC=compiler, FECM_PLATFORM="win_amd64")


@pytest.mark.parametrize(
    ("platform", "library"),
    [
        ("manylinux_2_17_x86_64.manylinux2014_x86_64", "libfecm.so"),
        ("musllinux_1_2_aarch64", "libfecm.so"),
        ("macosx_11_0_arm64", "libfecm.dylib"),
        ("win_amd64", "libfecm.dll"),
    ],
)
def test_a_wheel_is_for_any_python_and_has_the_library_of_its_platform(
    platform: str, library: str, hook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cc.py").write_text(COMPILER)
    command = shlex.join([sys.executable, str(tmp_path / "cc.py"), str(tmp_path / "arguments")])
    data, said = built(hook, monkeypatch, CC=command, CFLAGS="-Ofast -DX", FECM_PLATFORM=platform)
    (target,) = data.pop("force_include").values()
    assert target == f"fecm/mechanics/kernels/{library}"
    assert data == {"pure_python": False, "tag": f"py3-none-{platform}"}
    assert said == []
    arguments = (tmp_path / "arguments").read_text().split("\n")
    assert arguments.index("-Ofast") < arguments.index("-O3")
    assert ("-mmacosx-version-min=11.0" in arguments) == platform.startswith("mac")


def test_a_wheel_for_any_platform_has_no_kernels(
    hook: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert built(hook, monkeypatch, CC="false", FECM_PLATFORM="any") == ({"force_include": {}}, [])


@compiled
def test_the_library_knows_nothing_of_python() -> None:
    assert b"PyModule" not in kernels.PATH.read_bytes()


@compiled
@pytest.mark.skipif(not Path("/proc/cpuinfo").exists(), reason="asks Linux")
def test_the_kernels_use_avx2_where_the_system_knows_it() -> None:
    flags = Path("/proc/cpuinfo").read_text().split()
    assert kernels.LIBRARY.fecm_has_avx2() == ("avx2" in flags and "fma" in flags)


def loaded_from(path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What is loaded where the library is this file."""
    monkeypatch.setattr(kernels, "PATH", path)
    return kernels._load()


def test_a_library_without_a_stamp_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.warns(FecmWarning, match="it is another library; NumPy is used"):
        assert loaded_from(Path(h5py.h5.__file__), monkeypatch) is None


def test_without_a_library_there_is_no_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    assert loaded_from(tmp_path / "libfecm.so", monkeypatch) is None
    assert not recwarn


@pytest.mark.parametrize("content", [b"", b"no library", b"\x7fELF\x02\x01\x01" + bytes(57)])
def test_a_file_that_is_no_library_is_not_used(
    content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "libfecm.so"
    path.write_bytes(content)
    with pytest.warns(FecmWarning, match="this system can't load it"):
        assert loaded_from(path, monkeypatch) is None


@compiled
def test_a_library_of_other_sources_is_not_used_and_every_command_says_so(tmp_path: Path) -> None:
    package = tmp_path / "fecm"
    shutil.copytree(SOURCE.parents[2], package)
    assert "note" not in system(tmp_path)[1]
    with (package / "mechanics" / "kernels" / "plate.h").open("a") as header:
        header.write("\n")
    shown, said = system(tmp_path)
    assert "kernels   not compiled; NumPy is used" in shown
    assert said.startswith(f"fecm: note: the compiled kernels {package}")
    assert said.count("\n") == 1
    assert "compiled from other sources; NumPy is used instead and is slower" in said
    assert said.endswith("from its sources with `pip install -e .`\n")


def system(folder: Path) -> tuple[str, str]:
    """What ``fecm info --system`` of the package in a folder prints."""
    command = [sys.executable, "-m", "fecm", "info", "--system"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout, done.stderr


@needs_compiler
def test_a_library_that_is_there_is_used() -> None:
    """A library of other sources would skip every test of the kernels."""
    remedy = "compile it again: pip install -e ."
    assert kernels.LIBRARY is not None or not kernels.PATH.exists(), remedy
