"""Learn depth maps from taxel signals, and say how well."""
