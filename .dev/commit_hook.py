"""A wheel built from a clone carries its commit: where it is installed there is no clone to ask."""

import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ASK = ("git", "describe", "--always", "--dirty=.dirty", "--exclude=*")


class CommitHook(BuildHookInterface):
    """Writes ``tacdata/commit.txt`` into the wheel (read by tacdata/provenance.py)."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the file, unless the install is editable or there is no clone."""
        root = Path(self.root)
        if version == "editable" or not (root / ".git").exists():
            return
        try:
            found = subprocess.run(ASK, cwd=root, capture_output=True, text=True, check=True, timeout=10).stdout
        except (OSError, subprocess.SubprocessError):
            return
        place = Path(self.directory) / "commit.txt"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(found)
        build_data["force_include"][str(place)] = "tacdata/commit.txt"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Leave nothing beside the wheel."""
        (Path(self.directory) / "commit.txt").unlink(missing_ok=True)
