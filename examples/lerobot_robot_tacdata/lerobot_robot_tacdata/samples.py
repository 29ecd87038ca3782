"""From the rows of a dataset to the samples at the boards' own rate.

    python -m lerobot_robot_tacdata.samples DATASET RECORDS

copies the recordings that a dataset's rows name into DATASET/tacdata, after checking that every row is among them.
"""

from __future__ import annotations

import argparse
import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata.errors import FormatError
from tacdata.recording.files import topics
from tacdata.recording.files.mcap_records import read_records
from tacdata.schemas import tacdata_pb2 as pb

STATE = "observation.state"


@dataclass(frozen=True)
class Samples:
    """Samples of a board in the time of an episode."""

    time_ns: np.ndarray
    """Times of the samples [ns since 1970], shape (m,)."""
    counts: np.ndarray
    """Readings [counts], shape (m, channels)."""
    rows: np.ndarray
    """Position among these samples of each row's own one, shape (rows,), int64."""


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
        path = records / f"touch-{identities[0]:08d}.mcap"
        if not path.is_file():
            raise FormatError(f"no recording {path}", "the folder that --robot.records named", "name that folder")
        messages = [pb.Taxels.FromString(m.data) for m in read_records(path).of_topic(topics.taxels(board))]
        rows = state[:, names.index(f"{board}.sample.count")].astype(int)
        if not len(rows) or rows.max() >= len(messages):
            raise FormatError(f"{path}: {len(messages)} samples", f"{rows.max(initial=-1) + 1}", "take the whole file")
        among = messages[rows[0] : rows[-1] + 1]
        found[board] = Samples(
            np.array([m.sample_ns for m in among]), np.array([list(m.counts) for m in among]), rows - rows[0]
        )
    return found


def _states(dataset: Path) -> tuple[list[str], pa.Table]:
    """Return the names of the states, and the states of all rows with their episodes."""
    info = json.loads((dataset / "meta" / "info.json").read_text())
    files = sorted(dataset.glob("data/*/*.parquet"))
    table = pa.concat_tables([pq.read_table(path, columns=["episode_index", STATE]) for path in files])
    return info["features"][STATE]["names"], table


def main() -> None:
    """Copy the recordings of a dataset into it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("records", type=Path)
    given = parser.parse_args()
    names, table = _states(given.dataset)
    columns = [k for k, name in enumerate(names) if name.endswith(".record.id")]
    wanted = {int(row[k]) for row in table[STATE].to_pylist() for k in columns}
    for episode in table["episode_index"].unique().to_pylist():
        for board, found in samples(given.dataset, episode, given.records).items():
            print(f"episode {episode}, {board}: {len(found.rows)} rows, {len(found.counts)} samples")
    target = given.dataset / "tacdata"
    target.mkdir(exist_ok=True)
    for identity in sorted(wanted):
        name = f"touch-{identity:08d}.mcap"
        if not (target / name).is_file():
            shutil.copy2(given.records / name, target / name)
    print(f"{len(wanted)} recordings in {target}")


if __name__ == "__main__":
    main()
