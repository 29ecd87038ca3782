"""A path as readers take it."""

from __future__ import annotations

from os import PathLike

type StrPath = str | PathLike[str]
"""Text or a path; every reader of the library takes both."""
