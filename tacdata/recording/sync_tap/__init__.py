"""The constant latency of each stream, measured by a sync tap."""
