"""The model under test: its response, its effects, its file."""
