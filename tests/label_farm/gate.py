"""A gate before the stand-in model: a test lets presses through when it has done what must come before.

A folder of tickets. Each solve takes one; while there is none, it waits. Without the folder every solve passes.
"""

import shutil
import time
from contextlib import suppress
from pathlib import Path

VARIABLE = "FAST_MODEL_GATE"
"""Environment variable of workers that names the folder."""


class Gate:
    """A closed gate, for workers that are started with its variables."""

    def __init__(self, folder):
        self.folder, self._given = Path(folder), 0
        self.folder.mkdir()

    @property
    def variables(self):
        """What workers find the gate by."""
        return {VARIABLE: str(self.folder)}

    def let(self, count):
        """Let so many more solves through."""
        for _ in range(count):
            (self.folder / str(self._given)).touch()
            self._given += 1

    def open(self):
        """Let everybody through from now on."""
        gone = self.folder.with_name(f"{self.folder.name}-open")
        self.folder.rename(gone)  # at once: nobody sees it half removed
        shutil.rmtree(gone)


def pass_gate(folder):
    """Take a ticket, as soon as there is one, or find no gate."""
    while (folder := Path(folder)).is_dir():
        with suppress(FileNotFoundError):
            for ticket in folder.iterdir():
                with suppress(FileNotFoundError):
                    ticket.unlink()
                    return
        time.sleep(0.01)
