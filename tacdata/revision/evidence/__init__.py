"""What shows that a revised model is better: gap, curves, table, card."""
