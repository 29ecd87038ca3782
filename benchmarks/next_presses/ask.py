"""Ask the workflow about one world: python ask.py FOLDER COUNT. Writes verdict.json; next.json where it is ambiguous.

Runs as a process of its own in that folder; opening the truth, or the code that made it, ends it.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "hidden_worlds"))
from judge import course_of, guard, spec_of

from tacdata.discrepancy.judge import judge
from tacdata.plans import Plan
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.revision.additions import of_verdict, placed_of
from tacdata.revision.comparison import Comparison
from tacdata.revision.next_presses.machine import MachineLimits
from tacdata.revision.next_presses.plan import choose, plan_of
from tacdata.revision.next_presses.rivals import rivals

TRAVEL = 6.0
"""Largest speed of the guide [mm/s]."""
LIMITS = AxisLimits(np.full(3, 1e4), np.full(3, TRAVEL))
"""The worlds' guide turns at once [mm/s^2, mm/s]."""


def plan_for(course):
    """Return a plan as the lab's sessions have one: its tools, and how fast its guide is."""
    tools = {t.name: {"shape": "sphere", "radius": t.radius} for t in course.tools}
    motion = {
        "clearance": 3.0,
        "travel_speed": TRAVEL,
        "approach_speed": 3.0,
        "press_speed": 1.0,
        "hold": 1.0,
        "rest": 1.0,
    }
    presses = [{"indenter": name, "x": 0.0, "y": 0.0, "depth": 1.0} for name in tools]
    document = {"version": "1.1", "name": "lab", "indenters": tools, "motion": motion, "presses": presses}
    return Plan.from_document(document, "lab")


def recommended(course, spec, verdict, count):
    """Return the presses that the workflow recommends next, in their order, with the pairs that they tell apart."""
    held, plan = Comparison(course, spec, tuple(placed_of(of_verdict(verdict)))), plan_for(course)
    found = rivals(held, verdict)
    chosen = choose(held, found, MachineLimits.of_plan(plan, LIMITS)) if len(found) > 1 else []
    if not chosen:
        return []
    tools = [t.name for t in course.tools]
    entries = plan_of(chosen, held, plan, "next")["presses"]
    # A plan changes tools as rarely as it can; here turns come one after the other, so that few presses hold all kinds.
    entries.sort(key=lambda e: e["repeat"])
    return [
        {
            "tool": tools.index(e["indenter"]),
            "purpose": e["purpose"],
            **{
                k: float(e.get(k, 0.0))
                for k in ("x", "y", "depth", "speed", "hold", "recovery", "overshoot", "strokes", "stroke")
            },
        }
        for e in entries
    ][:count]


def main(folder, count):
    """Judge and write."""
    sys.addaudithook(guard)
    course, spec = course_of(dict(np.load(folder / "recordings.npz"))), spec_of(folder)
    begin = time.process_time()
    verdict = judge(course, spec).document
    told = {"verdict": verdict, "seconds": time.process_time() - begin}
    if verdict["status"] == "ambiguous" and count:
        (folder / "next.json").write_text(json.dumps(recommended(course, spec, verdict, count)))
    (folder / "verdict.json").write_text(json.dumps(told))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
