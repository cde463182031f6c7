"""A long fuzz run of the commands that read result files, by hand.

    python -m tests.fuzz_results --count 10000 --seed 0

Each mutated file (bytes flipped, blocks put elsewhere, cut short, groups and attributes removed or
put in the place of others) goes through ``fecm info`` and ``fecm diff``, against the sound file, as
a program of its own that a user's shell would start, but for the imports.  It must end by itself,
with status 0, 1 (`diff` only), or 2 and then one line on standard error.  Prints what broke, with
the seed that makes it again, and the counts.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fecm import sweep
from fecm.api import run
from fecm.cli import main as fecm
from tests.decks import PROGRAM, small

# Seconds of the clock after which a command hangs.
HANGS = 60.0

# Commands and their arguments; {} is the damaged file.
COMMANDS = {
    "info": ["{}"],
    "diff": ["{sound}", "{}"],
    "tapes": ["{}", "-d", "{made}"],
    "export csv": ["{}", "--to", "csv", "-o", "{made}/x.csv"],
    "export vtkhdf": ["{}", "--to", "vtkhdf", "-o", "{made}/x.vtkhdf"],
    "plot": ["{}", "--kind", "force", "--kind", "line", "-o", "{made}"],
}
SWEEP = "sweep"
USUAL = ("info", "diff")
OF_A_SWEEP = {
    "info": ["{}"],
    "diff": ["{sound}", "{}"],
    "plot map": ["{}", "-o", "{made}"],
    "export csv": ["{}", "--to", "csv", "--dataset", "history", "-o", "{made}/x.csv"],
}


def mutate(source: Path, target: Path, random: random.Random) -> str:
    """Write a damaged copy; what was done in a word."""
    kind = random.choice(["flip", "flip", "flip", "flip", "block", "cut", "remove", "replace"])
    if kind in ("remove", "replace"):
        shutil.copyfile(source, target)
        with h5py.File(target, "r+") as file:
            for _ in range(random.choice([1, 1, 2, 4])):
                # What HDF5 itself refuses to make stays undone.
                with contextlib.suppress(ValueError, TypeError, KeyError, OSError, RuntimeError):
                    _rearrange(file, kind, random)
        return kind
    data = bytearray(source.read_bytes())
    if kind == "cut":
        del data[random.randrange(len(data)) :]
    elif kind == "block":
        _move_blocks(data, random)
    else:
        places = _structure(bytes(data)) if random.random() < 0.7 else range(len(data))
        for _ in range(random.choice([1, 1, 2, 3, 8, 30])):
            at = random.choice(places)
            data[at] = random.choice(
                [data[at] ^ 1 << random.randrange(8), random.randrange(256), 0, 255]
            )
    target.write_bytes(data)
    return kind


def _structure(data: bytes) -> list[int]:
    """Places that are HDF5's own rather than numbers of the result: near its signatures."""
    places: list[int] = list(range(96))
    for mark in (b"TREE", b"HEAP", b"SNOD", b"GCOL", b"\x01\x00", b"description", b"fecm"):
        at = data.find(mark)
        while at >= 0:
            places += range(at, min(at + 160, len(data)))
            at = data.find(mark, at + 160)
    return places


def _move_blocks(data: bytearray, random: random.Random) -> None:
    for _ in range(random.choice([1, 2, 5])):
        length = random.choice([1, 8, 64, 512, 4096])
        to, origin = random.randrange(len(data)), random.randrange(len(data))
        block = random.choice([bytes(length), b"\xff" * length, data[origin : origin + length]])
        data[to : to + len(block)] = block[: len(data) - to]


def _rearrange(file: h5py.File, kind: str, random: random.Random) -> None:
    """Remove a group, a dataset or an attribute, or put something else in its place."""
    names: list[str] = []
    file.visit(names.append)
    if not names:
        return
    name = random.choice(names)
    item = file[name]
    if random.random() < 0.4:
        attributes = item.attrs if random.random() < 0.5 else file.attrs
        if len(attributes):
            key = random.choice(list(attributes))
            del attributes[key]
            if kind == "replace":
                attributes[key] = random.choice(
                    [1, np.nan, "x" * 70, ["a", "b"], np.arange(9), "\n\x1b[31m", b"\xff", True]
                )
        return
    dtype = item.dtype if isinstance(item, h5py.Dataset) else "f8"
    del file[name]
    if kind == "remove":
        return
    choice = random.randrange(6)
    if choice == 0:
        file[name] = h5py.SoftLink(f"/{random.choice(names)}")
    elif choice == 1:
        file[name] = h5py.ExternalLink("/dev/zero", "/x")
    elif choice == 2:
        length = 10 ** random.randrange(12)
        file.create_dataset(name, (length,), dtype, chunks=(min(length, 1024),))
    elif choice == 3:
        file.create_dataset(name, data=random.choice([np.nan, "text", [["a"]], 1e300, 2**62]))
    elif choice == 4:
        file.create_group(name).create_group("again")
    else:
        shape = tuple(random.randrange(4) for _ in range(random.randrange(4)))
        file.create_dataset(name, data=np.full(shape, random.choice([0.0, np.inf, 3.0])))


@dataclass
class Tally:
    """What became of the commands.

    Attributes
    ----------
    ended : Counter
        Exit statuses by command: ``"info 0"``.
    limits : Counter
        Why a child did not end by itself, where it did not.
    broken : list of str
    longest : float
        Time of the longest command (s).
    memory : int
        Most memory that a process had (bytes).
    """

    ended: Counter[str] = field(default_factory=Counter)
    limits: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)
    longest: float = 0.0
    memory: int = 0

    def add(self, told: dict[str, Any]) -> None:
        """Add what a worker told."""
        self.ended.update(told["ended"])
        self.limits.update(told["limits"])
        self.broken += told["broken"]
        self.longest = max(self.longest, told["longest"])
        self.memory = max(self.memory, told["memory"])


def call(arguments: list[str], out: Path, err: Path) -> int:
    """Carry out a command in a process of its own; its exit status, negative for a signal."""
    child = os.fork()
    if not child:
        status = 99
        try:
            for number, path in ((1, out), (2, err)):
                os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
            sys.argv = ["fecm", *arguments]
            fecm()
        except SystemExit as left:
            status = left.code if isinstance(left.code, int) else 98
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    until = time.monotonic() + HANGS
    while time.monotonic() < until:
        done, status, _ = os.wait4(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGTERM)
    os.waitpid(child, 0)
    return -99


def judge(command: str, status: int, out: str, err: str) -> str:
    """What is wrong with the end of a command; empty if nothing."""
    if status == -99:
        return f"hangs for {HANGS} s"
    if "Traceback" in out + err:
        return f"a traceback: {err.strip().splitlines()[-1]}"
    if status not in (0, 1, 2) or (status == 1 and command != "diff"):
        return f"status {status}: {err.strip()}"
    if status == 2 and (out or err.count("\n") != 1 or not err.startswith("fecm: error: ")):
        return f"status 2 without one line: {err!r}"
    notes = command == "plot" or command.startswith("export")
    if status != 2 and ((err and not notes) or not out):
        return f"status {status} with {err!r} on standard error"
    return ""


def examine(sound: Path, folder: Path, seed: int, commands: Sequence[str], tally: Tally) -> None:
    """Damage the file in the way of a seed, and put it through the commands."""
    import resource  # not on Windows, which can import this module

    bad, out, err, made = (folder / name for name in ("bad.h5", "out", "err", "made"))
    kind = mutate(sound, bad, random.Random(seed))
    for command in commands:
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir()
        texts = (OF_A_SWEEP if sound.stem == SWEEP else COMMANDS)[command]
        arguments = [text.format(bad, sound=sound, made=made) for text in texts]
        begin = time.monotonic()
        status = call([*command.split()[:1], *arguments], out, err)
        tally.longest = max(tally.longest, time.monotonic() - begin)
        told = err.read_text()
        tally.ended[f"{command} {status}"] += 1
        for mark in ("did not return", "crashed (", "takes more memory", "was killed"):
            if mark in told:
                name = told.partition("crashed (")[2].partition(")")[0] if "(" in mark else mark
                tally.limits[name] += 1
        if wrong := judge(command, status, out.read_text(), told):
            tally.broken.append(f"seed {seed} ({kind}), {command}: {wrong}")
        if partial := [path.name for path in made.iterdir() if "partial" in path.name]:
            tally.broken.append(f"seed {seed} ({kind}), {command}: {partial} is left behind")
    tally.memory = max(tally.memory, 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)


def work(first: int, count: int, step: int, commands: Sequence[str]) -> Tally:
    """Examine every `step`-th seed of a range."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sound = folder / (f"{SWEEP}.h5" if "plot map" in commands else "run.h5")
        if sound.stem == SWEEP:
            text = small(PROGRAM.replace("         10", "        400"))  # every contact ends
            sweep(
                text,
                {"velocity": [50.0, 100.0, 150.0], "alpha_p": [0.0005, 0.0007]},
                history=True,
                output=sound,
            )
        else:
            run(small(), output=sound)
        for seed in range(first, first + count, step):
            examine(sound, folder, seed, commands, tally)
    return tally


def main() -> int:
    """Share the seeds out to workers, and print what they tell."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--step", type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument("--all", action="store_true", help="every command that reads results")
    parser.add_argument("--sweep", action="store_true", help="results of sweeps")
    options = parser.parse_args()
    commands = list(COMMANDS) if options.all else USUAL
    if options.sweep:
        commands = list(OF_A_SWEEP)
    if options.step:
        tally = work(options.seed, options.count, options.step, commands)
        print(json.dumps(tally.__dict__))
        return 0
    begin = time.monotonic()
    environment = {"FECM_PATIENCE": "1", **os.environ, "OPENBLAS_NUM_THREADS": "1"}
    head = [sys.executable, "-W", "ignore", "-m", "tests.fuzz_results"]
    workers = []
    for number in range(options.workers):
        arguments = ["--seed", options.seed + number, "--count", options.count - number,
                     "--step", options.workers, *["--all"] * options.all,
                     *["--sweep"] * options.sweep]  # fmt: skip
        workers.append(
            subprocess.Popen(
                [*head, *map(str, arguments)], env=environment, stdout=subprocess.PIPE, text=True
            )
        )
    tally = Tally()
    for worker in workers:
        told, _ = worker.communicate()
        if worker.returncode:
            tally.broken.append(f"a worker ended with {worker.returncode}")
        else:
            tally.add(json.loads(told))
    print(*tally.broken, sep="\n", end="\n" if tally.broken else "")
    print(
        f"{options.count} files from seed {options.seed} in {time.monotonic() - begin:.0f} s: "
        f"{dict(sorted(tally.ended.items()))}, ended from without {dict(tally.limits)}, broken "
        f"{len(tally.broken)}, longest {tally.longest:.1f} s, peak memory "
        f"{tally.memory / 1e6:.0f} MB"
    )
    return 1 if tally.broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
