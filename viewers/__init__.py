"""What there is to see, as plain arrays, and the backends that draw it."""
