"""Content of a picture, as plain arrays."""
