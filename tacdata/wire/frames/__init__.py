"""Frames of taxel readings as bytes."""
