"""How the tests are run: with a cache of their own, side by side, long ones apart, timed (`running/README.md`)."""

pytest_plugins = (
    "running.collecting",
    "running.real_time",
    "running.long_part",
    "running.durations",
    "running.side_by_side",
    "running.chromium",
    "running.user_cache",
    "running.lasting_patches",
)
