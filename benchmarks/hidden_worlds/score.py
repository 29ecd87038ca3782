"""Score judged worlds: python score.py OUT. Intervals are Clopper-Pearson, 95 %."""

import json
import sys
from collections import defaultdict
from pathlib import Path

from scipy.stats import beta

OUTSIDE = {"viscous_gain", "telegraph", "cable_pull", "stick_slip", "ageing_creep", "lost_and_found"}


def interval(k, n):
    """Return the interval of a share."""
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return low, high


def outcome(answer):
    """Return success, wrong, set, unknown, missed, false name or right for one world."""
    truth = set(answer["truth"])
    named = {m["mechanism"] for m in answer["members"]}
    if answer["status"] == "crashed":
        return "crashed"
    if not truth:
        return {"none": "right none", "named": "false name"}.get(answer["status"], "false alarm, no name")
    if answer["status"] == "named":
        return "success" if named == truth else "wrong"
    if answer["status"] == "none":
        return "missed"
    if answer["status"] == "ambiguous":
        sets = [{m["mechanism"], *m["rivals"]} for m in answer["members"]]
        held = len(sets) == len(truth) and all(any(t in s for s in sets) for t in truth)
        return "set with the truth" if held else "set without it"
    return "unknown"


def main(folder):
    """Print a table of outcomes a block."""
    table = defaultdict(lambda: defaultdict(list))
    seconds = []
    for path in sorted(folder.glob("*.json")):
        answer = json.loads(path.read_text())
        block, name = answer["name"].split("-", 1)
        table[f"{block} {answer['response']}"][outcome(answer)].append(name)
        seconds.append(answer.get("seconds", 0.0))
    for block, outcomes in table.items():
        total = sum(map(len, outcomes.values()))
        print(f"{block}: {total} worlds")
        for kind, names in sorted(outcomes.items(), key=lambda item: -len(item[1])):
            low, high = interval(len(names), total)
            share = f"{100 * len(names) / total:5.1f} %  [{100 * low:.1f}, {100 * high:.1f}]"
            print(f"  {kind:<22} {len(names):>3}  {share}  {', '.join(names) if len(names) < 9 else ''}")
    if seconds:
        seconds.sort()
        print(f"CPU seconds a world: median {seconds[len(seconds) // 2]:.1f}, most {seconds[-1]:.1f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
