"""Names of the clocks that a recording in Rerun has; apart from what needs Rerun, which the plain install lacks."""

HOST, DEVICE, DEVICE_TIME = "host_time", "device_frame", "device_time"
ELAPSED = "time"
"""Timeline of scenes whose times count from a beginning of their own."""
