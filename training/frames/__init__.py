"""Labelled frames as arrays for the trainer."""
