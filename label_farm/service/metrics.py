"""The farm's state for Prometheus, at /metrics: the figures of the page, with names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from fastapi import FastAPI
from fastapi.responses import PlainTextResponse

STATES = ("waiting", "planning", "running", "done", "cancelled", "refused")
"""States of a submission; each is exported, so that an empty count is 0 and not missing."""
KIND = "text/plain; version=0.0.4"
"""Media type of Prometheus' text format."""


def add_metrics(api: FastAPI, farm: Callable[[], Mapping[str, Any]], states: Callable[[], Iterable[str]]) -> None:
    """Answer /metrics.

    Args:
        api: Where to add it.
        farm: Returns presses, workers, rate and whether the farm is paused, as of /api/state.
        states: Returns the state of every submission.
    """

    @api.get("/metrics", response_class=PlainTextResponse)
    def metrics() -> PlainTextResponse:
        """Text for Prometheus: presses, submissions, workers, rate."""
        return PlainTextResponse(exposition(farm(), states()), media_type=KIND)


def exposition(farm: Mapping[str, Any], states: Iterable[str]) -> str:
    """Return the metrics in Prometheus' text format."""
    counted, workers = Counter(states), farm["workers"]
    lines: list[str] = []

    def tell(name: str, kind: str, meaning: str, values: Iterable[tuple[Mapping[str, str], float]]) -> None:
        lines.extend([f"# HELP tacdata_farm_{name} {meaning}", f"# TYPE tacdata_farm_{name} {kind}"])
        for labels, value in values:
            inside = ",".join(f'{key}="{_escaped(text)}"' for key, text in labels.items())
            lines.append(f"tacdata_farm_{name}{f'{{{inside}}}' if inside else ''} {value:g}")

    tell("presses", "gauge", "Presses by state.", (({"state": s}, n) for s, n in farm["presses"].items()))
    tell("submissions", "gauge", "Submissions by state.", (({"state": s}, counted[s]) for s in STATES))
    tell("solved_per_second", "gauge", "Presses that all workers settle a second.", [({}, farm["rate"])])
    tell("paused", "gauge", "1 while the farm waits, for example for room on the disk.", [({}, bool(farm["paused"]))])
    for key, meaning in (("done", "solved"), ("failed", "failed")):
        named = (({"worker": row["owner"], "device": row["device"]}, row[key]) for row in workers)
        tell(f"worker_{key}_total", "counter", f"Presses that a worker {meaning}.", named)
    for key, kind, name, meaning in (
        ("processor_seconds", "counter", "processor_seconds_total", "Processor time of a worker [s]."),
        ("memory", "gauge", "memory_bytes", "Memory that a worker holds [bytes]."),
    ):
        # None until a worker has first reported it.
        rows = (row for row in workers if row[key] is not None)
        named = (({"worker": row["owner"], "device": row["device"]}, row[key]) for row in rows)
        tell(f"worker_{name}", kind, meaning, named)
    busy = (({"worker": row["owner"], "device": row["device"]}, row["busy"]) for row in workers)
    tell("worker_busy_seconds_total", "counter", "Time that a worker spent solving [s].", busy)
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
