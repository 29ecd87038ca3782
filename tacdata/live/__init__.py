"""Depth maps while the sensor is touched: windows over a stream, messages for controllers, latencies."""
