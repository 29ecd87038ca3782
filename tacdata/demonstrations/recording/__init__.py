"""Demonstrations by hand, recorded."""
