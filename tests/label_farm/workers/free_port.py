"""A port that nobody listens on."""

import socket


def free_port():
    """Return one of this host's ports that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
