"""What each effect would add to the readings, as regression columns."""
