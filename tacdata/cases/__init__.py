"""A case: one press for the skin model alone, from a file to an answer."""
