"""One episode of a dataset, read without its neighbours."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from tacdata.dataset import cache
from tacdata.dataset.format import features, folder, metadata
from tacdata.dataset.reader import Dataset, DatasetEpisode, read_dataset
from tacdata.errors import FormatError

SHOWN = (features.TIME, features.STATE, features.RAW, features.DEPTH, features.TIP, features.FORCE, features.PHASE)
"""Columns that a scene is made of."""


def read_single(root: Path, number: int) -> tuple[Dataset, int]:
    """Return a dataset that holds one episode, and how many the whole has.

    If an edit lost the keys of sensor and record, the whole dataset is read (`tacdata.dataset.reader`), which knows
    where to look for them.

    Args:
        root: The dataset's folder.
        number: Number of the episode; one that there is not gives a dataset without episodes.

    Raises:
        UsageError: If there is no dataset.
        FormatError: If it is damaged or foreign.
    """
    info = folder.read_info(root)
    main = metadata.read_main(root)
    is_standard = {*SHOWN, features.SENSOR, features.RECORD, "index"} <= set(info["features"])
    if main is None or not is_standard:
        dataset = read_dataset(root)
        return dataset, len(dataset.episodes)
    count = info["total_episodes"]
    if not 0 <= number < count:
        return Dataset(root, {}, (), {}, info["fps"], ""), count
    row = _row(root, info, number)
    columns = _columns(root / folder.data_path(row.data_file), info, row)
    by_key = {features.short_hash(digest): digest for digest in main["sensors"]}
    digest = by_key.get(int(columns[features.SENSOR][0]))
    record = metadata.read_record(root, int(columns[features.RECORD][0]))
    if digest is None or record is None:
        dataset = read_dataset(root)
        return dataset, len(dataset.episodes)
    sensor = metadata.Sensor.from_document(main["sensors"][digest], str(root))
    entry = DatasetEpisode(number, 0, row.stop - row.start, " / ".join(row.tasks), digest, record)
    return Dataset(root, columns, (entry,), {digest: sensor}, info["fps"], ""), count


def _row(root: Path, info: dict, number: int) -> folder.EpisodeRow:
    """Return an episode's row, from the file of its number where each has one, as we write them."""
    path = root / folder.row_path(number)
    entry = folder.rows_in(path).get(number) if path.is_file() else None
    return entry or folder.read_rows(root, info)[number]


def _columns(path: Path, info: dict, row: folder.EpisodeRow) -> dict[str, np.ndarray]:
    """Return an episode's columns, frames first, in the units of `features`."""
    keys = [*SHOWN, features.SENSOR, features.RECORD]
    table = folder.read_parquet(path, [*keys, "index"])
    index = table["index"].to_numpy()
    first, last = np.searchsorted(index, [row.start, row.stop])
    # An edit by another tool may have removed frames without telling the rows of episodes.
    if not np.array_equal(index[first:last], np.arange(row.start, row.stop)):
        raise FormatError(
            f"{path}: it lacks frames of episode {row.index}",
            f"frames {row.start} to {row.stop - 1}",
            "put the original file back, or pack the session again",
        )
    part = table.slice(int(first), int(last - first))
    try:
        return {key: cache.column_values(part[key], info["features"][key]) for key in keys}
    except (ValueError, TypeError, pa.ArrowException) as error:
        fault = f"{path}: {error}"
        raise FormatError(fault, "columns as meta/info.json says", "pack the session again") from None
