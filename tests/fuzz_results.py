"""A fuzz run of the commands that read result files, by hand.

    python -m tests.fuzz_results --count 10000 --seed 0

Each damaged file goes through ``fecm info`` and ``fecm diff``, against the sound file; with
``--all`` through every command that reads results.  Each command must end by itself, with status 0,
1 (`diff` only), or 2 and then one line on standard error, and leave no partial file.  Prints what
broke, with the seed that makes it again, and the counts.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import re
import shutil
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

import h5py
import numpy as np

import fecm
from fecm.cli import main as fecm_main
from tests.decks import PROGRAM, small

HANGS = 300  # seconds of the clock after which a command hangs

COMMANDS = {
    "info": "bad.h5",
    "diff": "sound.h5 bad.h5",
    "tapes": "bad.h5 -d made",
    "export": "bad.h5 --to csv --dataset history -o made/x.csv",
    "plot": "bad.h5 -o made",
    "report": "bad.h5 -o made/x.html",
}


def damage(sound: Path, bad: Path, chance: random.Random) -> None:
    """Write a damaged copy: bytes changed, a block moved, an end cut off, or objects replaced."""
    data = bytearray(sound.read_bytes())
    kind = chance.choice(["bytes", "bytes", "bytes", "block", "cut", "objects"])
    if kind == "bytes":
        near = [match.start() for match in re.finditer(b"TREE|HEAP|SNOD", data)]
        for _ in range(chance.choice([1, 2, 8, 30])):
            at = chance.choice([0, *near]) + chance.randrange(160)  # not the numbers of the result
            data[min(at, len(data) - 1)] = chance.randrange(256)
    if kind == "block":
        to, origin = chance.randrange(len(data)), chance.randrange(len(data))
        length = chance.choice([1, 64, 4096])
        data[to : to + length] = data[origin : origin + length]
    if kind == "cut":
        del data[chance.randrange(len(data)) :]
    bad.write_bytes(data)
    if kind == "objects":
        with h5py.File(bad, "r+") as file:
            replace_object(file, chance)


def replace_object(file: h5py.File, chance: random.Random) -> None:
    """Remove an object and an attribute, and often put others in their places."""
    names: list[str] = []
    file.visit(names.append)
    name = chance.choice(names)
    attributes = file[chance.choice(names)].attrs
    for key in list(attributes)[:1]:
        attributes[key] = chance.choice([1, np.nan, "x" * 70, np.arange(9), "\n\x1b[31m", b"\xff"])
    del file[name]
    length = 10 ** chance.randrange(12)
    new = chance.choice([None, "far", h5py.SoftLink("/mesh"), h5py.ExternalLink("/dev/zero", "/x"),
                         np.nan, 2**62, "text", np.zeros((0, 3)), np.full(3, np.inf)])  # fmt: skip
    if isinstance(new, str) and new == "far":
        file.create_dataset(name, (length,), "f8", chunks=(min(length, 1024),))
    elif new is not None:
        file[name] = new


def status_of(arguments: list[str]) -> int:
    """Run a command in a process of its own, without the imports; negative for a signal."""
    child = os.fork()
    if not child:
        signal.alarm(HANGS)
        for number, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.argv = ["fecm", *arguments]
        try:
            fecm_main()
        except SystemExit as left:
            sys.stdout.flush()
            os._exit(left.code if isinstance(left.code, int) else 98)
        finally:
            os._exit(99)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def fault(command: str, status: int, out: str, err: str) -> str:
    """What is wrong with the end of a command; empty if nothing."""
    allowed = (0, 1, 2) if command == "diff" else (0, 2)
    if status not in allowed or "Traceback" in out + err:
        return f"status {status}: {err!r}"
    if status == 2 and (out or err.count("\n") != 1 or not err.startswith("fecm: error: ")):
        return f"status 2 without one line: {err!r}"
    if any("partial" in path.name for path in Path("made").iterdir()):
        return "a partial file is left"
    return ""


def main() -> int:
    """Damage files and run the commands."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--all", action="store_true", help="every command that reads results")
    parser.add_argument("--sweep", action="store_true", help="results of sweeps")
    options = parser.parse_args()
    commands = list(COMMANDS) if options.all else ["info", "diff"]
    ends: Counter[str] = Counter()
    broken = []
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        if options.sweep:
            text = small(PROGRAM.replace("         10", "        400"))  # every contact ends
            velocities = {"velocity": [50.0, 100.0, 150.0]}
            fecm.sweep(text, velocities, history=True, output="sound.h5")
        else:
            fecm.run(small(), output="sound.h5")
        for seed in range(options.seed, options.seed + options.count):
            damage(Path("sound.h5"), Path("bad.h5"), random.Random(seed))
            for command in commands:
                shutil.rmtree("made", ignore_errors=True)
                Path("made").mkdir()
                status = status_of([command, *COMMANDS[command].split()])
                out, err = Path("out").read_text(), Path("err").read_text()
                limit = [mark for mark in ("processor time", "crashed", "memory") if mark in err]
                ends[" ".join([command, str(status), *limit])] += 1
                if wrong := fault(command, status, out, err):
                    broken.append(f"seed {seed}, {command}: {wrong}")
    print(*broken, dict(sorted(ends.items())), f"broken {len(broken)}", sep="\n")
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
