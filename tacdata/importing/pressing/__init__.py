"""Presses of a trial: cut from its rows, described by their path or by a schedule."""
