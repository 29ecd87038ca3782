"""What touch was worth in a replay: control arms, stiffness, scenes unlike the demonstration."""
