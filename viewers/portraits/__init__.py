"""Pictures of nouns for a notebook, one class a file."""
