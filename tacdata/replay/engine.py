"""Imports MuJoCo when it is needed; its bindings have no types."""

from __future__ import annotations

import importlib
from typing import Any


def mujoco() -> Any:
    """Return the module."""
    return importlib.import_module("mujoco")
