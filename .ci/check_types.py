"""Whether a type checker knows the type of every public name, and of all that it leads to.

basedpyright judges an installed package alone, and does not see an editable installation: the
package is copied into an empty environment that borrows the libraries of this one.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from pathlib import Path

import fecm


def verified(folder: Path) -> dict[str, bool]:
    """Whether the type of each symbol is known, by name."""
    venv.create(folder, symlinks=os.name != "nt")
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder)}))
    shutil.copytree(Path(fecm.__file__).parent, site / "fecm")
    libraries = [path for path in sys.path if "site-packages" in path]
    (site / "libraries.pth").write_text("\n".join(libraries))
    programs = Path(sys.executable).parent
    # The python that basedpyright asks for the libraries.  It fails because of internal names.
    path = os.pathsep.join([str(folder / programs.name), os.environ["PATH"]])
    done = subprocess.run(
        [programs / "basedpyright", "--verifytypes", "fecm", "--ignoreexternal", "--outputjson"],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
    )
    symbols = json.loads(done.stdout)["typeCompleteness"]["symbols"]
    return {one["name"]: one["isTypeKnown"] and not one["isTypeAmbiguous"] for one in symbols}


with tempfile.TemporaryDirectory() as folder:
    known = verified(Path(folder))
public = [name for name in fecm.__all__ if not name.startswith("__")]
unknown = [name for name in public if not known.get(f"fecm.{name}")]
print(f"{len(public)} public names, of unknown type: {', '.join(unknown) or 'none'}")
sys.exit(bool(unknown))
