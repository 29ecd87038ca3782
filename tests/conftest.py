"""How the tests are run: in real time, side by side, the long ones apart, each timed (`running/README.md`)."""

pytest_plugins = (
    "running.collecting", "running.real_time", "running.long_part", "running.durations", "running.side_by_side",
    "running.chromium",
)  # fmt: skip
