"""Cost of the slowest member of a batch, and of a member that stalls, to the others.

    python benchmarks/batch_members.py [--device cuda:0] [--presses 8] [--json FILE]

Presses of the training plan, down and up, all in one batch on the default mesh, without the mesh's error. A member's
cost is its Newton steps: in each, all members that are still at work have a column of every product and solve. Then
the same presses with a leaning punch among them, deeper than the mesh can take it without halving its load steps.
Kernels that are not in Warp's cache are compiled within the time: run it twice.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from tacdata.errors import SolveError
from tacdata.indenters import from_document
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.plans.shipped.training import training_plan
from tacdata.sensor import Sensor, default_sensor
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

STALLS = PressRequest(FlatPunch(1.0, 0.1), 0.3, 0.2, 0.0, (0.5, 1.0, 1.6), tilt_x=9.0, tilt_y=4.0)
"""Its load steps are halved, and it goes on when all others are done."""


@dataclass
class Member:
    """Cost of one press of a batch."""

    states: int = 0
    steps: int = 0
    """Newton steps of its states."""
    ended: float = 0.0
    """Time at which the batch was done with it [s]."""
    failed: str = ""
    """Why it was given up, if it was."""


def plan(sensor: Sensor, count: int) -> list[PressRequest]:
    """Return presses of the plan of 24, in random order, with the states that a label asks for."""
    drawn, ladder = training_plan(sensor, 24, 0), Ladder()
    presses = [
        PressRequest(
            from_document(drawn["indenters"][p["indenter"]], p["indenter"]),
            p["x"],
            p["y"],
            p["yaw"],
            ladder.depths(p["depth"]),
        )
        for p in drawn["presses"]
    ]
    return [presses[k] for k in np.random.default_rng(1).permutation(24)[:count]]


def run(model: SkinModel, requests: list[PressRequest]) -> list[Member]:
    """Solve presses as one batch."""
    members, clock = [Member() for _ in requests], _clock(model.device)
    began = clock()
    for number, _, state in model.states_many(requests, len(requests), with_displacement=False):
        own = members[number]
        own.ended = clock() - began
        if isinstance(state, SolveError):
            own.failed = state.given
        else:
            own.states, own.steps = own.states + 1, own.steps + state.newton
    return members


def _clock(device: str):
    return time.process_time if device == "cpu" else time.perf_counter


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--presses", type=int, default=8)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    sensor = default_sensor()
    model = SkinModel(sensor, ModelSettings(error_estimate=False), arguments.device)
    requests = plan(sensor, arguments.presses)
    run(model, [PressRequest(request.indenter, request.x, request.y, 0.0, (0.05,)) for request in [*requests, STALLS]])
    alone, beside = run(model, requests), run(model, [*requests, STALLS])
    steps = np.array([member.steps for member in alone])
    share = np.array([member.steps / member.states for member in alone])
    last = [max(member.ended for member in some) for some in (alone, beside[:-1])]
    stalled = beside[-1]
    figures = {
        "device": arguments.device,
        "presses": len(requests),
        "failed": sum(bool(one.failed) for one in alone),
        "steps_median": float(np.median(steps)),
        "steps_slowest_over_median": float(steps.max() / np.median(steps)),
        "steps_a_state_median": float(np.median(share)),
        "steps_a_state_slowest_over_median": float(share.max() / np.median(share)),
        "seconds_of_all": last[0],
        "seconds_until_the_others_are_done_beside_one_that_stalls": last[1],
        "seconds_of_the_one_that_stalls_alone_at_the_end": max(0.0, stalled.ended - last[1]),
        "what_became_of_it": stalled.failed or f"found, {stalled.steps} steps",
    }
    for name, value in figures.items():
        print(f"{name:>56} {value:.3g}" if isinstance(value, float) else f"{name:>56} {value}")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
