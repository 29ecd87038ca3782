"""Evidence that a revised model is better: gap, curves, table, card."""
