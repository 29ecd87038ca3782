"""Condition of a unit: gains, drift, noise, hysteresis and wiring over its visits, and the remedy."""
