"""The constant delay of each stream, measured by a sync tap."""
