"""What is shown, as plain arrays."""
