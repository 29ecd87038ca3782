"""The label farm as a service; each file in this folder is a verb below ``tacdata farm``."""

from tacdata.commands.command import FARM

ORDER = 10
PANEL = FARM


def run() -> None:
    """Label as a service: up, submit, status, cancel, priority, worker."""
