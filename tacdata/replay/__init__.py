"""Replays demonstrations: fingertip targets, joint values, and a simulated scene to try them in."""
