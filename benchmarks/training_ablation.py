"""Networks and recipes on the same splits and seeds: mean ± SD over the seeds, as Markdown and JSON.

    python benchmarks/training_ablation.py DATASET OUT [--split indenter] [--seeds 3] [--epochs 4] [--batch 64]
                                           [--only NAME ...] [--device cpu] [--threads 1]

Each row changes one thing of the row that its name begins with. Every run is kept under OUT and taken up again, so
that rows, seeds and splits can be added later; the table is made of all that is there. Timings come from the runs
themselves and are those of the machine as it was.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

from tacdata.training.frames.data import read_frames
from tacdata.training.generalization import generalize
from tacdata.training.inference import checkpoint
from tacdata.training.loss import WeightedLoss
from tacdata.training.reports.comparison import groups
from tacdata.training.reports.score_sheet import number, row, rule, title
from tacdata.training.scoring.evaluate import METRICS
from tacdata.training.settings import TrainingSettings

PAST = [-8, -7, -6, -5, -4, -3, -2, -1, 0]
CONTACT = WeightedLoss(mixture=0.2, threshold=0.033, foreground=3.0)
"""Weight on all of the contact, from 0.1 mm, and on absolute errors: the paper's begins at 0.9 mm."""
RECIPES: dict[str, TrainingSettings] = {
    "paper": TrainingSettings(network="paper"),
    "causal": TrainingSettings(network="causal"),
    "paper mirror": TrainingSettings(network="paper", mirror=True, schedule="cosine"),
    "history": TrainingSettings(network="history", schedule="cosine"),
    "direct constant": TrainingSettings(network="direct"),
    "direct": TrainingSettings(network="direct", schedule="cosine"),
    "direct nearest": TrainingSettings(network="direct", schedule="cosine", arguments={"offsets": PAST}),
    "direct one frame": TrainingSettings(network="direct", schedule="cosine", arguments={"offsets": [0]}),
    "direct mirror": TrainingSettings(network="direct", schedule="cosine", mirror=True),
    "direct jitter": TrainingSettings(network="direct", schedule="cosine", gain_jitter=0.08),
    "direct mirror jitter": TrainingSettings(network="direct", schedule="cosine", mirror=True, gain_jitter=0.08),
    "direct contact": TrainingSettings(network="direct", schedule="cosine", loss=CONTACT),
    "direct contact mirror": TrainingSettings(network="direct", schedule="cosine", loss=CONTACT, mirror=True),
    "direct wide": TrainingSettings(network="direct", schedule="cosine", mirror=True, arguments={"hidden": 512}),
}


def main() -> None:
    """Train the missing networks, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--split", action="append")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--epochs", type=int, default=4)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--idle", type=float, default=0.1, help="share of the frames out of contact an epoch takes")
    parser.add_argument("--only", action="append", choices=tuple(RECIPES))
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    frames = read_frames(given.dataset)
    scores = []
    for name in given.only or RECIPES:
        recipe = replace(RECIPES[name], epochs=given.epochs, batch_size=given.batch, idle_share=given.idle)
        outcomes = generalize(
            frames,
            recipe,
            tuple(given.split or ["indenter"]),
            given.seeds,
            given.out / name.replace(" ", "-"),
            given.device,
            given.threads,
        )
        for outcome in outcomes:
            if outcome.evaluation is None:
                print(f"{name}: {outcome.reason}", file=sys.stderr)
                continue
            history = checkpoint.load(outcome.folder).document["history"]
            scores.append((name, outcome.evaluation.document, sum(line["seconds"] for line in history)))
            print(f"{name}, {outcome.settings.split}, seed {outcome.settings.seed}: done", file=sys.stderr, flush=True)
    heads = ["Recipe", "Split", "Seeds", *(title(m) for m in METRICS), "Parameters", "ms a frame", "Training (s)"]
    lines = [row(heads), rule(len(heads), 2)]
    for group in groups((name, document) for name, document, _ in scores):
        cells = [f"{number(group.mean(m))} ± {number(group.deviation(m))}" for m in METRICS]
        seconds = [s for name, d, s in scores if (name, d["split"]["name"]) == (group.name, group.split)]
        cells += [f"{group.parameters:,}", f"{group.pace:.2f}", f"{sum(seconds) / len(seconds):.0f}"]
        lines.append(row([group.name, group.split, str(len(group.seeds)), *cells]))
    table = "\n".join(lines) + "\n"
    print(table)
    (given.out / "ablation.md").write_text(table)
    (given.out / "ablation.json").write_text(json.dumps([document for _, document, _ in scores]))


if __name__ == "__main__":
    main()
