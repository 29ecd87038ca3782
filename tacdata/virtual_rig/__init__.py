"""Emulated devices on real operating-system wires, with a simulated world behind them; see README.md."""

from tacdata.virtual_rig.world.mounting import mount

__all__ = ["mount"]
