"""What an emulated camera sees."""
