"""Advice on a unit: nothing, tare, register, check the machine, recalibrate, check wiring, replace."""

from collections.abc import Iterable
from dataclasses import dataclass

from tacdata.health.comparison import Change
from tacdata.health.history import History
from tacdata.health.wiring import Wiring

NOTHING, FIRST, TARE, REGISTER = "nothing", "first visit", "tare again", "register again"
ALL_WELL = "all well"
"""Printed where there is nothing to do."""
MACHINE, RECALIBRATE, WIRING, REPLACE = "check the machine", "recalibrate", "check wiring", "replace"
MOST_FAULTY = 0.125
"""Share of channels without readings from which a unit is to be replaced [1]; three at least."""
MANY = 0.5
"""Share of the channels from which a change is reported for all of them [1]."""
PERCENT = {"common gain", "gain", "loop", "repeatability", "network error"}
"""Quantities that are reported in percent."""
CALLED = {
    "common gain": "gain of all channels",
    "gain": "gain",
    "zero": "zero",
    "drift": "drift without contact",
    "noise": "noise",
    "loop": "area of the hysteresis loop",
    "repeatability": "spread of a press repeated",
    "depth": "depth of the tip at the same commanded depth",
    "x": "place of the tip along x",
    "y": "place of the tip along y",
    "network error": "error of the network",
}
ABSOLUTE = {"drift", "repeatability"}
"""Quantities of one visit, which are compared with nothing."""


@dataclass(frozen=True)
class Advice:
    """One thing to do."""

    do: str
    """One of the words above."""
    channels: tuple[int, ...]
    """Channels that it concerns; none for the whole unit."""
    why: str
    """In a sentence."""

    @property
    def spoken(self) -> str:
        """The advice in print."""
        return ALL_WELL if self.do == NOTHING else self.do


def advice(history: History) -> tuple[Advice, ...]:
    """Return the advice, the gravest first."""
    faults, changed = history.wiring, history.changed
    shifted = elsewhere(history)
    if shifted:  # gains cannot be distinguished from so large a shift
        changed = tuple(c for c in changed if c[1].quantity not in ("common gain", "gain"))
    advices = [*_wiring(history, faults)]
    advices += [Advice(MACHINE, (), finding.text) for finding in history.last.depth_findings]
    advices += [*_noise(history, [c for c in changed if c[1].quantity == "noise"])]
    # Graver causes first: a tip elsewhere changes readings, which would pass for gains.
    for do, quantities in (
        (REGISTER, ("depth", "x", "y", "repeatability")),
        (RECALIBRATE, ("common gain", "gain", "loop", "network error")),
        (TARE, ("zero", "drift")),
    ):
        for quantity in quantities:
            advices += _told(history, do, [c for c in changed if c[1].quantity == quantity])
    if advices:
        return tuple(advices)
    if len(history.visits) == 1:
        why = "there is nothing to compare with yet: record the same plan at the next visit and name both sessions"
        return (Advice(FIRST, (), why),)
    if history.comparisons[-1][0].gains is None:
        why = "gains could not be compared: record the same plan at each visit, or label the sessions"
        return (Advice(FIRST, (), why),)
    return (Advice(NOTHING, (), "nothing changed beyond its tolerance"),)


def elsewhere(history: History) -> bool:
    """Return whether the tip moved beyond the tolerance at the latest visit."""
    return any(change.quantity in ("depth", "x", "y") for _, change in history.changed)


def _wiring(history: History, faults: Wiring) -> list[Advice]:
    advices, count = [], history.last.sensor.taxels.count
    faulty = sorted(faults.unfit)
    if len(faulty) > max(2.0, MOST_FAULTY * count):
        advices.append(
            Advice(REPLACE, tuple(faulty), f"{len(faulty)} of {count} channels give no readings of their own")
        )
    elif faults.dead:
        why = f"{named(faults.dead)} {'do' if len(faults.dead) > 1 else 'does'} not respond to presses close by"
        number = len(history.visits) - 2
        previous = history.wiring_at(number).dead if number >= 0 else ()
        if old := sorted(set(previous) & set(faults.dead)):
            again = "the same" if len(old) == len(faults.dead) else named(old)
            why += f", {again} as at {history.visits[number].name}: if the wires are sound, replace the unit"
        advices.append(Advice(WIRING, faults.dead, why))
    if faults.swapped:
        pairs = ", ".join(f"channel {channel} responds like taxel {taxel}" for channel, taxel in faults.swapped)
        advices.append(Advice(WIRING, tuple(channel for channel, _ in faults.swapped), pairs))
    if not advices or advices[0].do != REPLACE:
        for pair in faults.tied:
            advices.append(Advice(WIRING, pair, f"channels {pair[0]} and {pair[1]} read the same throughout"))
        if faults.undefined:
            advices.append(Advice(WIRING, faults.undefined, f"readings of {named(faults.undefined)} are no numbers"))
    return advices


def _noise(history: History, changed: list[tuple[int, Change]]) -> list[Advice]:
    if len(changed) < MANY * history.last.sensor.taxels.count:
        return [
            Advice(WIRING, (change.channel,), _sentence(history, against, change))
            for against, change in changed
            if change.channel is not None
        ]
    # Many channels at once have one cause, outside the sensor.
    middle = sorted(change.value for _, change in changed)[len(changed) // 2]
    where = history.visits[changed[0][0]].name
    why = f"noise of {len(changed)} channels is about {middle:.1f} times that at {where}: ground, shield or supply"
    return [Advice(WIRING, (), why)]


def _told(history: History, do: str, changed: list[tuple[int, Change]]) -> list[Advice]:
    """Return one advice for each change, or one for many channels together."""
    if len(changed) > 1 and len(changed) >= MANY * history.last.sensor.taxels.count:
        against, largest = max(changed, key=lambda item: abs(item[1].value))
        why = f"{CALLED[largest.quantity]} of {len(changed)} channels, most of all: "
        return [Advice(do, (), why + _sentence(history, against, largest))]
    return [
        Advice(do, () if change.channel is None else (change.channel,), _sentence(history, against, change))
        for against, change in changed
    ]


def _sentence(history: History, against: int, change: Change) -> str:
    """Return a change as a sentence, with its interval and its reference."""
    of = "" if change.channel is None else f" of channel {change.channel}"
    reference = "" if change.quantity in ABSOLUTE else f" against {history.visits[against].name}"
    return f"{CALLED[change.quantity]}{of}: {told(change)}{reference}"


def told(change: Change) -> str:
    """Return a change's value and interval in its unit, for example ``-20 % (-22 to -18 %)``."""
    if change.quantity in PERCENT:
        value, low, high = (100 * v for v in (change.value, change.low, change.high))
        kind = ".1f" if change.quantity in ABSOLUTE else "+.2f" if change.quantity == "loop" else "+.1f"
        unit = "points" if change.quantity == "loop" else "%"
        return f"{value:{kind}} {unit} ({low:{kind}} to {high:{kind}})"
    if change.quantity == "noise":
        return f"{change.value:.2f} times ({change.low:.2f} to {change.high:.2f})"
    digits = 3 if change.unit == "mm" else 1
    return f"{change.value:+.{digits}f} {change.unit} ({change.low:+.{digits}f} to {change.high:+.{digits}f})"


def named(channels: Iterable[int]) -> str:
    """Return channels in words, for example ``channels 3, 7``."""
    numbers = list(channels)
    return f"channel{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"
