"""Kills checkpointing runs at random moments, resumes them and compares what comes out, by hand.

    python -m tests.kill_runs --count 200 --seed 0 [--workers 2]

Each trial starts a run with checkpoints, kills it (SIGKILL) after a random time, sometimes kills
the resumed run as well, resumes it, and compares the result byte by byte with that of a run that
nothing disturbed.
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

from tests.decks import LONG

FECM = [sys.executable, "-m", "fecm"]


def trial(folder: Path, whole: Path, seconds: float, seed: int) -> str:
    """Kill a run, resume it, compare; what became of it in a word."""
    chance = random.Random(seed)
    name = f"out{seed}.h5"
    command = [*FECM, "run", "deck.inp", "-o", name, "--checkpoint", "0.01"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    kills = 0
    for _ in range(3):
        resumed = (folder / f"{name}.checkpoint").exists()
        process = subprocess.Popen(
            [*command, *(["--resume"] if resumed else ["--overwrite"])], cwd=folder, **quiet
        )  # type: ignore[call-overload]
        if kills == 0 or chance.random() < 0.4:
            try:
                process.wait(chance.uniform(0.2, seconds))
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.wait()
                kills += 1
                continue
        if process.wait() != 0:
            return "failed"
        break
    # Killed on the way, or between the result's renaming and the checkpoint's removal.
    if not (folder / name).exists() or (folder / f"{name}.spool").exists():
        resumed = (folder / f"{name}.checkpoint").exists()
        last = [*command, *(["--resume"] if resumed else ["--overwrite"])]
        if subprocess.run(last, cwd=folder, check=False, **quiet).returncode:  # type: ignore[call-overload]
            return "failed"
    if not filecmp.cmp(folder / name, whole, shallow=False):
        return "differs"
    own = (f"out{seed}.", f".out{seed}.")
    rest = [path.name for path in folder.iterdir() if path.name.startswith(own)]
    if rest != [name]:
        return "left something behind"
    (folder / name).unlink()
    return f"same after {kills} kills"


def main() -> int:
    """Run the trials and count what became of them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "deck.inp").write_text(LONG.read_text())
        begin = time.monotonic()
        command = [*FECM, "run", "deck.inp", "-o", "whole.h5"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        seconds = 1.5 * (time.monotonic() - begin)
        seeds = range(options.seed, options.seed + options.count)
        with ThreadPoolExecutor(options.workers) as pool:
            results = pool.map(
                lambda seed: trial(folder, folder / "whole.h5", seconds, seed), seeds
            )
            counts = Counter(results)
    print(f"{options.count} runs: {dict(sorted(counts.items()))}")
    return 0 if all(word.startswith("same") for word in counts) else 1


if __name__ == "__main__":
    raise SystemExit(main())
