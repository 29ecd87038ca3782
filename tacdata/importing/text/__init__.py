"""Text of foreign files: its encoding, and the layout of its columns."""
