"""From the rows of a dataset to the samples at the boards' own rate.

    python -m lerobot_robot_tacdata.samples DATASET RECORDS

checks that every row is among the samples, copies the recordings that the rows name into DATASET/tacdata, and writes
unit, frame and place of each channel into DATASET/meta/info.json, where lerobot's own tools keep them.
"""

from __future__ import annotations

import argparse
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.recording.check.channel_health import frozen_channels, reading_limits
from tacdata.recording.files import topics
from tacdata.recording.files.mcap_records import read_records
from tacdata.schemas import tacdata_pb2 as pb
from tacdata.sensor import Sensor

STATE, INFO = "observation.state", Path("meta/info.json")


@dataclass(frozen=True)
class Samples:
    """Samples of a board in the time of an episode."""

    time_ns: np.ndarray
    """Times of the samples [ns since 1970], shape (m,)."""
    counts: np.ndarray
    """Readings [counts], shape (m, channels)."""
    rows: np.ndarray
    """Position among these samples of each row's own one, shape (rows,), int64."""
    valid: np.ndarray
    """Whether a channel is neither stuck nor saturated in this time, shape (channels,), bool."""


def samples(dataset: str | Path, episode: int, records: str | Path) -> dict[str, Samples]:
    """Return the samples of each board between the first and last row of an episode.

    Args:
        dataset: Folder of the dataset, edited or not.
        episode: Number of the episode.
        records: Folder of the recordings.

    Raises:
        FormatError: If the rows name a recording that is not there, or a sample that it does not have.
    """
    dataset, records = Path(dataset), Path(records)
    names, table = _states(dataset)
    state = np.array(table[STATE].to_pylist())[table["episode_index"].to_numpy() == episode].reshape(-1, len(names))
    found = {}
    for board in [name.removesuffix(".record.id") for name in names if name.endswith(".record.id")]:
        identities = np.unique(state[:, names.index(f"{board}.record.id")].astype(int))
        if len(identities) != 1:
            raise FormatError(
                f"{dataset}: rows of episode {episode} in {len(identities)} recordings", "one", "check it"
            )
        path = _recording(records, identities[0])
        recording = read_records(path)
        messages = [pb.Taxels.FromString(m.data) for m in recording.of_topic(topics.taxels(board))]
        rows = state[:, names.index(f"{board}.sample.count")].astype(int)
        if not len(rows) or rows.max() >= len(messages):
            raise FormatError(f"{path}: {len(messages)} samples", f"{rows.max(initial=-1) + 1}", "take the whole file")
        among = messages[rows[0] : rows[-1] + 1]
        times, counts = np.array([m.sample_ns for m in among]), np.array([list(m.counts) for m in among])
        document = json.loads(recording.attachments["boards.json"].data)[board]
        found[board] = Samples(times, counts, rows - rows[0], _valid(counts, document))
    return found


def channels(dataset: str | Path, records: str | Path) -> dict[str, dict[str, Any]]:
    """Return unit, frame and place on the skin [mm] of each taxel channel of a dataset's state.

    Args:
        dataset: Folder of the dataset.
        records: Folder of the recordings.

    Raises:
        FormatError: If a recording is missing, or if two of them have boards on different skins.
    """
    names, table = _states(Path(dataset))
    found: dict[str, dict[str, Any]] = {}
    for identity in sorted(_identities(names, table)):
        path = _recording(Path(records), identity)
        recording = read_records(path)
        boards, skins = (json.loads(recording.attachments[f"{key}.json"].data) for key in ("boards", "sensors"))
        for board, document in boards.items():
            places = Sensor.from_document(skins[board], str(path)).taxels.centers.tolist()
            for name, place in zip([n for n in names if n.startswith(f"{board}.taxel_")], places, strict=False):
                entry = {"unit": document["unit"], "frame": f"skin of {board}", "place_mm": place}
                if found.setdefault(name, entry) != entry:
                    raise FormatError(f"{path}: {name} is not where it is in another recording", "one skin", "split it")
    return found


def _valid(counts: np.ndarray, board: dict[str, Any]) -> np.ndarray:
    noise = np.diff(counts, axis=0).std(axis=0) / np.sqrt(2) if len(counts) > 1 else np.zeros(counts.shape[1])
    stuck, saturated = frozen_channels(counts, noise, reading_limits(board))
    return ~np.isin(np.arange(counts.shape[1]), [*stuck, *saturated])


def _recording(records: Path, identity: int) -> Path:
    path = records / f"touch-{identity:08d}.mcap"
    if not path.is_file():
        raise FormatError(f"no recording {path}", "the folder that --robot.records named", "name that folder")
    return path


def _identities(names: list[str], table: pa.Table) -> set[int]:
    columns = [k for k, name in enumerate(names) if name.endswith(".record.id")]
    return {int(row[k]) for row in table[STATE].to_pylist() for k in columns}


def _states(dataset: Path) -> tuple[list[str], pa.Table]:
    """Return the names of the states, and the states of all rows with their episodes."""
    info = json.loads((dataset / INFO).read_text())
    files = sorted(dataset.glob("data/*/*.parquet"))
    table = pa.concat_tables([pq.read_table(path, columns=["episode_index", STATE]) for path in files])
    return info["features"][STATE]["names"], table


def main() -> None:
    """Copy the recordings of a dataset into it, and describe its channels."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("records", type=Path)
    given = parser.parse_args()
    names, table = _states(given.dataset)
    for episode in table["episode_index"].unique().to_pylist():
        for board, found in samples(given.dataset, episode, given.records).items():
            broken = np.flatnonzero(~found.valid).tolist()
            note = f"; stuck or saturated: channels {broken}" if broken else ""
            print(f"episode {episode}, {board}: {len(found.rows)} rows, {len(found.counts)} samples{note}")
    target = given.dataset / "tacdata"
    target.mkdir(exist_ok=True)
    identities = sorted(_identities(names, table))
    for identity in identities:
        source = _recording(given.records, identity)
        if not (target / source.name).is_file():
            shutil.copy2(source, target / source.name)
    info = json.loads((given.dataset / INFO).read_text())
    info["features"][STATE]["info"] = {"channels": channels(given.dataset, given.records)}
    documents.write_text(given.dataset / INFO, json.dumps(info, indent=4))
    print(f"{len(identities)} recordings in {target}")


if __name__ == "__main__":
    main()
