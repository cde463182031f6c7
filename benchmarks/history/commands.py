"""Processor time of the commands of processes.py: ``asv run``, ``asv publish``."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from processes import COMMANDS, seconds

ROUNDS = 5


class Commands:
    """A command from the start of its process to the end."""

    params = tuple(COMMANDS)
    param_names = ("command",)
    timeout = 300
    unit = "s"

    def setup(self, command: str) -> None:
        """Make the result that some commands read."""
        self.folder = tempfile.TemporaryDirectory()
        seconds(COMMANDS["run impact-115"], self.folder.name)

    def teardown(self, command: str) -> None:
        """Remove the files."""
        self.folder.cleanup()

    def track_processor_time(self, command: str) -> float:
        """Least of some rounds."""
        return min(seconds(COMMANDS[command], self.folder.name) for _ in range(ROUNDS))
