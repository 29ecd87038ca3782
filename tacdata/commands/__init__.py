"""The verbs, one file each; see `command.py` for what a file must hold."""
