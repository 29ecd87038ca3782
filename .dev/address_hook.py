"""The project's addresses are those of the repository that it is built from: no file of the clone holds one."""

import re
import subprocess
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PAGES = {
    "Source": "",
    "Issues": "/issues",
    "Changelog": "/blob/main/CHANGELOG.md",
    "Documentation": "/blob/main/docs/README.md",
}


class AddressHook(MetadataHookInterface):
    """Fills in ``[project.urls]``; leaves it empty where the clone has no remote on a public host."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the addresses."""
        origin = _origin(Path(self.root))
        metadata["urls"] = {name: origin + page for name, page in PAGES.items()} if origin else {}


def _origin(root: Path) -> str:
    """Return the address of the remote ``origin`` for a browser; empty without one."""
    ask = ("git", "config", "--get", "remote.origin.url")
    try:
        remote = subprocess.run(ask, cwd=root, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
    match = re.fullmatch(r"(?:https://|(?:ssh://)?git@)(?:[^@/]*@)?([\w.-]+\.\w+)[:/](.+?)(?:\.git)?/?", remote)
    return f"https://{match[1]}/{match[2]}" if match else ""
