"""The verbs, one file each; see `command.py` for the required content of a file."""
