"""The presses that would tell rivals apart."""
