"""label_farm."""
