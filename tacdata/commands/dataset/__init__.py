"""Edits of datasets; each file in this folder is a verb below ``tacdata dataset``."""

from tacdata.commands.command import DATA

ORDER = 80
PANEL = DATA


def run() -> None:
    """Edit datasets and keep their records: restore, delete, split, merge."""
