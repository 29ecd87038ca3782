"""Newton's method along the load path of many presses at once."""
