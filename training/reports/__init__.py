"""Scores as pages, tables and pictures."""
