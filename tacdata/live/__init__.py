"""Live estimates: depth maps while the sensor is touched, messages for controllers, latencies."""
