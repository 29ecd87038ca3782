"""Contribution of each effect to the readings, as regression columns."""
