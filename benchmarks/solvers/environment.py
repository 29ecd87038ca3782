"""Virtual environments for peers from PyPI, outside of the repository, so that none of them touches ours."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path


def interpreter(folder: Path, name: str, module: str) -> Path | None:
    """Return the Python of the environment ``folder/name`` if it can import ``module``."""
    python = folder / name / "bin" / "python"
    if not python.exists():
        return None
    tried = subprocess.run([str(python), "-c", f"import {module}, numpy"], capture_output=True, check=False)
    return None if tried.returncode else python


def install(folder: Path, name: str, requirement: str) -> str | None:
    """Make the environment ``folder/name`` with ``requirement`` and NumPy; return the error, or None."""
    place = folder / name
    folder.mkdir(parents=True, exist_ok=True)
    if uv := shutil.which("uv"):
        commands = [
            [uv, "venv", "--quiet", "--clear", "--python", sys.executable, str(place)],
            [uv, "pip", "install", "--quiet", "--python", str(place / "bin" / "python"), requirement, "numpy"],
        ]
    else:
        commands = [
            [sys.executable, "-m", "venv", "--clear", str(place)],
            [str(place / "bin" / "python"), "-m", "pip", "install", "--quiet", requirement, "numpy"],
        ]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            return (done.stderr or done.stdout).strip().splitlines()[-1]
    return None
