"""How often a random press finds no equilibrium, and how many Newton steps the slowest take.

Presses that are refused before anything is solved, such as one deeper than its ring is thick, are counted apart.

Presses of every shape that ships (`random_presses.yaml`) on skins drawn at random: friction 0 to 0.8, Poisson's ratio
0.45 to 0.499, three quarters to one and a half times as thick as the default sensor. Each press goes down in steps of
at most 0.25 mm and up again. All skins have the default mesh, stretched.

    python benchmarks/random_presses.py [--device cuda:0] [--presses 2000] [--skins 20] [--seed 0] [--json FILE]

With `--hardest 40` only so many of them are solved, one by one: those that come first when depth, sharpness, lean,
friction and Poisson's ratio are added up. It prints the CPU seconds of the slowest, too.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.stats import binomtest

from tacdata.errors import SolveError
from tacdata.label_farm.simulated.plan import SimulationPlan, read_simulation_plan
from tacdata.label_farm.simulated.press_draw import draw_press
from tacdata.label_farm.simulated.specimen import stretched
from tacdata.plans import Press
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


def hardness(press: Press, sensor: Sensor) -> float:
    """Return how hard a press is: 1 for each of depth, sharpness and lean, a half for friction and Poisson's ratio."""
    lean = math.hypot(press.tilt_x, press.tilt_y) / 14
    sharp = min(0.1 / press.indenter.sharpest, 1.0)
    skin = sensor.contact.friction / 0.8 + (sensor.material.poisson_ratio - 0.45) / 0.049
    return press.depth / 1.5 + sharp + lean + skin / 2


def hardest(plan: SimulationPlan, seed: int, skins: int, each: int, count: int) -> set[int]:
    """Return the numbers of the hardest presses that are possible."""
    found = []
    for number in range(skins):
        sensor = skin(seed, number)
        for k in range(number * each, (number + 1) * each):
            press = draw_press(plan, sensor, seed, k)
            if possible(asked(press), sensor):
                found.append((hardness(press, sensor), k))
    return {k for _, k in sorted(found, reverse=True)[:count]}


def asked(press: Press) -> PressRequest:
    """Return a press as the model takes it."""
    return PressRequest(
        press.indenter, press.x, press.y, press.yaw, path(press.depth), tilt_x=press.tilt_x, tilt_y=press.tilt_y
    )


def possible(request: PressRequest, sensor: Sensor) -> bool:
    """Return whether a press is one that a skin can take."""
    try:
        check_press(request, sensor)
    except SolveError:
        return False
    return True


def walk(
    model: SkinModel, requests: list[PressRequest], capacity: int, seconds: list[float] | None
) -> Iterator[tuple[int, float, Any]]:
    """Yield the states of presses; one by one where their CPU seconds are to be noted."""
    if seconds is None:
        yield from model.states_many(requests, min(capacity, len(requests)), with_displacement=False)
        return
    _ = model.skin.rest
    for index, request in enumerate(requests):
        began = time.process_time()
        for _, depth, state in model.states_many([request], with_displacement=False):
            yield index, depth, state
        seconds.append(time.process_time() - began)
        print(f"  {request.indenter.shape} {max(request.depths):.2f} mm: {seconds[-1]:.1f} CPU s", flush=True)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--presses", type=int, default=2000)
    parser.add_argument("--skins", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hardest", type=int, default=0, help="solve only so many of the presses, one by one")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    plan, design, settings = read_simulation_plan(PLAN), default_sensor(), ModelSettings(error_estimate=False)
    mesh, each = build_mesh(design, MeshSettings()), arguments.presses // arguments.skins
    capacity = AT_A_TIME[arguments.device.split(":")[0]]
    lost: list[dict] = []
    refused = 0
    steps: list[int] = []
    changed = 0
    of_press: list[int] = []
    seconds: list[float] = []
    chosen = hardest(plan, arguments.seed, arguments.skins, each, arguments.hardest) if arguments.hardest else None
    solved = 0
    shapes: Counter[str] = Counter()
    began = time.perf_counter()
    for number in range(arguments.skins):
        sensor = skin(arguments.seed, number)
        mine = [k for k in range(number * each, (number + 1) * each) if chosen is None or k in chosen]
        if not mine:
            continue
        own = stretched(mesh, design.skin.thickness, sensor.skin.thickness)
        model = SkinModel(sensor, settings, arguments.device, own)
        drawn = [draw_press(plan, sensor, arguments.seed, k) for k in mine]
        requests = [asked(press) for press in drawn]
        total, solved = np.zeros(len(mine), int), solved + len(mine)
        for index, depth, state in walk(model, requests, capacity, seconds if chosen else None):
            if isinstance(state, SolveError):
                press = drawn[index]
                if not possible(requests[index], sensor):
                    refused += 1
                    continue
                lost.append(
                    {
                        "skin": number,
                        "press": mine[index],
                        "friction": sensor.contact.friction,
                        "nu": sensor.material.poisson_ratio,
                        "thickness": sensor.skin.thickness,
                        "indenter": press.indenter.document,
                        "x": press.x,
                        "y": press.y,
                        "yaw": press.yaw,
                        "tilt": [press.tilt_x, press.tilt_y],
                        "depth": press.depth,
                        "at": depth,
                        "reason": state.given,
                    }
                )
            else:
                steps.append(state.newton)
                changed += state.changed
                total[index] += state.newton
        of_press += total.tolist()
        shapes.update(press.indenter_name for press in drawn)
        print(f"skin {number}: {time.perf_counter() - began:.0f} s, {len(lost)} lost", flush=True)
    count = solved - refused
    print(f"{refused} presses refused before they were solved")
    low, high = binomtest(len(lost), count).proportion_ci(method="wilson")
    median, p95 = np.percentile(steps, [50, 95])
    print(
        f"{len(lost)} of {count} presses without an equilibrium: {100 * len(lost) / count:.2f} %"
        f" ({100 * low:.2f} to {100 * high:.2f} %)"
    )
    print(
        f"Newton steps a state: median {median:.0f}, 95th percentile {p95:.0f}; a press: median"
        f" {np.median(of_press):.0f}, most {max(of_press)}"
    )
    print(f"{100 * changed / sum(steps):.0f} % of the steps changed the contact")
    if seconds:
        print(f"CPU seconds a press: median {np.median(seconds):.1f}, most {max(seconds):.1f}")
    for name, one in Counter(entry["indenter"]["shape"] for entry in lost).most_common():
        print(f"  {name}: {one}")
    for entry in lost:
        print(f"  {entry['reason']}")
    if arguments.json:
        result = {
            "presses": count,
            "refused": refused,
            "lost": lost,
            "newton": {"median": median, "p95": p95, "most": max(of_press)},
            "shapes": shapes,
            "device": arguments.device,
            "cpu_seconds": seconds,
        }
        arguments.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
