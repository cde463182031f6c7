"""Kills checkpointing runs at random moments, resumes them and compares what comes out, by hand.

    python -m tests.kill_runs --count 200 --seed 0 [--workers 2] [--sweeps | --nonlinear]

Each trial starts a run with checkpoints, kills it (SIGKILL) after a random time, sometimes kills
the resumed run as well, resumes it, and compares the result byte by byte with that of a run that
nothing disturbed. With ``--nonlinear`` the plate stretches as it bends.

With ``--sweeps`` each trial starts a sweep of several plates, every second one with two worker
processes. It kills the sweep up to four times, sometimes damages a finished part after a kill,
gives the same command again until it ends, and compares the results in the same way.
"""

from __future__ import annotations

import argparse
import filecmp
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.decks import LONGER, PROGRAM, small
from tests.nonlinear_impacts import struck_rectangle, with_rows

FECM = [sys.executable, "-m", "fecm"]
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
SWEEP = [
    *FECM, "sweep", "sweep.inp", "--vary",
    "layup=" + ",".join(f"[{angle}/{angle - 90}]" for angle in range(0, 80, 10)), "-o",
]  # fmt: skip
SWEPT = small(PROGRAM.replace(".5E-6", ".2E-6").replace("LOOP         10", "LOOP        500"))


def stretching() -> str:
    """A deck of a plate that stretches as it bends, with as many steps and stored rows."""
    built = struck_rectangle("cross_ss_immovable", 12, 1667.3332, 3.6e-3)
    return with_rows(built, 100).to_text()


def status_or_kill(command: list[str], folder: Path, seconds: float | None) -> int | None:
    """Exit status of a command; None if it was killed because it did not end in time."""
    process = subprocess.Popen(command, cwd=folder, **QUIET)  # type: ignore[call-overload]
    try:
        return int(process.wait(seconds))
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
        return None


def damage(path: Path, chance: random.Random) -> None:
    """Change a byte of a file, or cut the file off there."""
    data = path.read_bytes()
    at = chance.randrange(len(data))
    changed = bytes([data[at] ^ chance.randrange(1, 256)]) + data[at + 1 :]
    path.write_bytes(data[:at] + chance.choice([b"", changed]))


def verdict(folder: Path, name: str, whole: Path) -> str:
    """Compare a result with the undisturbed one; where nothing else is left, remove it."""
    if not filecmp.cmp(folder / name, whole, shallow=False):
        return "differs"
    own = (f"{Path(name).stem}.", f".{Path(name).stem}.")
    rest = [path.name for path in folder.iterdir() if path.name.startswith(own)]
    if rest != [name]:
        return "left something behind"
    (folder / name).unlink()
    return "same"


def sweep_trial(folder: Path, whole: Path, seconds: float, seed: int) -> Counter[str]:
    """Kill a sweep, run it again until it ends, compare; count kills, damaged parts and verdict."""
    chance = random.Random(seed)
    name = f"sweep{seed}.h5"
    command = [*SWEEP, name, "--workers", str(1 + seed % 2)]
    counts: Counter[str] = Counter()
    status = None
    while status is None:
        # A sweep that was killed between renaming its result and removing its parts has ended.
        ended = ["--overwrite"] if (folder / name).exists() else []
        patience = chance.uniform(0.2, seconds) if counts["kills"] < 4 else None
        status = status_or_kill([*command, *ended], folder, patience)
        if status is None:
            counts["kills"] += 1
            parts = sorted((folder / f".{name}.parts").glob("task-*.npz"))
            if parts and chance.random() < 0.4:
                damage(chance.choice(parts), chance)
                counts["damaged parts"] += 1
    counts["failed" if status else verdict(folder, name, whole)] += 1
    return counts


def trial(folder: Path, whole: Path, seconds: float, seed: int) -> str:
    """Kill a run, resume it, compare; what became of it in a word."""
    chance = random.Random(seed)
    name = f"out{seed}.h5"
    command = [*FECM, "run", "deck.inp", "-o", name, "--checkpoint", "0.01"]
    kills = 0
    for _ in range(3):
        resumed = (folder / f"{name}.checkpoint").exists()
        patience = None
        if kills == 0 or chance.random() < 0.4:
            patience = chance.uniform(0.2, seconds)
        how = "--resume" if resumed else "--overwrite"
        status = status_or_kill([*command, how], folder, patience)
        if status is None:
            kills += 1
            continue
        if status != 0:
            return "failed"
        break
    # Killed on the way, or between the result's renaming and the checkpoint's removal.
    if not (folder / name).exists() or (folder / f"{name}.spool").exists():
        resumed = (folder / f"{name}.checkpoint").exists()
        last = [*command, *(["--resume"] if resumed else ["--overwrite"])]
        if subprocess.run(last, cwd=folder, check=False, **QUIET).returncode:  # type: ignore[call-overload]
            return "failed"
    word = verdict(folder, name, whole)
    return f"same after {kills} kills" if word == "same" else word


def main() -> int:
    """Run the trials and count what became of them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--sweeps", action="store_true")
    kind.add_argument("--nonlinear", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "deck.inp").write_text(stretching() if options.nonlinear else LONGER)
        (folder / "sweep.inp").write_text(SWEPT)
        command = SWEEP if options.sweeps else [*FECM, "run", "deck.inp", "-o"]
        begin = time.monotonic()
        subprocess.run([*command, "whole.h5"], cwd=folder, check=True, capture_output=True)
        seconds = 1.5 * (time.monotonic() - begin)

        def counted(seed: int) -> Counter[str]:
            if options.sweeps:
                return sweep_trial(folder, folder / "whole.h5", seconds, seed)
            return Counter([trial(folder, folder / "whole.h5", seconds, seed)])

        seeds = range(options.seed, options.seed + options.count)
        with ThreadPoolExecutor(options.workers) as pool:
            counts: Counter[str] = sum(pool.map(counted, seeds), Counter())
    what = "sweeps" if options.sweeps else "runs"
    print(f"{options.count} {what}: {dict(sorted(counts.items()))}")
    same = sum(count for word, count in counts.items() if word.startswith("same"))
    return 0 if same == options.count else 1


if __name__ == "__main__":
    raise SystemExit(main())
