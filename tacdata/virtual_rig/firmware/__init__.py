"""An emulated GRBL controller."""
