"""Clock models: device counters on the host's clock."""
