"""Networks that know the skin before its first recorded press."""
