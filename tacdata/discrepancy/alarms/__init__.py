"""Structure of the residual without any form: an alarm has no name; it reports the pattern and its place."""
