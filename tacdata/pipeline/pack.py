"""A session with its labels as a dataset."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tacdata.dataset.flags import Flag, carry_flags
from tacdata.dataset.format.features import asked_for
from tacdata.dataset.notes import carry_notes
from tacdata.dataset.pack import LabelFiles, Packed, refuse_existing
from tacdata.dataset.pack import pack as pack_episodes
from tacdata.dataset.reader import Dataset, read_dataset
from tacdata.paths import StrPath
from tacdata.recording.episode import Episode
from tacdata.recording.session import read_session
from tacdata.sensor import Sensor, read_sensor


@dataclass(frozen=True, repr=False)
class PackedSession(Packed):
    """The result of packing a session."""

    failures: dict[str, str]
    """Recording without a label -> the reason."""
    unfinished: tuple[str, ...]
    """Recordings that were interrupted, and left out."""
    flags: tuple[Flag, ...]
    """Episodes that a person set aside, and training leaves out."""
    notes: int
    """Notes on stretches that were copied."""

    @property
    def dataset(self) -> Dataset:
        """The dataset, opened."""
        return read_dataset(self.root)


def pack(
    session: StrPath,
    out: StrPath,
    *,
    labels: StrPath | None = None,
    append: bool = False,
    sensor: Sensor | StrPath | None = None,
    columns: Sequence[str] = (),
    model: str | None = None,
    progress: Callable[[Episode, str], None] = lambda episode, reason: None,
) -> PackedSession:
    """Write the labelled recordings of a session as a LeRobot v3 dataset.

    Args:
        session: The session folder.
        out: Folder of the dataset; must not exist, unless ``append``.
        labels: Folder of labels; None takes the session's.
        append: Add the episodes that the dataset does not hold.
        sensor: Sensor of the labels or its file, if not the recorded one.
        columns: Optional columns of the labels to add, such as "uncertainty".
        model: Content hash of the skin model that all labels must be made with.
        progress: Called after each episode with the reason for leaving it out, or "".

    Raises:
        UsageError: If ``out`` exists (without ``append``), or no episode can be packed.
        FormatError: If a label is of another recording, sensor or skin model.

    Example:
        >>> import tacdata as td
        >>> td.pack("session", "packed").dataset["observation.state"].shape
        (340, 24)
    """
    folder, root, extra = Path(session), Path(out), asked_for(list(columns))
    refuse_existing(root, append)
    recorded = read_session(folder)
    files = LabelFiles(Path(labels) if labels else recorded.labels)
    skin = sensor if sensor is None or isinstance(sensor, Sensor) else read_sensor(sensor)
    # Before the first episode is written: labels of two models must not share a dataset.
    files.check(recorded.episodes, skin, model)
    packed = pack_episodes(recorded, files, root, append=append, sensor=skin, model=model, extra=extra, done=progress)
    reasons = {name: files.failure(folder / name) for name, _ in packed.left_out}
    return PackedSession(
        packed.root,
        packed.episodes,
        packed.frames,
        packed.left_out,
        {name: reason for name, reason in reasons.items() if reason},
        tuple(path.name for path in recorded.unfinished),
        tuple(carry_flags(folder, root)),
        carry_notes(folder, root),
    )
