"""Disagreement of simulation and measurement: its place, the missing effect, and the next presses to record."""
