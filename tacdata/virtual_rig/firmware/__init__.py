"""An emulated motion controller."""
