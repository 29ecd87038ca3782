"""Contact laws: how a skin without memory answers to depth."""
