"""What other computers run to submit, fetch and solve."""
