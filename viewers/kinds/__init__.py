"""What can be viewed, one kind a file."""
