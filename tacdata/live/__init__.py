"""Live estimates: depth maps during touch, messages for controllers, latencies."""
