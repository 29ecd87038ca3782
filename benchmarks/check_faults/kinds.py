"""The kinds of fault that are planted, each with three sizes."""

import numpy as np
from recorded import RATE
from recording_examples import SENSOR

from tacdata.devices.device import CncStatus

MS = 1_000_000
KINDS = {}
ONE, LATER, ALL = "one", "later", "all"
"""Which presses a fault concerns."""
UNKNOWABLE = "not knowable"
"""Faults that one session cannot show: printed, but not counted."""


def kind(group, sizes, whole=ONE):
    """Register ``plant(press, size, rng)`` with three sizes, for one press, for all, or for the second half."""

    def keep(plant):
        KINDS[plant.__name__.replace("_", " ")] = plant, group, sizes, whole
        return plant

    return keep


@kind("drops", (1, 5, 20))
def frames_lost(p, size, rng):
    """Lose frames; the counter shows it."""
    p.drop(60, 60 + size)


@kind("drops", (8, 15, 30))
def frames_lost_without_a_gap_in_the_counter(p, size, rng):
    """Lose frames before they are counted."""
    p.drop(60, 60 + size)
    p.counter = np.arange(len(p.sample)) + 500


@kind("repeats", (1, 5, 20))
def frames_twice(p, size, rng):
    """Store frames twice."""
    again = np.sort(np.concatenate([np.arange(len(p.sample)), np.arange(60, 60 + size)]))
    for name in ("sample", "counter", "arrival", "counts"):
        setattr(p, name, getattr(p, name)[again])


@kind("repeats", (2, 5, 45))
def values_held(p, size, rng):
    """Hold all readings for some frames."""
    p.counts[p.row() : p.row() + size] = p.counts[p.row()]


@kind("channels", (15, 30, 400))
def channel_sticks(p, size, rng):
    """Hold one channel from the hold on."""
    p.counts[p.row() : p.row() + size, p.strongest] = p.counts[p.row(), p.strongest]


@kind("channels", (1, 2, 6), whole=ALL)
def channels_swapped(p, size, rng):
    """Swap pairs of channels."""
    pairs = rng.permutation(24)[: 2 * size].reshape(-1, 2)
    order = np.arange(24)
    order[pairs[:, 0]], order[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    p.counts = p.counts[:, order]


@kind("channels", (1.5, 2.0, 4.0), whole=LATER)
def channel_rescaled(p, size, rng):
    """Rescale the answer of one channel."""
    channel = int(rng.integers(24))
    idle = np.median(p.counts[:10, channel])
    p.counts[:, channel] = np.round(idle + size * (p.counts[:, channel] - idle))


@kind("channels", (1.3, 1.6, 2.5), whole=LATER)
def all_rescaled(p, size, rng):
    """Rescale all answers."""
    idle = np.median(p.counts[:10], axis=0)
    p.counts = np.round(idle + size * (p.counts - idle))


@kind("channels", (0, 1, 2), whole=ALL)
def plug_turned(p, size, rng):
    """Turn or mirror the array."""
    grid = np.arange(24).reshape(SENSOR.taxels.rows, -1)
    p.counts = p.counts[:, (grid[::-1, ::-1], grid[:, ::-1], grid[::-1])[size].ravel()]


@kind("channels", (1, 3, 8), whole=LATER)
def dead_channels(p, size, rng):
    """Let channels stand still."""
    p.counts[:, rng.permutation(24)[:size]] = 9000


@kind("channels", (1, 2, 5))
def channels_tied(p, size, rng):
    """Let pairs of channels read the same."""
    pairs = rng.permutation(24)[: 2 * size].reshape(-1, 2)
    p.counts[:, pairs[:, 0]] = p.counts[:, pairs[:, 1]]


@kind("time", (60, 150, 400))
def taxels_late(p, size, rng):
    """Let readings come late [ms]."""
    p.felt(late_ns=size * MS)


@kind("time", (60, 150, 400))
def motion_late(p, size, rng):
    """Let the motion come late [ms]."""
    p.statuses = [
        CncStatus(s.sent_ns, s.arrival_ns, s.state, p.report(s.sent_ns + (4 - size) * MS), s.feed) for s in p.statuses
    ]
    p.felt(late_ns=size * MS)


@kind("time", (400, 1000, 3000))
def clock_drifts(p, size, rng):
    """Let the board's clock drift [ppm]."""
    p.sampled(RATE / (1 + size * 1e-6))


@kind("time", (60, 150, 500))
def clock_steps(p, size, rng):
    """Let the board's clock step [ms]."""
    later = (np.arange(len(p.sample)) >= 60) * size * MS
    p.sample, p.arrival = p.sample + later, p.arrival + later


@kind("time", (3, 10, 40))
def rate_is_wrong(p, size, rng):
    """Sample more slowly than nominal [%]."""
    p.sampled(RATE * (1 - size / 100))


@kind("time", (300, 700, 1500))
def host_stalls(p, size, rng):
    """Let the computer stand still [ms]."""
    begin = int(p.arrival[60])
    p.arrival = np.where((p.arrival >= begin) & (p.arrival < begin + size * MS), begin + size * MS, p.arrival)


@kind("time", (0.5, 2.0, 5.0))
def taxels_end_early(p, size, rng):
    """End the readings early [s]."""
    p.drop(int(np.searchsorted(p.sample, p.end - size * 1e9)), len(p.sample))


@kind("readings", (0.9, 0.7, 0.4))
def saturation(p, size, rng):
    """Limit all answers [share of the peak]."""
    peak = (p.counts - 9000).max()
    p.counts = np.minimum(p.counts, np.round(9000 + size * peak))


@kind("readings", (6, 12, 30))
def channel_noisy(p, size, rng):
    """Add noise to one channel [times its own]."""
    p.counts[:, int(rng.integers(24))] += np.round(rng.normal(0, 5 * size, len(p.counts)))


@kind("readings", (4, 10, 30), whole=LATER)
def all_noisy(p, size, rng):
    """Add noise to all channels [times their own]."""
    p.counts = p.counts + np.round(rng.normal(0, 5 * size, p.counts.shape))


@kind("readings", (1, 10, 100))
def no_numbers(p, size, rng):
    """Let readings be no numbers."""
    p.counts[60 : 60 + size, int(rng.integers(24))] = np.nan


@kind("readings", (100, 400, 1500))
def channel_jumps_in_the_hold(p, size, rng):
    """Shift one channel in the hold [counts]."""
    p.counts[p.row() :, int(rng.integers(24))] += size


@kind("readings", (100, 400, 1500))
def supply_steps(p, size, rng):
    """Shift all channels in the hold [counts]."""
    p.counts[p.row() :] += size


@kind("readings", (300, 1000, 5000))
def spikes(p, size, rng):
    """Add three spikes to one channel [counts]."""
    p.counts[p.row() + np.array([-5, 0, 5]), int(rng.integers(24))] += size


@kind("contact", (1.0, 2.0, 4.0), whole=LATER)
def tool_slips_sideways(p, size, rng):
    """Shift the tool sideways from mid-session on [mm]."""
    p.felt(x=size)


@kind("contact", (0.2, 0.4, 0.8), whole=LATER)
def tool_slips_up(p, size, rng):
    """Shift the tool up from mid-session on [mm]."""
    p.felt(up=size)


@kind(UNKNOWABLE, (1.3, 1.6, 2.5), whole=ALL)
def all_rescaled_from_the_first_press_on(p, size, rng):
    """Rescale all answers of the session: they look like those of a softer skin."""
    all_rescaled(p, size, rng)


@kind(UNKNOWABLE, (0.1, 0.2, 0.3), whole=ALL)
def tool_up_from_the_first_press_on(p, size, rng):
    """Shift the tool up in the whole session [mm]: it looks like a skin that answers later."""
    p.felt(up=size)


@kind("contact", (1.0, 2.0, 4.0), whole=LATER)
def labels_of_another_place(p, size, rng):
    """Write another place into the label [mm away]."""
    document = {**p.header.press.document}
    document["x"] = document["x"] - size * np.sign(document["x"] or 1.0)
    object.__setattr__(p.header, "press", type(p.header.press).from_document(document))


@kind("controller", (0.06, 0.15, 0.4))
def guide_stops_short(p, size, rng):
    """Let the guide stop short [mm]."""
    lowest = min(s.position[2] for s in p.statuses)
    p.statuses = [
        CncStatus(s.sent_ns, s.arrival_ns, s.state, np.maximum(s.position, [-99, -99, lowest + size]), s.feed)
        for s in p.statuses
    ]


@kind("controller", (16, 32, 1000))
def reports_missing(p, size, rng):
    """Lose status reports."""
    middle = len(p.statuses) // 2
    p.statuses = p.statuses[: max(middle - size // 2, 0)] + p.statuses[middle + size // 2 :]


@kind("controller", (1, 3, 10))
def alarm(p, size, rng):
    """Report an alarm."""
    for k in range(30, 30 + size):
        s = p.statuses[k]
        p.statuses[k] = CncStatus(s.sent_ns, s.arrival_ns, "Alarm:1", s.position, s.feed)


@kind("line", (1, 10, 100))
def damaged_frames(p, size, rng):
    """Discard damaged frames."""
    p.driver.corrupt = size
    p.drop(60, 60 + max(size // 10, 1))
