"""try_release.py DIRECTORY: install fecm from it for this Python, on its own, and run it.

--oldest             with the oldest dependencies that it allows
--without-kernels    the wheel for any machine
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import tempfile
import venv
import zipfile
from pathlib import Path


def oldest(wheel: Path) -> list[str]:
    """Every dependency of a wheel at its lowest version."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = archive.read(name).decode()
    return [
        f"{package}=={version}"
        for package, version in re.findall(r"^Requires-Dist: (\w+)>=([\d.]+)$", metadata, re.M)
    ]


def main() -> None:
    """Install and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path)
    parser.add_argument("--oldest", action="store_true")
    parser.add_argument("--without-kernels", action="store_true")
    given = parser.parse_args()
    directory = given.directory.resolve()
    (anywhere,) = directory.glob("fecm-*-any.whl")
    version = anywhere.name.split("-")[1]
    wanted = [str(anywhere) if given.without_kernels else f"fecm=={version}"]
    if given.oldest:
        wanted += oldest(anywhere)
    # Nothing that is installed beside, and no compiler.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"CC": "no-compiler", "PYTHONUTF8": "1"}
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        (python,) = (*Path(folder).glob("bin/python"), *Path(folder).glob("Scripts/python.exe"))

        def run(*words: str) -> str:
            done = subprocess.run(
                [str(python), "-m", *words],
                cwd=folder,
                env=environment,
                stdout=subprocess.PIPE,
                encoding="utf-8",
                check=True,
            )
            return done.stdout

        run(
            "pip",
            "install",
            "-q",
            "-q",
            "--only-binary=:all:",
            f"--find-links={directory}",
            *wanted,
        )
        system = run("fecm", "info", "--system")
        print(system, end="", flush=True)
        if f"fecm      {version}\n" not in system:
            raise SystemExit(f"the installed version is not {version}")
        if ("not compiled" in system) != given.without_kernels:
            raise SystemExit("a wheel for another machine was installed")
        print(run("fecm", "verify").splitlines()[-1])
        run("fecm", "example", "impact-patch.inp")
        print(run("fecm", "run", "impact-patch.inp").splitlines()[0], flush=True)


if __name__ == "__main__":
    main()
