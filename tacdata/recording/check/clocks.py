"""Figures and warnings about the clocks of a recording's streams."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.files.reader import Recording

DRIFT_PPM = 250.0
"""Warning threshold: drift against the nominal rate [ppm]; three times that of a poor crystal."""
STEP_MS = 15.0
"""Warning threshold: step of a device's clock [ms]; smaller steps are a host that was late for long."""
DELAY_MS = 100.0
"""Warning threshold: mean delay of the frames, or its standard deviation [ms of real time]."""
UNCERTAIN_MS = 5.0
"""Warning threshold: uncertainty of sample times [ms of real time]."""


def clock_figures(
    clock: ClockModel | None, nominal_period_ns: float, arrival_ns: np.ndarray, sample_ns: np.ndarray
) -> dict[str, Any] | None:
    """Return a clock as an entry of `schemas/check.schema.json`; None without one.

    Delay and jitter are those of the recording itself: the clock's own are of minutes before it, too.

    Args:
        clock: The stream's clock.
        nominal_period_ns: Nominal time between frames [ns]; 0 if none is known.
        arrival_ns: Arrivals in the recording [ns], shape (n,); steps of the clock before them are of no concern.
        sample_ns: Sample times by the clock [ns], shape (n,).
    """
    if clock is None:
        return None
    within = (int(arrival_ns[0]), int(arrival_ns[-1])) if len(arrival_ns) else (0, 0)
    # Sample times have the constant latency subtracted; the delay is what exceeds it.
    beyond = arrival_ns - sample_ns - (clock.latency.latency_ns if clock.latency else 0)
    # Each step begins a line, except for the first line.
    lines = (*clock.earlier, clock)[1:]
    steps = [s for s, line in zip(clock.steps_ns, lines, strict=True) if within[0] < line.first_arrival_ns <= within[1]]
    has_rate = nominal_period_ns > 0 or clock.axis == "device_ns"
    return {
        "steady": clock.steady,
        "drift": _rounded(clock.drift(nominal_period_ns), 1) if has_rate else None,
        "drift_uncertainty": _rounded(clock.drift_uncertainty * 1e6, 1),
        "delay": _rounded(float(np.mean(beyond)) / 1e6) if len(beyond) else 0.0,
        "jitter": _rounded(float(np.std(beyond)) / 1e6) if len(beyond) else 0.0,
        "uncertainty": _rounded(clock.uncertainty_ns / 1e6),
        "latency": _rounded(clock.latency.latency_ns / 1e6) if clock.latency else None,
        "latency_uncertainty": _rounded(clock.latency.uncertainty_ns / 1e6) if clock.latency else None,
        "steps": [_rounded(step / 1e6) for step in steps],
    }


def round_trip(recording: Recording) -> float | None:
    """Return the median time from query to answer of the motion controller [ms]; None if the file does not hold it."""
    median_ns = recording.polled.get("round_trip_ns")
    return None if median_ns is None else _rounded(float(median_ns) / 1e6)


def clock_warnings(clock: dict[str, Any] | None, rate_of_clock: float) -> list[str]:
    """Return the warnings about a stream's clock as text; ``rate_of_clock``: seconds shown per real second."""
    if clock is None or not clock["steady"]:
        return []
    remarks = []
    drift = clock["drift"]
    # Only what two standard deviations leave: a short recording knows its rate badly.
    if drift is not None and abs(drift) - 2 * clock["drift_uncertainty"] > DRIFT_PPM:
        remarks.append(
            f"its clock is {drift:+.0f} ppm off its nominal rate (known to {clock['drift_uncertainty']:.0f} ppm): "
            "a bad crystal, or a wrong rate in its description"
        )
    steps = [step for step in clock["steps"] if abs(step) > STEP_MS * rate_of_clock]
    if steps:
        remarks.append(
            f"its clock stepped by {', '.join(f'{s:+.0f}' for s in steps)} ms: it restarted, or lost its count"
        )
    if max(clock["delay"], clock["jitter"]) / rate_of_clock > DELAY_MS:
        remarks.append(
            f"its frames were read {clock['delay']:.0f} ms late on average, with a jitter of {clock['jitter']:.0f} ms: "
            "this computer was too busy"
        )
    if clock["uncertainty"] / rate_of_clock > UNCERTAIN_MS:
        remarks.append(f"its sample times are uncertain by {clock['uncertainty']:.1f} ms")
    return remarks


def clock_words(clock: dict[str, Any] | None, timing: bool = True) -> str:
    """Describe a clock in half a line.

    Args:
        clock: Its figures (`clock_figures`).
        timing: Whether to state delay and jitter too.
    """
    if clock is None:
        return "no counter, so sample times are arrival times"
    if not clock["steady"]:
        return "too unsteady to be followed, so sample times are arrival times"
    drift = "" if clock["drift"] is None else f"drift {clock['drift']:+.0f} +- {clock['drift_uncertainty']:.0f} ppm, "
    delay = f"delay {clock['delay']:.1f} ms beyond the least, jitter {clock['jitter']:.1f} ms" if timing else ""
    words = f"clock: {drift}{delay}".rstrip(", ") if drift or delay else "clock followed by its counter"
    if clock["latency"] is None:
        return words
    return f"{words}; constant delay {clock['latency']:.1f} +- {clock['latency_uncertainty']:.1f} ms taken off"


def _rounded(value: float, digits: int = 3) -> float:
    return round(float(np.nan_to_num(value)), digits)
