"""Packs recordings and labels into a dataset."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tacdata import documents, provenance
from tacdata.dataset import frames
from tacdata.dataset.format import features, folder, metadata
from tacdata.dataset.writer import DatasetWriter
from tacdata.display import Displayed
from tacdata.errors import FormatError, UsageError
from tacdata.labels import Label, file_names, read_label, table
from tacdata.recording.episode import Episode
from tacdata.sensor import Sensor


@dataclass(frozen=True, repr=False)
class Packed(Displayed):
    """The result of packing."""

    root: Path
    """The dataset."""
    episodes: int
    """Episodes written."""
    frames: int
    """Frames written."""
    left_out: tuple[tuple[str, str], ...]
    """Recording and the reason why it was left out, in words."""

    def __fspath__(self) -> str:
        """Return the dataset's folder."""
        return str(self.root)

    def description(self) -> Iterator[str]:
        """Yield episodes and frames, and the first recording that was left out."""
        yield f"Packed: {self.episodes} episodes, {self.frames} frames in {self.root}"
        for name, reason in self.left_out[:1]:
            yield f"{len(self.left_out)} recordings left out; the first, {name}: {reason.splitlines()[0]}"


def pack(
    episodes: Iterable[Episode],
    label_of: Callable[[Episode], Label | None],
    target: Path,
    *,
    append: bool = False,
    sensor: Sensor | None = None,
    model: str | None = None,
    extra: Sequence[str] = (),
    done: Callable[[Episode, str], None] = lambda episode, reason: None,
) -> Packed:
    """Write the labelled episodes as a dataset, one by one; an interruption keeps finished ones.

    An episode without a label, without a frame to tare with, or with readings that are no numbers is left
    out and named; so is, when appending, one that the dataset holds already.

    Args:
        episodes: Recordings; read one at a time.
        label_of: Gives an episode's label, or None if it has none.
        target: Folder of the dataset.
        append: Add to the dataset if it exists.
        sensor: The sensor that the labels must be made for; None takes each recording's own.
        model: Content hash of the skin model that all labels must be made with; None takes the first label's.
        extra: Optional columns of the labels (`features.EXTRA`) that the dataset is to have.
        done: Called after each episode with the reason for leaving it out, or "".

    Raises:
        UsageError: If ``target`` exists (without ``append``), or no episode can be packed.
        FormatError: If a label is of another recording, sensor or skin model.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.dataset import pack
        >>> from tacdata.labels import read_label
        >>> from tacdata.recording import read_episode, read_session
        >>> labels = Path("session/labels")
        >>> packed = pack(
        ...     [read_episode(path) for path in read_session(Path("session")).episodes],
        ...     lambda episode: read_label(labels / f"episode-{episode.number:06d}.parquet"),
        ...     Path("my dataset"),
        ... )
        >>> packed.episodes
        2
    """
    refuse_existing(target, append)
    writer: DatasetWriter | None = None
    left_out: list[tuple[str, str]] = []
    count = total = 0
    for episode in episodes:
        reason = ""
        label = label_of(episode)
        if label is None:
            reason = "it has no label"
        else:
            recording, skin = frames.recording_hash(episode), sensor or episode.sensor
            # The first label decides for all: a network must not learn from two models.
            model = model or label.provenance["parents"].get("model")
            frames.check_pair(episode, label, {"recording": recording, "sensor": skin.content_hash, "model": model})
            if writer is None or writer.sensor != skin:
                # The folder may have been made in this call, by the writer of another sensor.
                again = target.exists() and (append or writer is not None)
                writer = (DatasetWriter.open if again else DatasetWriter.create)(target, skin, extra)
            reason = append_episode(writer, episode, label, recording)
        if reason:
            left_out.append((episode.path.name, reason))
        else:
            count, total = count + 1, total + len(episode.taxels.sample_ns)
        done(episode, reason)
    if not count and not append:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in left_out[:3])
        raise UsageError(
            f"no episode can be packed ({reasons or 'there are none'})",
            "at least one recorded and labelled episode",
            "run `tacdata label` first",
        )
    return Packed(target, count, total, tuple(left_out))


def append_episode(writer: DatasetWriter, episode: Episode, label: Label, recording: str) -> str:
    """Append an episode; return the reason if that is refused, else ""."""
    if recording in writer.recordings:
        return "the dataset holds it already"
    try:
        record = frames.episode_record(episode, label, recording, writer.sensor)
        task = f"press the skin with {episode.press.indenter_name}"
        extra = features.extra_of(writer.info["features"])
        writer.append(frames.episode_columns(episode, label, extra), record, task)
    except FormatError as error:
        return error.given
    return ""


def refuse_existing(target: Path, append: bool) -> None:
    """Refuse a folder that is there already.

    Raises:
        UsageError: If ``target`` exists and is not to be appended to.
    """
    if target.exists() and not append:
        if (target / metadata.MAIN).exists() and not (target / folder.INFO).exists():
            raise UsageError(
                f"{target} holds a first episode that was never finished, and nothing else",
                "a folder that does not exist yet",
                "give --append: the unfinished episode is replaced",
            )
        raise UsageError(
            f"{target} exists", "a folder that does not exist yet", "name another folder, or give --append to add to it"
        )


class LabelFiles:
    """A session's folder of labels, to be read."""

    def __init__(self, folder: Path) -> None:
        """Name the folder.

        Raises:
            UsageError: If there is none.
        """
        if not folder.is_dir():
            raise UsageError(
                f"no folder {folder}", "the folder that `tacdata label` wrote", "run `tacdata label` first"
            )
        self.folder = folder

    def path(self, recording: Path) -> Path:
        """Return the path of a recording's label, existing or not."""
        return file_names.label(self.folder, recording)

    def __call__(self, episode: Episode) -> Label | None:
        """Return an episode's label, or None if it has none."""
        path = self.path(episode.path)
        return read_label(path) if path.is_file() else None

    def failure(self, recording: Path) -> str:
        """Return the reason why the recording has no label; "" if unknown."""
        path = file_names.failure(self.folder, recording)
        return documents.read(path, "label_failure")["reason"] if path.is_file() else ""

    def check(self, recordings: Iterable[Path], sensor: Sensor | None = None, model: str | None = None) -> None:
        """Refuse mixed labels before anything is written, from the files' headers alone.

        Raises:
            FormatError: If a label is damaged, or of another recording, sensor or skin model than wanted; if
                none is wanted, than the first label.
        """
        expected = {"sensor": sensor.content_hash if sensor else None, "model": model}
        for recording in recordings:
            path = self.path(recording)
            if not path.is_file():
                continue
            parents = table.read_header(path)["provenance"]["parents"]
            of_this = {**expected, "recording": provenance.file_hash(recording)}
            for name, digest in of_this.items():
                if digest and parents.get(name) != digest:
                    raise FormatError(
                        f"{path} is made for {name} {parents.get(name, 'unknown')[:12]}",
                        f"{name} {digest[:12]}" + ("" if name == "recording" else ", as asked for or as the others"),
                        "run `tacdata label` for this session again",
                    )
            expected = {name: digest or parents.get(name) for name, digest in expected.items()}
