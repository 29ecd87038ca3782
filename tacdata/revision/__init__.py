"""Acts on a verdict: adds the effect, makes labels again, shows the gap, plans the next presses."""
