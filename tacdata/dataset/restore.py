"""Restores sensors and records of a dataset that lerobot edited."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from tacdata.dataset import cache
from tacdata.dataset.format import features, folder, metadata
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.errors import FormatError, UsageError


def restore(root: Path | str, sources: Path | str | Iterable[Path | str]) -> list[int]:
    """Write meta/tacdata.json and the records of a dataset that lerobot deleted from, split or merged.

    Frames carry the hashes of their sensor and record, so only their own metadata is taken from the
    sources.

    Args:
        root: The edited dataset.
        sources: Datasets that it was made from, or the only one.

    Returns:
        Numbers of the episodes whose record was not found.

    Raises:
        UsageError: If a source does not exist.
        FormatError: If no source describes the sensor of some frames.
    """
    root = Path(root)
    origins = [sources] if isinstance(sources, str | Path) else list(sources)
    for source in map(Path, origins):
        if not source.is_dir():
            raise UsageError(f"no folder {source}", "datasets that this one was made from", "check the path")
    info = folder.read_info(root)
    rows = folder.read_rows(root, info)
    short_hashes: set[int] = set()
    keys: list[int] = []
    for path in cache.data_files(root, rows):
        table = folder.read_parquet(path, [features.SENSOR, features.RECORD])
        short_hashes.update(np.unique(table[features.SENSOR].to_numpy()).tolist())
        # Episodes may share a data file; all frames of one have the same key.
        keys.extend(dict.fromkeys(table[features.RECORD].to_pylist()))
    sensors: dict[str, dict] = {}
    records: dict[int, EpisodeRecord] = metadata.read_records(root)
    present = set(records)
    # A source states the true rate; LeRobot's is rounded.
    rate = float(info["fps"])
    for source in (root, *map(Path, origins)):
        main = metadata.read_main(source)
        if main is None:
            continue
        rate = main["rate"]
        sensors |= {k: v for k, v in main["sensors"].items() if features.short_hash(k) in short_hashes}
        # Records of the dataset itself take precedence over a source's.
        records = {**metadata.read_records(source), **records}
    lacking = short_hashes - {features.short_hash(k) for k in sensors}
    if lacking:
        raise FormatError(
            f"{root}: no source describes the sensor {min(lacking):015x}",
            "the datasets that it was made from",
            "name them all: tacdata dataset restore DATASET SOURCE SOURCE ...",
        )
    metadata.write_main(root, sensors, rate)
    for key in keys:
        if key in records and key not in present:
            metadata.append_record(root, records[key])
    return [number for number, key in enumerate(keys) if key not in records]
