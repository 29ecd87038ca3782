"""Scenes of recordings, labels, predictions and verdicts as plain arrays, and backends that draw them."""
