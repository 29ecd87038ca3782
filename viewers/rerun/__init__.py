"""Scenes drawn in Rerun."""
