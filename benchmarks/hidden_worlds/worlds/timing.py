"""When readings are taken."""

from worlds.hidden import hidden


@hidden("timing", "lag", fitted=True, most=6, both=True)
def latency(w, s):
    """Constant."""
    w.delay = w.delay + 0.04 * s
    w.tell("latency", L=0.04 * s)


@hidden("timing", "lag", fitted=True, most=6, both=True)
def clock_skew(w, s):
    """The sensor's clock runs slow."""
    w.delay = w.delay + 0.12 * s * (w.clock / w.clock[-1] - 0.5)
    w.tell("clock_skew", r=0.12 * s)


@hidden("timing", "lag", fitted=True, most=6, both=True)
def scan_skew(w, s):
    """Channels are read one after the other."""
    w.scan = w.scan + 0.05 * s
    w.tell("scan_skew", D=0.05 * s)
