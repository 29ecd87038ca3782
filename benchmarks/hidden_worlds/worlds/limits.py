"""Detection limits and inseparable pairs, kept in ``limits.json``: python -m worlds.limits [--help]."""

import argparse
import json
from itertools import product
from pathlib import Path

from worlds.oracle import LEVEL, Oracle, limit, nearest
from worlds.physics import BUGS, FORMS, KNOWN, SINGLES

FILE = Path(__file__).with_name("limits.json")
SEEDS = (900, 901, 902)
"""Worlds that the limits are taken from; none is judged."""
SETS = {
    "one_rate": (("latency", "low_pass_filter", "servo_lag", "two_pole_filter", "scan_skew"), ("table", "fitted")),
    "poor": (
        (
            "latency",
            "low_pass_filter",
            "servo_lag",
            "backlash",
            "hysteresis",
            "softening",
            "relaxation",
            "creep",
            "adhesion",
            "baseline_tracking",
            "elastic_backlash",
        ),
        ("table", "fitted"),
    ),
    "no_holds": (
        (
            "relaxation",
            "creep",
            "baseline_tracking",
            "poroelasticity",
            "nonlinear_relaxation",
            "fractional_relaxation",
            "hysteresis",
        ),
        ("table", "fitted"),
    ),
    "one_site": (
        (
            "z_offset",
            "tilt",
            "gantry_sag",
            "xy_offset",
            "rotation",
            "skew",
            "stiffening",
            "frame_compliance",
            "saturation",
            "gap_curvature",
            "thickness",
            "modulus",
            "gain",
            "channel_gain",
            "travel_scale",
        ),
        ("table",),
    ),
    "rich": (("gain", "modulus", "thickness", "z_offset", "travel_scale", "gap_curvature", "stiffening"), ("table",)),
}
"""Protocol -> effects that it may not tell apart, each a rival of the others; responses."""
EPISODES = {"poor": 24}
STEPS = (3.0, 10.0, 40.0)
"""Sizes at which singles are compared with their rivals, in detection limits."""
TRIED = (10.0, 3.0)
"""Sizes at which an inseparable truth is taken, in detection limits; the largest at which it stays inseparable."""


def limits(names, before):
    """Return response -> name -> size at the detection limit, or None; ``before``: sizes to start from."""
    made = {"table": {}, "fitted": {}}
    for response, sessions in product(made, (1, 4)):
        wanted = [n for n in names if KNOWN[n].needs.get("sessions", 1) == sessions and n not in BUGS]
        wanted = [n for n in wanted if response == "table" or KNOWN[n].fitted]
        if wanted:
            oracles = [Oracle(seed, {"sessions": sessions}, response) for seed in SEEDS]
            for name in wanted:
                made[response][name] = limit(oracles, name, before[response].get(name))
                print(response, name, made[response][name], flush=True)
    return made


def aliases():
    """Return the truths that a protocol cannot tell from a rival, with how far they are from it."""
    made = []
    for protocol, (names, responses) in SETS.items():
        settings = {"protocol": protocol, "episodes": EPISODES.get(protocol, 48)}
        for response in responses:
            oracle = Oracle(SEEDS[0], settings, response)
            known = {n: limit([oracle], n) for n in names if response == "table" or KNOWN[n].fitted}
            known = {n: v for n, v in known.items() if v is not None}
            for name, steps in apart(oracle, known, TRIED).items():
                alike = [(times, far, by) for times, (far, by) in steps.items() if far < LEVEL]
                if alike:
                    times, far, by = max(alike)
                    made.append(
                        {
                            "effect": name,
                            "settings": settings,
                            "response": response,
                            "size": round(times * known[name], 5),
                            "limits": times,
                            "separation": far,
                            "rival": by,
                        }
                    )
                    print(made[-1], flush=True)
    return made


def separations(known):
    """Return how far singles and forms stay from any size of any rival, on rich presses.

    Args:
        known: Response -> name -> detection limit [1].

    Returns:
        Response -> name -> size in limits -> (separation, rival).
    """
    made = {}
    for response, found in known.items():
        sizes = {n: v for n, v in found.items() if v and n in (*SINGLES, *FORMS) and "sessions" not in KNOWN[n].needs}
        every = apart(Oracle(SEEDS[0], {}, response), sizes, STEPS)
        made[response] = {n: {f"{times:g}": entry for times, entry in steps.items()} for n, steps in every.items()}
        print(response, made[response], flush=True)
    return made


def apart(oracle, sizes, steps):
    """Return how far effects stay from any physical size of any rival: name -> size in limits -> [separation, rival].

    Args:
        oracle: Whose presses.
        sizes: Name -> detection limit [1]; those in other forms are no rivals.
        steps: Sizes of the truth, in detection limits.
    """
    every = [(n, t) for n, v in sizes.items() for t in sorted({1.0, 3.0, *steps}) if t * v <= KNOWN[n].most]
    at = {key: k for k, key in enumerate(every)}
    gram = oracle.gram([oracle.signature({n: t * sizes[n]}) for n, t in every])
    rivals = [n for n in sizes if n not in FORMS and (n, 3.0) in at]
    made = {}
    for name, times in every:
        others = [r for r in rivals if not set(KNOWN[r].called) & set(KNOWN[name].called)]
        if times in steps and others:
            left, by = min((nearest(gram, at[name, times], at[r, 1.0], at[r, 3.0], KNOWN[r].both), r) for r in others)
            made.setdefault(name, {})[times] = [round(left, 2), by]
    return made


def main(only, again):
    """Write the whole file, or the named effects into it, or the aliases and separations."""
    if again:
        document = json.loads(FILE.read_text())
        document["aliases"] = aliases()
        document["separations"] = separations(document["limits"])
        FILE.write_text(json.dumps(document, indent=1) + "\n")
        return
    before = json.loads(FILE.read_text()) if FILE.is_file() else {"limits": {"table": {}, "fitted": {}}, "aliases": []}
    found = limits(only or list(KNOWN), before["limits"])
    for response, values in found.items():
        before["limits"][response] = {**(before["limits"][response] if only else {}), **values}
    if not only:
        before["aliases"] = aliases()
    document = {
        "version": "1.0",
        "made_by": "python -m worlds.limits, in benchmarks/hidden_worlds",
        "level": LEVEL,
        "seeds": list(SEEDS),
        "noise": 4.0,
        "episodes": 48,
        "limits": before["limits"],
        "aliases": before["aliases"],
        "separations": separations(before["limits"]) if not only else before.get("separations", {}),
    }
    FILE.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--apart", action="store_true", help="only what presses tell apart, the limits as they are")
    given = parser.parse_args()
    main(given.only, given.apart)
