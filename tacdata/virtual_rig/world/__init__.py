"""The emulated skin, hand and operator."""
