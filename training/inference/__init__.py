"""A trained network on disk and in use."""
