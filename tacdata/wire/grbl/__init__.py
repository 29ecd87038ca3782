"""The language of GRBL controllers."""
