"""Scores a trained network: the paper's table, by indenter, and against the prescribed contact."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from tacdata import provenance, schemas
from tacdata.display import Displayed
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.frames.trials import at_full_depth
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.compute import choose_device, reproducible
from tacdata.training.inference.predictor import deviations, milliseconds_per_frame, predict
from tacdata.training.metrics import conformal_intervals, depth_maps, physical
from tacdata.training.metrics.depth_maps import FrameScores
from tacdata.training.metrics.physical import PressScore
from tacdata.training.scoring import baselines, contact_scores, published

DEPTHS = (0.2, 0.3, 0.5, 0.8)
"""Borders of the largest labelled depth between groups of frames [mm]."""
METRICS = {
    "pixel_rmse": ("Depth", "Pixel-wise RMSE", "mm"),
    "peak_error": ("Depth", "Peak Depth Error", "mm"),
    "contact_rmse": ("Depth", "Contact-region RMSE", "mm"),
    "centroid_error": ("Position", "Centroid Error", "px"),
    "iou": ("Region", "IoU", "1"),
}
"""Metric -> category, title and unit, in the order of the paper's Table 1."""


@dataclass(frozen=True)
class EpisodeResult:
    """One scored episode."""

    span: EpisodeSpan
    """The episode."""
    depth: np.ndarray
    """Predicted depth of every frame [mm], shape (n, pixels_x, pixels_y), float32."""
    label: np.ndarray
    """Labelled depth clipped to 0 ... D_max [mm], same shape."""
    valid: np.ndarray
    """Frames that are scored [bool], shape (n,)."""
    scores: FrameScores
    """Scores of all frames, valid or not."""
    full: np.ndarray
    """Valid frames at full depth [bool], shape (n,)."""


@dataclass(frozen=True, repr=False)
class Evaluation(Displayed):
    """Scores with their origin."""

    document: dict[str, Any]
    """`schemas/scores.schema.json`."""
    episodes: tuple[EpisodeResult, ...]
    """One entry a scored episode."""
    part: str
    """Role of the episodes in training: "test", or "other dataset"."""
    checkpoint_hash: str
    """Identity of the checkpoint."""

    def description(self) -> list[str]:
        """Return the lines that `repr` shows: the medians of the frames in contact."""
        frames, network = self.document["frames"], self.document["checkpoint"]["name"]
        scores = self.document["contact_frames"]
        peak, rmse, centroid, iou = (
            "none" if (median := scores[name]["median"]) is None else f"{median:.3f}{unit}"
            for name, unit in (("peak_error", " mm"), ("contact_rmse", " mm"), ("centroid_error", " px"), ("iou", ""))
        )
        warnings = [
            f"{name}, without a network, is ahead in {', '.join(METRICS[metric][1].lower() for metric in table)}"
            for name, table in baselines.ahead(self.document).items()
        ]
        return [
            f"Evaluation of {network} on {len(self.episodes)} episodes of the part {self.part}",
            *warnings,
            f"{frames['in_contact']} of {frames['scored']} frames in contact; medians over these:",
            f"peak error {peak}, contact RMSE {rmse}, centroid error {centroid}, IoU {iou}",
        ]


def evaluate(
    trained: Checkpoint,
    frames: Frames,
    device: str = "auto",
    threads: int | None = None,
    listener: Callable[[int, int], None] = lambda k, n: None,
) -> Evaluation:
    """Score a network on the test episodes of its own dataset, or on every episode of another one.

    Args:
        trained: The network.
        frames: The dataset.
        device: Where the maps are predicted; the time per frame is always taken on one CPU thread.
        threads: CPU threads; by default one a core, at most `compute.THREADS`.
        listener: Called after each episode with its count and the number of all.

    Raises:
        FormatError: If the dataset is of another sensor, or lacks episodes of the split.
    """
    trained.check_sensor(frames.sensor, frames.origin)
    same_dataset = frames.dataset_hash == trained.document["dataset"]["hash"]
    numbers = trained.split.test if same_dataset else tuple(e.number for e in frames.episodes)
    spans = frames.spans(numbers)
    # Raises if no frame of these episodes is valid, before the network runs.
    frames.indices(numbers)
    place = choose_device(device)
    windows = Windows(frames, trained.network.offsets, place)
    network = trained.network.to(place)
    results = []
    with reproducible(threads):
        for count, span in enumerate(spans, start=1):
            results.append(
                _result(
                    frames,
                    span,
                    predict(network, windows, np.arange(span.start, span.stop), frames.sensor.map.depth_max),
                )
            )
            listener(count, len(spans))
    # On one CPU core, as on a robot's computer.
    pace = milliseconds_per_frame(network.to("cpu"), Windows(frames, network.offsets))
    episodes, part, identity = tuple(results), "test" if same_dataset else "other dataset", trained.content_hash
    document = {
        "version": schemas.version("scores"),
        **_identity(trained, identity, frames, part, episodes),
        **_agreement(episodes),
        "baselines": _baselines(trained, frames, episodes) if same_dataset else {},
        **_prescribed(episodes, frames),
        "contacts": contact_scores.scored(_at_full_depth(episodes), frames.sensor.map.pixel_pitch),
        **_uncertainty(trained, identity, episodes, frames),
        "inference_ms_per_frame": pace,
        "provenance": provenance.stamp(
            "training.scoring.evaluate",
            {"checkpoint": identity, "dataset": frames.dataset_hash},
            {"device": str(place)},
        ),
    }
    return Evaluation(document, episodes, part, identity)


def _result(frames: Frames, span: EpisodeSpan, depth: np.ndarray) -> EpisodeResult:
    frame_rows = slice(span.start, span.stop)
    # Within the network's range: what lies beyond it is no error of its training.
    label = np.clip(frames.depth[frame_rows], 0.0, frames.sensor.map.depth_max)
    scores = depth_maps.score_frames(depth, label)
    return EpisodeResult(span, depth, label, frames.valid[frame_rows], scores, at_full_depth(frames, span))


def _identity(
    trained: Checkpoint, identity: str, frames: Frames, part: str, episodes: tuple[EpisodeResult, ...]
) -> dict[str, Any]:
    rig = {True: "a virtual rig", False: "a real rig", None: "a rig that the dataset does not name"}[frames.virtual]
    first = {
        "test": "Scores on test episodes that the network never saw",
        "other dataset": "Scores on every episode of a dataset that the network was not trained on",
    }[part]
    return {
        "statement": f"{first}, recorded on {rig}. The paper's figures come from its own sensor, rig and "
        "test set: they stand beside ours for orientation and are no comparison on equal data.",
        "checkpoint": {
            "hash": identity,
            "epoch": trained.document["epoch"],
            **trained.document["network"],
            "code_version": trained.document["provenance"]["code_version"],
        },
        "dataset": {"hash": frames.dataset_hash, "path": frames.origin, "virtual": frames.virtual},
        "sensor": {
            "name": frames.sensor.name,
            "hash": frames.sensor.content_hash,
            "pixel_pitch_mm": frames.sensor.map.pixel_pitch,
        },
        "split": {
            "name": trained.split.name,
            "seed": trained.split.seed,
            "part": part,
            "episodes": [e.span.number for e in episodes],
        },
    }


def _agreement(episodes: tuple[EpisodeResult, ...]) -> dict[str, Any]:
    """Return the tables of prediction against label, and the counts behind them."""
    scores = _joined([e.scores.where(e.valid) for e in episodes])
    touching = scores.where(scores.labelled)
    names = sorted({e.span.indenter for e in episodes})
    by_indenter = []
    for name in names:
        by_shape = [e for e in episodes if e.span.indenter == name]
        part = _joined([e.scores.where(e.valid & e.scores.labelled) for e in by_shape])
        by_indenter.append(
            {"indenter": name, "episodes": len(by_shape), "frames": len(part.iou), "metrics": _table(part)}
        )
    missed = int((~touching.predicted).sum())
    unlabelled = ~scores.labelled
    return {
        "contact_threshold_mm": depth_maps.CONTACT_THRESHOLD,
        "frames": {
            "scored": len(scores.iou),
            "in_contact": len(touching.iou),
            "left_out_as_invalid": sum(int((~e.valid).sum()) for e in episodes),
        },
        "contact_frames": _table(touching),
        "all_frames": _table(scores),
        "indenters": by_indenter,
        "depths": _by_depth(episodes),
        "missed_contact": _proportion(
            "frames in contact whose predicted map has no pixel above the contact threshold", missed, len(touching.iou)
        ),
        "false_contact": _proportion(
            "frames out of contact whose predicted map has a pixel above the contact threshold",
            int(scores.predicted[unlabelled].sum()),
            int(unlabelled.sum()),
        ),
    }


def _by_depth(episodes: tuple[EpisodeResult, ...]) -> list[dict[str, Any]]:
    """Return the table by the largest labelled depth of a frame: where contact only begins, regions are few pixels."""
    touching = [e.valid & e.scores.labelled for e in episodes]
    scores = _joined([e.scores.where(mask) for e, mask in zip(episodes, touching, strict=True)])
    deepest = np.concatenate([e.label[mask].max(axis=(1, 2)) for e, mask in zip(episodes, touching, strict=True)])
    rows = []
    for low, high in itertools.pairwise((depth_maps.CONTACT_THRESHOLD, *DEPTHS, np.inf)):
        part = scores.where((deepest > low) & (deepest <= high))
        if len(part.iou):
            upper = None if high == np.inf else high
            rows.append({"above_mm": low, "up_to_mm": upper, "frames": len(part.iou), "metrics": _table(part)})
    return rows


def _baselines(trained: Checkpoint, frames: Frames, episodes: tuple[EpisodeResult, ...]) -> dict[str, Any]:
    """Return the table of every baseline over the same frames in contact."""
    spans = [np.arange(e.span.start, e.span.stop)[e.valid & e.scores.labelled] for e in episodes]
    label = np.concatenate([e.label[e.valid & e.scores.labelled] for e in episodes])
    maps = baselines.predictions(frames, trained.split, np.concatenate(spans))
    return {name: _table(depth_maps.score_frames(depth, label)) for name, depth in maps.items()}


def _prescribed(episodes: tuple[EpisodeResult, ...], frames: Frames) -> dict[str, Any]:
    """Return the comparison of predictions and labels with the nominal contact, one value a press."""
    grid = frames.sensor.map
    ours, labels = [], []
    for e in (e for e in episodes if e.span.depth > 0 and e.full.any()):
        tip = frames.tip[e.span.start : e.span.stop][e.full].mean(axis=0)
        reference = e.label[e.full].mean(axis=0)
        ours.append(physical.score_press(e.span.number, e.depth[e.full].mean(axis=0), reference, tip, grid))
        labels.append(physical.score_press(e.span.number, reference, reference, tip, grid))
    inside = [s for s in ours if s.reference_region and not s.truncated]
    near = [s for s in inside if s.position_error is not None and s.position_error < grid.pixel_pitch]
    return {
        "region_threshold_mm": physical.REGION_THRESHOLD,
        "prescribed": {
            "prediction": {**_press_table(ours), "paper": published.PHYSICAL},
            "label": {**_press_table(labels), "paper": published.LABELS},
        },
        "presses": [asdict(s) for s in ours],
        "success": _proportion(
            "presses whose predicted contact centre at full depth lies within one pixel "
            f"({grid.pixel_pitch:g} mm) of the nominal centre, among those whose labelled region above "
            f"{physical.REGION_THRESHOLD:g} mm is not cut by the map's "
            "border; a press without predicted region fails",
            len(near),
            len(inside),
        ),
    }


def _at_full_depth(episodes: tuple[EpisodeResult, ...]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return mean prediction and label [mm] at full depth of each press that has such frames."""
    return [(e.depth[e.full].mean(axis=0), e.label[e.full].mean(axis=0)) for e in episodes if e.full.any()]


def _uncertainty(
    trained: Checkpoint, identity: str, episodes: tuple[EpisodeResult, ...], frames: Frames
) -> dict[str, Any]:
    """Return the share of errors in each interval; empty if the run was not calibrated."""
    intervals = conformal_intervals.read(trained.path.parent, identity)
    scaled = intervals is not None and intervals.typical is not None
    # Intervals that a process scales are those of the network with it alone.
    if intervals is None or (scaled and trained.network.peak is None):
        return {}
    maps, labels = ([getattr(e, name)[e.valid] for e in episodes] for name in ("depth", "label"))
    windows = Windows(frames, trained.network.offsets, trained.network.get_buffer("mean").device)
    rows = [np.arange(e.span.start, e.span.stop)[e.valid] for e in episodes]
    spreads = [deviations(trained.network, windows, chosen) for chosen in rows] if scaled else None
    levels = conformal_intervals.reliability(intervals, maps, labels, frames.sensor.map.pixel_pitch, spreads)
    return {"uncertainty": {"definition": intervals.definition, "levels": levels}}


def _press_table(scores: list[PressScore]) -> dict[str, Any]:
    """Summarize presses; a truncated reference region counts in ``position_all`` alone, a lost one never."""

    def values(numbers: list[float | None]) -> np.ndarray:
        return np.array([np.nan if v is None else abs(v) for v in numbers])

    with_region = [s for s in scores if s.reference_region]
    return {
        "centre_depth": asdict(depth_maps.summarize(values([s.centre_depth_error for s in scores]))),
        "position": asdict(depth_maps.summarize(values([s.position_error for s in with_region if not s.truncated]))),
        "position_all": asdict(depth_maps.summarize(values([s.position_error for s in with_region]))),
    }


def _joined(parts: list[FrameScores]) -> FrameScores:
    return FrameScores(*(np.concatenate([getattr(p, name) for p in parts]) for name in vars(parts[0])))


def _table(scores: FrameScores) -> dict[str, Any]:
    return {name: asdict(depth_maps.summarize(getattr(scores, name))) for name in METRICS}


def _proportion(definition: str, successes: int, trials: int) -> dict[str, Any]:
    interval = binomtest(successes, trials).proportion_ci(method="wilson") if trials else (None, None)
    return {
        "definition": definition,
        "count": successes,
        "of": trials,
        "proportion": successes / trials if trials else None,
        "wilson_95": list(interval),
    }
