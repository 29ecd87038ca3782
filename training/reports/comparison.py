"""Compares several runs: by network and split, over seeds, against the paper's figures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from training.scoring.evaluate import METRICS
from training.scoring.published import TABLE_1

LARGER_IS_BETTER = {"iou"}


@dataclass(frozen=True)
class Group:
    """Runs of one network, recipe and split that differ in their seed."""

    name: str
    """Network, and what its recipe changes of the paper's."""
    split: str
    seeds: tuple[int, ...]
    frames: int
    """Scored frames in contact, all seeds."""
    values: dict[str, np.ndarray]
    """Metric -> mean over the frames in contact of each seed [mm, px, 1], shape (seeds,)."""
    reliability: dict[float, np.ndarray]
    """Level -> share of errors inside its interval of each seed [1], shape (seeds,); empty if not calibrated."""
    pace: float
    """Median time a frame on one CPU core [ms]."""
    parameters: int

    def mean(self, metric: str) -> float:
        """Return the mean over the seeds."""
        return float(np.mean(self.values[metric]))

    def deviation(self, metric: str) -> float | None:
        """Return the sample standard deviation over the seeds; None for one."""
        return float(np.std(self.values[metric], ddof=1)) if len(self.seeds) > 1 else None

    def beats_the_paper(self, metric: str) -> bool:
        """Return whether the mean over the seeds is better than the paper's mean in Table 1."""
        theirs = TABLE_1[metric]["mean"]
        return self.mean(metric) > theirs if metric in LARGER_IS_BETTER else self.mean(metric) < theirs


def groups(runs: Iterable[tuple[str, dict[str, Any]]]) -> list[Group]:
    """Return the runs, each a name and its scores document, put together by name and split.

    Runs without a frame in contact are left out: they have no figures.
    """
    together: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for name, document in runs:
        if document["contact_frames"]["contact_rmse"]["mean"] is not None:
            together.setdefault((name, document["split"]["name"]), []).append(document)
    return [_group(name, split, documents) for (name, split), documents in together.items()]


def _group(name: str, split: str, documents: list[dict[str, Any]]) -> Group:
    documents = sorted(documents, key=lambda d: d["split"]["seed"])
    calibrated = all("uncertainty" in d for d in documents)
    levels = [entry["level"] for entry in documents[0]["uncertainty"]["levels"]] if calibrated else []
    return Group(
        name=name,
        split=split,
        seeds=tuple(d["split"]["seed"] for d in documents),
        frames=sum(d["frames"]["in_contact"] for d in documents),
        values={m: np.array([_mean(d, m) for d in documents]) for m in METRICS},
        reliability={
            level: np.array([d["uncertainty"]["levels"][k]["inside"] for d in documents])
            for k, level in enumerate(levels)
        },
        pace=float(np.median([d["inference_ms_per_frame"] for d in documents])),
        parameters=documents[0]["checkpoint"]["parameters"],
    )


def _mean(document: dict[str, Any], metric: str) -> float:
    value = document["contact_frames"][metric]["mean"]
    return np.nan if value is None else float(value)


def verdicts(found: list[Group]) -> list[str]:
    """Return one sentence a group: which of the paper's figures it beats, and which not."""
    sentences = []
    for group in found:
        better = [METRICS[m][1] for m in METRICS if group.beats_the_paper(m)]
        worse = [METRICS[m][1] for m in METRICS if not group.beats_the_paper(m)]
        words = f"{group.name}, split {group.split}: "
        words += (
            f"better than the paper's mean in {', '.join(better)}" if better else "no metric better than the paper's"
        )
        sentences.append(words + (f"; not in {', '.join(worse)}." if better and worse else "."))
    return sentences
