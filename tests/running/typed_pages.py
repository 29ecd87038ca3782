"""The commands that a page shows, as the words that a person types."""

import re
import shlex
from pathlib import Path

HOW_TO = Path(__file__).resolve().parents[2] / "docs" / "how_to"
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page, language):
    """Return the blocks of a page in one language."""
    return [body for kind, body in BLOCK.findall(page.read_text()) if kind == language]


def commands(page):
    """Return a page's commands as words, without "tacdata"."""
    lines = [line for body in blocks(page, "sh") for line in body.splitlines()]
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("tacdata ")]
