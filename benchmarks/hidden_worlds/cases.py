"""Which worlds are made: blocks of (name, seed, effects, settings)."""

SINGLES = (
    "z_offset", "xy_offset", "tilt", "backlash", "lost_steps", "thermal_growth", "servo_lag", "frame_compliance",
    "relaxation", "softening", "hysteresis", "adhesion", "channel_gain", "saturation", "gap_curvature",
    "low_pass_filter", "crosstalk", "drift", "gain_drift", "baseline_tracking", "latency", "clock_skew", "scan_skew",
)
ALIASED = ("gain", "modulus", "thickness")
OUTSIDE = ("viscous_gain", "telegraph", "cable_pull", "stick_slip", "ageing_creep", "lost_and_found")
MEMORY = (
    "backlash", "servo_lag", "relaxation", "softening", "hysteresis", "low_pass_filter", "drift", "gain_drift",
    "baseline_tracking", "latency", "clock_skew", "scan_skew", "lost_steps", "thermal_growth", "adhesion",
)
PAIRS = (
    ("relaxation", "latency"), ("backlash", "relaxation"), ("drift", "softening"), ("z_offset", "low_pass_filter"),
    ("crosstalk", "relaxation"), ("hysteresis", "latency"), ("tilt", "gain_drift"), ("channel_gain", "backlash"),
)


def cases(block, first_seed=1000):
    """Return the cases of a block: name, seed, effects, settings, response."""
    made, seed = [], first_seed

    def add(name, effects, response="table", **settings):
        nonlocal seed
        made.append((f"{block}-{name}-{response}", seed, effects, settings, response))
        seed += 1

    if block == "nulls":
        for k in range(40):
            add(f"{k:03d}", {}, ("table", "fitted")[k % 2], noise=(2.0, 4.0, 12.0)[k % 3],
                protocol_name=("rich", "poor")[k % 4 == 3], episodes=(48, 24)[k % 4 == 3])
    for size in (0.3, 1.0, 3.0):
        if block == f"singles{size:g}":
            for name in SINGLES:
                add(name, {name: size})
        if block == f"memory{size:g}":
            for name in MEMORY:
                add(name, {name: size}, "fitted")
        if block == f"outside{size:g}":
            for name in OUTSIDE:
                add(name, {name: size})
                add(name, {name: size}, "fitted")
    if block == "aliases":
        for name in ALIASED:
            add(name, {name: 1.0})
        for name in ("latency", "low_pass_filter", "servo_lag", "softening", "hysteresis", "backlash", "relaxation"):
            add(name + "-poor", {name: 1.0}, protocol_name="poor", episodes=24)
            add(name + "-poor", {name: 1.0}, "fitted", protocol_name="poor", episodes=24)
    if block == "pairs":
        for a, b in PAIRS:
            add(f"{a}+{b}", {a: 1.0, b: 1.0})
    return made
