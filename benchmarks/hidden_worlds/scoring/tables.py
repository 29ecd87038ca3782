"""The report of a run, in Markdown."""

from collections import Counter, defaultdict

import numpy as np

from scoring.bars import bars, share
from scoring.measures import SAME
from scoring.outcome import RIGHT, WRONG

SIZES = ("0.5", "1", "3", "10")


def blocks(rows):
    """Return the table of outcomes, a line for each block and response."""
    groups = defaultdict(list)
    for r in rows:
        groups[r["block"], r["response"]].append(r["outcome"])
    lines = ["| block | response | n | right | confidently wrong | neither |", "|---|---|---|---|---|---|"]
    for (block, response), outcomes in sorted(groups.items()):
        n, count = len(outcomes), Counter(outcomes)
        right, wrong = sum(count[o] for o in RIGHT), sum(count[o] for o in WRONG)
        rest = ", ".join(f"{o} {k}" for o, k in count.most_common() if o not in (*RIGHT, *WRONG))
        lines.append(f"| {block} | {response} | {n} | {share(right, n)} | {share(wrong, n)} | {rest} |")
    return lines


def singles(rows):
    """Return the table of the outcomes of every effect, by size."""
    table = defaultdict(dict)
    for r in rows:
        if r["block"].startswith("singles"):
            table[r["name"], r["response"]][r["block"][len("singles") :]] = r
    lines = ["| hidden | response | " + " | ".join(f"{s} x limit" for s in SIZES) + " |", "|---|---|---|---|---|---|"]
    for (name, response), cells in sorted(table.items()):
        words = [_cell(cells[s]) if s in cells else "" for s in SIZES]
        lines.append(f"| {name} | {response} | " + " | ".join(words) + " |")
    return lines


def _cell(r):
    told = " + ".join("/".join(names[:4]) for names in r["told"] or [])
    return r["outcome"] + (f": {told}" if told and r["outcome"] != "success" else "")


def wrong(rows):
    """Return the table of verdicts that are confidently wrong, lack the truth, or did not come."""
    worst = [r for r in rows if r["outcome"] in (*WRONG, "crashed", "set without the truth")]
    lines = ["| block | hidden | response | outcome | told | id |", "|---|---|---|---|---|---|"]
    for r in worst:
        told = " + ".join("/".join(names) for names in r["told"] or []) or r["status"]
        lines.append(f"| {r['block']} | {r['name']} | {r['response']} | {r['outcome']} | {told} | {r['id']} |")
    return lines


def beside(mine, theirs, label, name):
    """Return the tables of two labels on the worlds that both judged."""
    same = {r["id"] for r in theirs} & {r["id"] for r in mine}
    lines = [f"## Beside {name}", "", f"On the {len(same)} worlds that both judged."]
    for title, rows in ((label, mine), (name, theirs)):
        shared = [r for r in rows if r["id"] in same]
        lines += ["", f"### {title}", "", *blocks(shared), "", _closed(shared)]
    return lines


def _closed(rows):
    closed = [r["gap"] for r in rows if r.get("gap") is not None]
    worse = [r["label_after"] > r["label_before"] + SAME for r in rows if "label_after" in r]
    middle = f"{np.median(closed):.3f} (n = {len(closed)})" if closed else "no world"
    return f"Gap closed, median: {middle}; labels worse than before: {share(sum(worse), len(worse))}."


def document(rows, label, rivals=None):
    """Return the whole report.

    Args:
        rows: Of the label.
        label: Its name.
        rivals: Other labels -> rows: ablations.
    """
    engines = sorted({f"{r['engine']['commit'] or 'a copy outside git'} (files {r['engine']['hash']})" for r in rows})
    lines = [f"# Hidden worlds: {label}", "", f"{len(rows)} worlds; engine: {', '.join(engines)}.", ""]
    lines += ["| what | asked for | measured (count, 95 % interval) | met |", "|---|---|---|---|"]
    lines += [f"| {b.what} | {b.asked} | {b.measured} | {b.verdict} |" for b in bars(rows)]
    lines += [
        "",
        "## Outcomes",
        "",
        *blocks(rows),
        "",
        "## Singles",
        "",
        *singles(rows),
        "",
        "## Wrong",
        "",
        *wrong(rows),
    ]
    for name, others in (rivals or {}).items():
        lines += ["", *beside(rows, others, label, name)]
    return "\n".join(lines) + "\n"
