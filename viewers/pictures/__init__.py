"""Scenes drawn as pictures and films by matplotlib."""
