"""The paper's configuration-referenced evaluations, with its own rows (schemas/protocols.schema.json).

- labels: centre depth over the depth trials; position over the position trials at three thresholds, all and those
  whose reference region is not cut by the border (section on labels);
- prediction: centre depth over all position trials, position over those not cut and over all (Exp. 1, physical
  evaluation from measured inputs);
- wearing: centroid-aligned IoU by participant (section on structure design).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tacdata import provenance, schemas
from tacdata.errors import UsageError
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.trials import DEPTH_TRIAL, POSITION_TRIAL, WEARING_TRIAL, PressTrial, trials
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.compute import reproducible
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics.overlap import aligned_iou
from tacdata.training.metrics.physical import REGION_THRESHOLD, score_press

THRESHOLDS = (0.3, 0.4, 0.5)
"""Depths above which a pixel belongs to the region [mm] (paper, section on labels)."""

MapOf = Callable[[PressTrial], np.ndarray]


def protocols(frames: Frames, trained: Checkpoint | None = None) -> dict[str, Any]:
    """Return every evaluation for which the dataset holds trials, as a document.

    Args:
        frames: The dataset with the trials.
        trained: The network; None for the evaluations of labels alone.

    Raises:
        FormatError: If the network is of another sensor.
        UsageError: If the dataset holds no trials, or they are among the episodes that the network learned from.
    """
    kinds = {name: trials(frames, name) for name in (DEPTH_TRIAL, POSITION_TRIAL, WEARING_TRIAL)}
    if not any(span.purpose for span in frames.episodes):
        kinds[WEARING_TRIAL] = ()  # presses that nobody named are not worn
    if not any(kinds.values()):
        raise UsageError(
            f"{frames.origin} holds no {', '.join(kinds)}",
            "presses of these purposes, or presses of which none has a purpose",
            "record the plan that `tacdata plan evaluation` writes, label and pack it",
        )
    tables: dict[str, Any] = {}
    if kinds[DEPTH_TRIAL]:
        tables["label_depth"] = _centre_depth(kinds[DEPTH_TRIAL], _label, frames)
    if kinds[POSITION_TRIAL]:
        tables["label_position"] = [_position(kinds[POSITION_TRIAL], _label, frames, t) for t in THRESHOLDS]
    if trained is not None:
        _check_unseen(frames, trained)
        tables |= _predicted(frames, trained, kinds)
    return {
        "version": schemas.version("protocols"),
        "statement": _statement(frames),
        "dataset": {"hash": frames.dataset_hash, "path": frames.origin, "virtual": frames.virtual},
        "sensor": {"name": frames.sensor.name, "hash": frames.sensor.content_hash},
        "network": None if trained is None else _network(trained),
        **tables,
        "provenance": provenance.stamp("training.scoring.protocols", {"dataset": frames.dataset_hash}, {}),
    }


def _statement(frames: Frames) -> str:
    where = {True: "a virtual rig", False: "a real rig", None: "a rig that the dataset does not name"}[frames.virtual]
    return (
        f"Ours were recorded on {where}; the paper's come from its own sensor, rig, plan and simulator. They stand "
        "beside ours for orientation and are no comparison on equal data."
    )


def _network(trained: Checkpoint) -> dict[str, Any]:
    return {"name": trained.network.name, "hash": trained.content_hash, "epoch": trained.document["epoch"]}


def _check_unseen(frames: Frames, trained: Checkpoint) -> None:
    trained.check_sensor(frames.sensor, frames.origin)
    if frames.dataset_hash == trained.document["dataset"]["hash"]:
        raise UsageError(
            f"{frames.origin} is the dataset that the network was trained on",
            "trials recorded apart from it: held-out repeats",
            "record the evaluation plan as a session of its own and pack it into a dataset of its own",
        )


def _label(trial: PressTrial) -> np.ndarray:
    return trial.label


def _predicted(frames: Frames, trained: Checkpoint, kinds: dict[str, tuple[PressTrial, ...]]) -> dict[str, Any]:
    windows = Windows(frames, trained.network.offsets)
    network = trained.network.to("cpu")

    def mapped(trial: PressTrial) -> np.ndarray:
        return predict(network, windows, trial.full, frames.sensor.map.depth_max).mean(axis=0)

    with reproducible():
        maps = {t.span.number: mapped(t) for trials in kinds.values() for t in trials}

    def of(trial: PressTrial) -> np.ndarray:
        return maps[trial.span.number]

    tables: dict[str, Any] = {}
    if kinds[POSITION_TRIAL]:
        tables["prediction_depth"] = _centre_depth(kinds[POSITION_TRIAL], of, frames)
        tables["prediction_position"] = _position(kinds[POSITION_TRIAL], of, frames, REGION_THRESHOLD)
    if kinds[DEPTH_TRIAL]:
        tables["prediction_depth_trials"] = _centre_depth(kinds[DEPTH_TRIAL], of, frames)
    if kinds[WEARING_TRIAL]:
        tables["wearing"] = _wearing(kinds[WEARING_TRIAL], of)
    return tables


def _centre_depth(trials: tuple[PressTrial, ...], of: MapOf, frames: Frames) -> dict[str, Any]:
    grid = frames.sensor.map
    scored = [score_press(t.span.number, of(t), t.label, t.tip, grid) for t in trials]
    errors = np.array([np.nan if s.centre_depth_error is None else s.centre_depth_error for s in scored])
    return {**_summary(np.abs(errors)), "bias": None if np.isnan(errors).all() else float(np.nanmean(errors))}


def _position(trials: tuple[PressTrial, ...], of: MapOf, frames: Frames, threshold: float) -> dict[str, Any]:
    grid = frames.sensor.map
    scored = [score_press(t.span.number, of(t), t.label, t.tip, grid, threshold) for t in trials]
    errors = np.array([np.nan if s.position_error is None else s.position_error for s in scored])
    complete = np.array([s.reference_region and not s.truncated for s in scored])
    return {"threshold_mm": threshold, "all": _summary(errors), "not_truncated": _summary(errors[complete])}


def _wearing(trials: tuple[PressTrial, ...], of: MapOf) -> dict[str, Any]:
    by_person: dict[str, list[float]] = {}
    for trial in trials:
        overlap = aligned_iou(of(trial), trial.label)
        # No region predicted where one was pressed is no overlap.
        by_person.setdefault(trial.span.specimen or "unknown", []).append(0.0 if overlap is None else overlap)
    rows = [{"participant": name, "trials": len(v), **_summary(np.array(v))} for name, v in sorted(by_person.items())]
    return {
        "threshold_mm": REGION_THRESHOLD,
        "participants": rows,
        # As in the paper each participant counts once, however many trials there are.
        "overall": _summary(np.array([row["mean"] for row in rows])),
    }


def _summary(values: np.ndarray) -> dict[str, Any]:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return {"mean": None, "sd": None, "median": None, "p95": None, "count": 0, "left_out": len(values)}
    return {
        "mean": float(finite.mean()),
        "sd": float(finite.std(ddof=1)) if len(finite) > 1 else None,
        "median": float(np.median(finite)),
        "p95": float(np.percentile(finite, 95)),
        "count": len(finite),
        "left_out": len(values) - len(finite),
    }
