"""How often a random press finds no equilibrium, and how many Newton steps the slowest take.

Presses that are refused before anything is solved, such as one deeper than its ring is thick, are counted apart.

Presses of every shape that ships (`random_presses.yaml`) on skins drawn at random: friction 0 to 0.8, Poisson's ratio
0.45 to 0.499, three quarters to one and a half times as thick as the default sensor. Each press goes down in steps of
at most 0.25 mm and up again. All skins have the default mesh, stretched.

    python benchmarks/random_presses.py [--device cuda:0] [--presses 2000] [--skins 20] [--seed 0] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from pathlib import Path

import numpy as np
import torch
from scipy.stats import binomtest

from label_farm.simulated.plan import read_simulation_plan
from label_farm.simulated.press_draw import draw_press
from label_farm.simulated.specimen import stretched
from tacdata.errors import SolveError
from tacdata.sensor import Sensor, default_sensor
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.mesh.build import MeshSettings, build_mesh
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

PLAN = Path(__file__).with_suffix(".yaml")
AT_A_TIME = {"cpu": 8, "cuda": 256}


def skin(seed: int, number: int) -> Sensor:
    """Return one skin of the study."""
    random, sensor = np.random.default_rng([seed, number]), default_sensor()
    document = sensor.document
    document.pop("uncertainty", None)
    document["contact"]["friction"] = round(float(random.uniform(0.0, 0.8)), 3)
    document["material"]["poisson_ratio"] = round(float(random.uniform(0.45, 0.499)), 4)
    document["skin"]["thickness"] = round(float(random.uniform(0.75, 1.5)) * sensor.skin.thickness, 3)
    return Sensor.from_document(document, f"skin {number}")


def path(depth: float) -> tuple[float, ...]:
    """Return the depths of a press [mm], down and up."""
    down = np.linspace(0.0, depth, max(2, math.ceil(depth / 0.25)) + 1)[1:]
    return tuple(round(float(d), 4) for d in [*down, *down[-2::-1], 0.0])


def possible(request: PressRequest, sensor: Sensor) -> bool:
    """Return whether a press is one that a skin can take."""
    try:
        check_press(request, sensor)
    except SolveError:
        return False
    return True


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--presses", type=int, default=2000)
    parser.add_argument("--skins", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    plan, design, settings = read_simulation_plan(PLAN), default_sensor(), ModelSettings(error_estimate=False)
    mesh, each = build_mesh(design, MeshSettings()), arguments.presses // arguments.skins
    capacity = AT_A_TIME[arguments.device.split(":")[0]]
    lost: list[dict] = []
    refused = 0
    steps: list[int] = []
    of_press: list[int] = []
    shapes: Counter[str] = Counter()
    began = time.perf_counter()
    for number in range(arguments.skins):
        sensor = skin(arguments.seed, number)
        own = stretched(mesh, design.skin.thickness, sensor.skin.thickness)
        model = SkinModel(sensor, settings, arguments.device, own)
        drawn = [draw_press(plan, sensor, arguments.seed, number * each + k) for k in range(each)]
        requests = [
            PressRequest(p.indenter, p.x, p.y, p.yaw, path(p.depth), tilt_x=p.tilt_x, tilt_y=p.tilt_y) for p in drawn
        ]
        total = np.zeros(each, int)
        for index, depth, state in model.states_many(requests, min(capacity, each), with_displacement=False):
            if isinstance(state, SolveError):
                press = drawn[index]
                if not possible(requests[index], sensor):
                    refused += 1
                    continue
                lost.append({
                    "skin": number, "friction": sensor.contact.friction, "nu": sensor.material.poisson_ratio,
                    "thickness": sensor.skin.thickness, "indenter": press.indenter.document, "x": press.x, "y": press.y,
                    "yaw": press.yaw, "tilt": [press.tilt_x, press.tilt_y], "depth": press.depth, "at": depth,
                    "reason": state.given,
                })
            else:
                steps.append(state.newton)
                total[index] += state.newton
        of_press += total.tolist()
        shapes.update(press.indenter_name for press in drawn)
        print(f"skin {number}: {time.perf_counter() - began:.0f} s, {len(lost)} lost", flush=True)
    count = arguments.skins * each - refused
    print(f"{refused} presses refused before they were solved")
    low, high = binomtest(len(lost), count).proportion_ci(method="wilson")
    median, p95 = np.percentile(steps, [50, 95])
    print(f"{len(lost)} of {count} presses without an equilibrium: {100 * len(lost) / count:.2f} %"
          f" ({100 * low:.2f} to {100 * high:.2f} %)")
    print(f"Newton steps a state: median {median:.0f}, 95th percentile {p95:.0f}; a press: median"
          f" {np.median(of_press):.0f}, most {max(of_press)}")
    for name, one in Counter(entry["indenter"]["shape"] for entry in lost).most_common():
        print(f"  {name}: {one}")
    for entry in lost:
        print(f"  {entry['reason']}")
    if arguments.json:
        result = {
            "presses": count, "refused": refused, "lost": lost,
            "newton": {"median": median, "p95": p95, "most": max(of_press)},
            "shapes": shapes, "device": arguments.device,
        }
        arguments.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
