"""Recording: devices in, one MCAP file per episode out, and back again."""
