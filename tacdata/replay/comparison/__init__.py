"""Benefit of touch in a replay: control arms, stiffness, scenes unlike the demonstration."""
