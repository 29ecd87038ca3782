"""Drivers of real devices, one per file; see `device.py` for the three kinds and the contents of a file."""
