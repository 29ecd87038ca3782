"""Presses to solve, as jobs, and the model that solves them."""
