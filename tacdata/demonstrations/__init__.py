"""Demonstrations by hand: fingertip paths and touch, recorded, smoothed and compensated."""
