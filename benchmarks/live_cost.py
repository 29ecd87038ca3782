"""Cost of an estimate of `tacdata live` on one core, and its age when it leaves.

    python benchmarks/live_cost.py [--frames N] [--json FILE]

Frames of a pressed skin go through taring, window, network, novelty and message, as in `tacdata live`. CPU time is the
process's own, so that other work on the machine hardly counts. The age adds the look-ahead at 30 Hz, not the board's
latency. Networks have random weights: the cost does not depend on them.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch

from tacdata.devices.device import TaxelFrame
from tacdata.live.depth_stream import DepthStream
from tacdata.live.message_server import message
from tacdata.sensor import default_sensor
from tacdata.training.metrics.novelty import KEPT, TrainingReadings
from tacdata.training.networks.network import create

NETWORKS = ("paper", "causal", "pattern")
RATE, TARED = 30.0, 30
"""Frames a second [Hz], and frames for taring."""
ABOUT = {"finger": "index", "network": "f" * 64, "causal": True, "lookahead": 0}


class BoardClock:
    """A clock that takes each arrival as the sample's time."""

    axis = "counter"

    def take(self, arrival_ns, counter):
        """Return the sample time of a frame [ns]."""
        return arrival_ns


def cost(name, causal, frames):
    """Return CPU times of single estimates [ms], shape (m,), and the look-ahead [frames]."""
    sensor = default_sensor()
    torch.manual_seed(0)
    network = create(name, sensor, {}).eval()
    rng = np.random.default_rng(0)
    counts = sensor.taxels.count
    network.set_normalization(np.zeros(counts, np.float32), np.full(counts, 500.0, np.float32))

    @torch.inference_mode()
    def estimate(window):
        return network(torch.as_tensor(np.ascontiguousarray(window, np.float32))[None])[0].numpy()

    known = TrainingReadings(rng.normal(0, 800, (KEPT, counts)), 1.0, "")
    stream = DepthStream(estimate, network.offsets, sensor.map, BoardClock(), TARED, causal, known.novelty)
    spent = []
    for n in range(TARED + frames):
        touch = 0.0 if n < TARED else 1000 * np.sin(n / 10) ** 2
        frame = TaxelFrame(round(n * 1e9 / RATE), n, np.round(9000 + rng.normal(0, 4, counts) + touch))
        begun = time.process_time()
        made = stream.push(frame)
        if made is not None:
            json.dumps(message(made, ABOUT, made.arrival_ns, maps=True))
            spent.append(1000 * (time.process_time() - begun))
    return np.array(spent[5:]), stream.lookahead


def main():
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    found = {}
    for name in NETWORKS:
        for causal in (False, True):
            spent, ahead = cost(name, causal, chosen.frames)
            low, high = np.median(spent), np.percentile(spent, 95)
            row = {"median_ms": low, "p95_ms": high, "lookahead": ahead, "age_ms": 1000 * ahead / RATE + low}
            found[f"{name}{' --causal' if causal else ''}"] = row
            label = f"{name}{' --causal' if causal else '':<10}"
            print(f"{label:<20} {low:5.2f} ms, 95 %: {high:5.2f} ms, age {row['age_ms']:6.1f} ms", flush=True)
    if chosen.json:
        chosen.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
