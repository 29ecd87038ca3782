"""Programs of other computers: to submit, fetch and solve."""
