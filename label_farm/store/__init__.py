"""Solved paths, filed by content."""
