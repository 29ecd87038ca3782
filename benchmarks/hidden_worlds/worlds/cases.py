"""Which worlds are made: blocks of cases, each with its own seed."""

import functools
import hashlib
import itertools
import json
import math
from dataclasses import dataclass, field
from pathlib import Path

from worlds import noise, protocol
from worlds.physics import AMPLITUDES, BUGS, FORMS, KNOWN, OUTSIDE, SINGLES

LIMITS = Path(__file__).with_name("limits.json")
DEVELOPMENT, TEST = 1000, 5000
"""First seeds: thresholds are set on 1000 to 1999; 5000 on are run once for an engine that is frozen."""
TIMES = (0.5, 1.0, 3.0, 10.0)
"""Sizes of singles, in detection limits."""
LEVEL = 2.576
"""Truths less far from a rival than this [standard deviations] are aliases, not singles."""


@dataclass(frozen=True)
class Case:
    """One world to be made and judged."""

    block: str
    name: str
    seed: int
    effects: dict
    """Name -> size [1]."""
    expected: str
    """name, part, set, unknown or none: the right verdict; part: the name, and that it is not all."""
    response: str = "table"
    settings: dict = field(default_factory=dict)
    times: dict = field(default_factory=dict)
    """Name -> size [detection limits]."""
    facts: dict = field(default_factory=dict)
    """Further facts for the scorer: adversarial, separation, rival."""

    @property
    def identity(self):
        """Name of its files, which reveals nothing of the truth."""
        text = json.dumps([self.block, self.name, self.seed, self.response, self.settings], sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


NEAR = (
    ("latency", "low_pass_filter"),
    ("backlash", "hysteresis"),
    ("relaxation", "baseline_tracking"),
    ("softening", "wear_in"),
    ("z_offset", "stiffening"),
    ("gap_curvature", "saturation"),
    ("tilt", "gantry_sag"),
    ("thermal_growth", "lost_steps"),
    ("crosstalk", "bulge"),
    ("relaxation", "creep"),
    ("servo_lag", "latency"),
    ("xy_offset", "rotation"),
)
"""Pairs of one group, or that hide one another."""
FAR = (
    ("relaxation", "latency"),
    ("backlash", "relaxation"),
    ("drift", "softening"),
    ("z_offset", "low_pass_filter"),
    ("crosstalk", "relaxation"),
    ("hysteresis", "latency"),
    ("tilt", "gain_drift"),
    ("channel_gain", "backlash"),
    ("xy_offset", "relaxation"),
    ("lateral_backlash", "low_pass_filter"),
    ("frame_compliance", "latency"),
    ("lost_steps", "relaxation"),
)
"""Pairs that have little in common."""
TRIPLES = (
    ("relaxation", "latency", "xy_offset"),
    ("backlash", "drift", "crosstalk"),
    ("softening", "low_pass_filter", "tilt"),
    ("z_offset", "relaxation", "scan_skew"),
    ("hysteresis", "gain_drift", "latency"),
    ("lost_steps", "relaxation", "channel_gain"),
    ("servo_lag", "thermal_growth", "crosstalk"),
    ("adhesion", "latency", "drift"),
    ("rotation", "softening", "latency"),
    ("backlash", "relaxation", "xy_offset"),
)
FEW = (
    "latency",
    "relaxation",
    "backlash",
    "hysteresis",
    "drift",
    "softening",
    "z_offset",
    "crosstalk",
    "scan_skew",
    "low_pass_filter",
    "xy_offset",
    "lost_steps",
)
"""Effects of the blocks of noise and of amounts of data."""


def entry(**given):
    """Return the fields of a case that are given."""
    return given


@functools.cache
def limits():
    """Return response -> name -> detection limit [1] at 48 rich presses and 4 counts, None where it does not show."""
    return json.loads(LIMITS.read_text())


def sized(names, times, response):
    """Return sizes of effects at multiples of their detection limits; None if one is out of reach."""
    known = limits()["limits"][response]
    made = {}
    for name, many in zip(names, times, strict=True):
        found = known.get(name)
        if found is None or many * found > KNOWN[name].most:
            return None
        made[name] = round(many * found, 6)
    return made


def needs(names):
    """Return the settings without which effects do not show."""
    return {k: v for n in names for k, v in KNOWN[n].needs.items()}


def singles(times, names=SINGLES, block="singles", expected="name", responses=("table", "fitted"), **settings):
    """Yield single effects at a multiple of their limits; those out of reach or one with a rival are left out."""
    for name, response in itertools.product(names, responses):
        size = sized([name], [times], response)
        if size and not inseparable(name, response, max(times, 3.0)) and (response == "table" or KNOWN[name].fitted):
            yield entry(
                block=f"{block}{times:g}",
                name=name,
                effects=size,
                expected=expected,
                response=response,
                settings={**needs([name]), **settings},
                times={name: times},
            )


def inseparable(name, response, times):
    """Return the separation and the rival that an oracle cannot tell from a single on rich presses, or None."""
    if name in AMPLITUDES:
        return [0.0, AMPLITUDES[name]]
    apart = limits()["separations"].get(response, {}).get(name, {}).get(f"{times:g}")
    return apart if apart and apart[0] < LEVEL else None


def clear(name, response):
    """Return the size [detection limits] at which an oracle finds an effect and separates it from any rival."""
    apart = limits()["separations"].get(response, {}).get(name, {})
    steps = sorted((float(times), max(entry[0], 1e-3)) for times, entry in apart.items())
    below, above = [s for s in steps if s[1] < LEVEL], [s for s in steps if s[1] >= LEVEL]
    if not steps or not above:
        return steps[-1][0] * LEVEL / steps[-1][1] if steps else 1.0
    if not below:
        return max(1.0, above[0][0] * LEVEL / above[0][1])
    (low, near), (high, far) = below[-1], above[0]
    return float(low * (LEVEL / near) ** (math.log(high / low) / math.log(far / near)))


def together(block, groups, ratios, **facts):
    """Yield several effects at once, in sizes at which an oracle would tell each from any rival."""
    for names, times in itertools.product(groups, ratios):
        for order in dict.fromkeys((times, times[::-1])):
            size = sized(names, [t * clear(n, "table") for n, t in zip(names, order, strict=True)], "table")
            if size:
                yield entry(
                    block=block,
                    name="+".join(names) + f"-{order[0]:g}-{order[1]:g}",
                    effects=size,
                    expected="name",
                    settings=needs(names),
                    times=dict(zip(names, order, strict=True)),
                    facts=facts,
                )


def nulls():
    """Yield 216 worlds without anything: noise, its level, protocol, response, streams, amounts."""
    every = itertools.product(noise.REALISMS, (2.0, 4.0, 12.0), ("table", "fitted"), range(9))
    for realism, level, response, k in every:
        name = tuple(protocol.KNOWN)[k % 5]
        streams = ((), (), ("tag",), ("force",), (), ("tag", "force", "temperature"))[(k + (response == "table")) % 6]
        yield entry(
            block="nulls",
            name=f"{realism}-{level:g}-{k}",
            effects={},
            expected="none",
            response=response,
            settings={
                "protocol": name,
                "noise": level,
                "realism": realism,
                "streams": streams,
                "sessions": 1 + 2 * (k % 3 == 2),
                "episodes": (48, 24, 100, 10, 30)[k % 5],
            },
        )


def aliases():
    """Yield truths that an oracle cannot tell from a mixture of one rival's signatures under their protocol."""
    known = limits()
    found = [
        (e["effect"], e["response"], e["size"], e["limits"], e["separation"], e["rival"], e["settings"])
        for e in known["aliases"]
        if e["settings"]["protocol"] != "rich"
    ]
    for response, name in ((r, n) for r, every in known["separations"].items() for n in every):
        for times in (10.0, 3.0):
            size = sized([name], [times], response)
            if size and (apart := inseparable(name, response, times)):
                found.append((name, response, size[name], times, *apart, {}))
                break
    for name, response, size, times, apart, rival, settings in found:
        label = settings.get("protocol", "rich")
        yield entry(
            block="aliases",
            name=f"{name}-{label}",
            effects={name: size},
            expected="set",
            response=response,
            settings=settings,
            times={name: times},
            facts={"separation": apart, "rival": rival},
        )


def remainders(share):
    """Yield singles, as large as real effects are, with a second effect of no library that holds a share of the gap.

    The explained energy grows with the square of a size in detection limits.
    """
    for number, (name, response) in enumerate(itertools.product(SINGLES, ("table", "fitted"))):
        if inseparable(name, response, 10.0) or not (response == "table" or KNOWN[name].fitted):
            continue
        others = [OUTSIDE[(number + k) % len(OUTSIDE)] for k in range(len(OUTSIDE))]
        others = [o for o in others if "tag" not in KNOWN[o].needs.get("streams", ())]
        for times, other in itertools.product((60.0, 30.0, 15.0), others):
            many = times * math.sqrt(share / (1 - share))
            size = sized([name, other], [times, many], response)
            if size:
                yield entry(
                    block=f"remainder{100 * share:g}",
                    name=f"{name}+{other}",
                    effects=size,
                    expected="part",
                    response=response,
                    settings=needs([name, other]),
                    times={name: times, other: many},
                    facts={"remainder": other},
                )
                break


def bugs():
    """Yield errors of the simulation: the world is as it should be, the table is not."""
    for name, size in itertools.product(BUGS, (1.0, 2.0, 0.5)):
        if size <= KNOWN[name].most:
            expected = "set" if name == "half_cell" else "name" if KNOWN[name].called else "unknown"
            yield entry(block="bugs", name=f"{name}-{size:g}", effects={name: size}, expected=expected)


def tagged():
    """Yield effects that a tag or a force reading separates, with that stream."""
    for name in ("backlash", "lost_steps", "z_offset", "servo_lag", "travel_scale", "skew", "lateral_backlash"):
        yield from ({**c, "block": "tagged"} for c in singles(10.0, (name,), responses=("table",), streams=("tag",)))
    yield entry(
        block="tagged", name="tag_flex", effects={"tag_flex": 1.0}, expected="unknown", settings={"streams": ("tag",)}
    )
    for name in ("frame_compliance", "modulus", "gain", "thickness"):
        yield entry(
            block="tagged",
            name=name,
            effects={name: 1.5},
            expected="name",
            settings={"streams": ("force",)},
            times={name: None},
        )


def amounts():
    """Yield the same effects, of three times the size that is clear in 48 presses, in fewer and more presses."""
    for count, response in itertools.product((10, 30, 100), ("table", "fitted")):
        for name in FEW:
            yield from plain(f"amount{count}", name, response, episodes=count)


def levels():
    """Yield the same effects at half and three times the noise."""
    for level, response in itertools.product((2.0, 12.0), ("table", "fitted")):
        for name in FEW:
            yield from plain(f"noise{level:g}", name, response, noise=level)


def plain(block, name, response, **settings):
    """Yield one effect at three times the size that is clear, if that is within reach."""
    size = sized([name], [3 * clear(name, response)], response)
    if size and (response == "table" or KNOWN[name].fitted):
        yield entry(block=block, name=name, effects=size, expected="name", response=response, settings=settings)


BLOCKS = {
    "nulls": nulls,
    "aliases": aliases,
    "bugs": bugs,
    "tagged": tagged,
    "amounts": amounts,
    "levels": levels,
    **{f"singles{t:g}": (lambda t=t: singles(t)) for t in TIMES},
    **{f"outside{t:g}": (lambda t=t: singles(t, OUTSIDE, "outside", "unknown")) for t in (1.0, 3.0, 10.0, 30.0)},
    **{f"remainder{100 * s:g}": (lambda s=s: remainders(s)) for s in (0.05, 0.15, 0.3, 0.5)},
    **{f"forms{t:g}": (lambda t=t: singles(t, FORMS, "forms")) for t in (3.0, 10.0)},
    "pairs": lambda: together("pairs", FAR, ((3.0, 3.0), (9.0, 3.0)), adversarial=False),
    "near_pairs": lambda: together("near_pairs", NEAR, ((3.0, 3.0), (9.0, 3.0)), adversarial=True),
    "triples": lambda: together("triples", TRIPLES, ((3.0, 3.0, 3.0), (8.0, 4.0, 3.0))),
}
"""Name -> cases without seeds."""


def cases(block, first=DEVELOPMENT, repeat=0):
    """Return the cases of a block.

    Args:
        block: One of `BLOCKS`.
        first: First seed of the suite.
        repeat: Which repetition; each has seeds of its own.
    """
    made = []
    for given in BLOCKS[block]():
        settings = {k: tuple(v) if isinstance(v, list) else v for k, v in given.get("settings", {}).items()}
        words = [given["block"], given["name"], given.get("response", "table"), settings, repeat]
        number = int(hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()[:8], 16) % 1000
        made.append(Case(**{**given, "settings": settings, "seed": first + number}))
    return made
