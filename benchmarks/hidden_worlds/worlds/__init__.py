"""Worlds with hidden effects: independent of the code under test."""
