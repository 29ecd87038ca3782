"""Says how a unit is: gains, drift, noise, hysteresis and wiring over its visits, and what to do."""
