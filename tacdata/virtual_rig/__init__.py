"""Emulated devices behind real operating-system wires, with a world of their own; see README.md."""

from tacdata.virtual_rig.world.mounting import mount

__all__ = ["mount"]
