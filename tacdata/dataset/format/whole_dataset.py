"""A LeRobot v3.0 folder of any features, written at once."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from tacdata import documents
from tacdata.dataset.format import folder, statistics, tiff
from tacdata.dataset.format.features import INDEX_COLUMNS

Columns = dict[str, np.ndarray]
"""Values of an episode by feature, frames first."""


def write_whole(
    root: Path, features: dict[str, Any], episodes: Sequence[tuple[Columns, str]], rate: float, robot: str
) -> dict[str, Any]:
    """Write a dataset and return its info.json, which is written last.

    Args:
        root: The folder.
        features: LeRobot's description of each column; its own five are added.
        episodes: Columns and task of each episode.
        rate: Frames a second [Hz]; LeRobot wants a whole number.
        robot: Name of the robot.
    """
    features = features | {k: {"dtype": dtype, "shape": [1], "names": None} for k, dtype in INDEX_COLUMNS.items()}
    info = folder.empty_info(features, rate, robot)
    tasks, first, parts = list(dict.fromkeys(task for _, task in episodes)), 0, []
    for number, (columns, task) in enumerate(episodes):
        count = len(next(iter(columns.values())))
        record = columns | {
            "timestamp": (np.arange(count) / info["fps"]).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, number),
            "index": np.arange(first, first + count),
            "task_index": np.full(count, tasks.index(task)),
        }
        parts.append({key: statistics.column_statistics(record[key]) for key in features})
        folder.write_parquet(root / folder.data_path(number), episode_table(record, features))
        row = folder.EpisodeRow(number, first, first + count, (task,), number, number)
        folder.write_row(root, row, parts[-1], {})
        first += count
    folder.write_tasks(root, tasks)
    folder.write_stats(root, {key: statistics.merge([part[key] for part in parts]) for key in features})
    info |= {"total_episodes": len(episodes), "total_frames": first, "total_tasks": len(tasks)}
    info["splits"] = {"train": f"0:{len(episodes)}"}
    documents.write_text(root / folder.INFO, json.dumps(info, indent=4))
    return info


def episode_table(columns: Columns, features: dict[str, Any], stamp: dict[bytes, bytes] | None = None) -> pa.Table:
    """Return an episode as a data file's table; maps [m] become images.

    Args:
        columns: Values by feature.
        features: LeRobot's description of each column.
        stamp: Further metadata of the file.
    """
    arrays: dict[str, Any] = {}
    for key, feature in features.items():
        values = columns[key]
        if feature["dtype"] == "image":
            arrays[key] = tiff.encode(values)
        elif values.ndim == 2:
            arrays[key] = pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
        else:
            arrays[key] = pa.array(values)
    metadata = {b"huggingface": folder.huggingface_metadata(features)} | (stamp or {})
    return pa.table(arrays).replace_schema_metadata(metadata)
