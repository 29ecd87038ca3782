"""The label farm as a service; each file in this folder is a verb below ``tacdata farm``."""

from tacdata.commands.command import TOOLS

ORDER = 105
PANEL = TOOLS


def run() -> None:
    """Label as a service: up, submit, status, cancel, priority, worker."""
