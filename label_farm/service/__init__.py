"""The farm over HTTP: submissions that survive a restart, workers of other computers, a page."""
