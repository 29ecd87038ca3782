"""Score judged worlds: python score.py OUT [--label NAME] [--beside NAME...]; writes tables and pictures."""

import argparse
import json
from pathlib import Path

from scoring import curves, gathered, tables
from scoring.outcome import accepted


def main(out, label, beside, dump):
    """Write the report of a label compared with others."""
    rows = gathered.rows(out, label)
    if not rows:
        raise SystemExit(f"no verdicts in {out / 'verdicts' / label}")
    folder = out / "scores" / label
    folder.mkdir(parents=True, exist_ok=True)
    text = tables.document(rows, label, {name: gathered.rows(out, name) for name in beside})
    (folder / "scores.md").write_text(text)
    (folder / "scores.json").write_text(json.dumps({"version": "1.0", "label": label, "worlds": rows}, indent=1))
    curves.power(rows, folder / "power.png")
    curves.reliability(rows, folder / "reliability.png")
    if dump:
        dump.mkdir(parents=True, exist_ok=True)
        for r in rows:
            answer = json.loads((out / "verdicts" / label / f"{r['id']}.json").read_text())
            truth = json.loads((out / "truth" / f"{r['id']}.json").read_text())
            if answer["verdict"] is None:
                continue
            right = sorted(set().union(*(accepted(name) for name in truth["effects"])))
            both = {"verdict": answer["verdict"], "truth": right, "block": r["block"], "outcome": r["outcome"]}
            (dump / f"{r['id']}.json").write_text(json.dumps({**both, "engine": answer["engine"]["commit"]}))
    print(text, end="")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--label", default="workflow")
    parser.add_argument("--beside", nargs="*", default=[], help="other labels: ablations")
    help_dump = "also write each verdict with the names that were right to this folder"
    parser.add_argument("--dump", type=Path, default=None, help=help_dump)
    chosen = parser.parse_args()
    main(chosen.out, chosen.label, chosen.beside, chosen.dump)
