"""Plans the presses that would tell rivals apart."""
