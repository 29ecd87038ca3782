"""MuJoCo, imported when it is needed; its bindings carry no types, so it is handed out as it is."""

from __future__ import annotations

import importlib
from typing import Any


def mujoco() -> Any:
    """Return the module."""
    return importlib.import_module("mujoco")
