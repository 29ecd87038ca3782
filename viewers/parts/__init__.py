"""Parts that several scenes share: maps, signals, skin, images."""
