"""Compares several runs: by network and split, over seeds, against the paper's figures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.training.scoring.evaluate import METRICS
from tacdata.training.scoring.published import TABLE_1

LARGER_IS_BETTER = {"iou"}


@dataclass(frozen=True)
class Group:
    """Runs of one network, recipe and split that differ in their seed."""

    name: str
    """Network, and changes of its recipe from the paper's."""
    split: str
    seeds: tuple[int, ...]
    frames: int
    """Scored frames in contact, all seeds."""
    values: dict[str, np.ndarray]
    """Metric -> mean over the frames in contact of each seed [mm, px, 1], shape (seeds,)."""
    reliability: dict[float, np.ndarray]
    """Level -> share of errors inside its interval of each seed [1], shape (seeds,); empty if not calibrated."""
    baselines: dict[str, dict[str, float]]
    """Predictor without a network -> metric -> mean over the same frames, then over the seeds; empty if not scored."""
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
        return _better(metric, self.mean(metric), TABLE_1[metric]["mean"])

    def beats_the_baselines(self, metric: str) -> bool:
        """Return whether the mean over the seeds is better than that of every predictor without a network."""
        return bool(self.baselines) and all(
            np.isnan(values[metric]) or _better(metric, self.mean(metric), values[metric])
            for values in self.baselines.values()
        )

    def stands_out(self, metric: str) -> bool:
        """Return whether a figure is worth a claim: better than the paper's, and not reached without a network."""
        return self.beats_the_paper(metric) and self.beats_the_baselines(metric)


def _better(metric: str, ours: float, theirs: float) -> bool:
    return ours > theirs if metric in LARGER_IS_BETTER else ours < theirs


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
        baselines={
            predictor: {m: float(np.mean([_mean(d, m, predictor) for d in documents])) for m in METRICS}
            for predictor in (documents[0]["baselines"] if all(d["baselines"] for d in documents) else ())
        },
        pace=float(np.median([d["inference_ms_per_frame"] for d in documents])),
        parameters=documents[0]["checkpoint"]["parameters"],
    )


def _mean(document: dict[str, Any], metric: str, predictor: str = "") -> float:
    table = document["baselines"][predictor] if predictor else document["contact_frames"]
    value = table[metric]["mean"]
    return np.nan if value is None else float(value)


def verdicts(group_list: list[Group]) -> list[str]:
    """Return one sentence a group: in which metrics it beats the paper and the baselines, and in which not."""
    return [_verdict(group) for group in group_list]


def _verdict(group: Group) -> str:
    claims = [METRICS[m][1] for m in METRICS if group.stands_out(m)]
    cheap = [METRICS[m][1] for m in METRICS if group.beats_the_paper(m) and not group.stands_out(m)]
    worse = [METRICS[m][1] for m in METRICS if not group.beats_the_paper(m)]
    parts = []
    if claims:
        parts.append(f"better than the paper's mean and every baseline in {', '.join(claims)}")
    if cheap:
        why = "a predictor without a network reaches it too" if group.baselines else "no baseline was scored"
        parts.append(f"better than the paper's mean in {', '.join(cheap)}, but {why}")
    if worse:
        parts.append(f"not better in {', '.join(worse)}" if parts else "no metric better than the paper's")
    return f"{group.name}, split {group.split}: {'; '.join(parts)}."
