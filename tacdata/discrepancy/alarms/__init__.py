"""What the residual shows without any form: an alarm has no name, and says what was seen, and where."""
