"""Labels and networks under a revised model."""
