"""Images of an emulated camera."""
