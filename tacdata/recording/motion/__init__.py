"""The motion of a press: its steps, profile and preflight check."""
