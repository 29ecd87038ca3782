"""Estimates and tests on Gram matrices, robust to episodes that err by themselves."""
