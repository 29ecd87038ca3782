"""Paths as readers take them, and the folder of the user's cache."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path

type StrPath = str | PathLike[str]
"""Text or a path; every reader of the library takes both."""


def cache_folder() -> Path:
    """Return the folder of data that can be made again: ``TACDATA_CACHE``, or the user's cache folder."""
    root = os.environ.get("TACDATA_CACHE")
    return Path(root) if root else Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "tacdata"
