"""Episodes as a list and as a page to choose from."""
