"""Principles by which a taxel turns loads into a capacitance, one per file; see `principle.py`."""
