"""Derivatives of a solved press by its parameters, and the standard deviations that follow."""
