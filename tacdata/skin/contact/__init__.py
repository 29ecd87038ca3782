"""Contact of the skin with the indenter and the board: friction, adhesion, first touch."""
