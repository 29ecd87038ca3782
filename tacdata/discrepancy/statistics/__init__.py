"""Estimates and tests on Gram matrices, robust to single deviant episodes."""
