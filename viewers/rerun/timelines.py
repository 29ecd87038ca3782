"""Names of a recording's clocks in Rerun; separate from modules that need Rerun, which the plain install lacks."""

HOST, DEVICE, DEVICE_TIME = "host_time", "device_frame", "device_time"
ELAPSED = "time"
"""Timeline of scenes whose times count from a beginning of their own."""
