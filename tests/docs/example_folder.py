"""The folder in which examples of docstrings run: what a user has after a first session."""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "label_farm"))

import session_examples

from tacdata import provenance
from tacdata.dataset import frames, pack
from tacdata.labels import Label, write_label
from tacdata.recording import read_episode, read_session

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def fill(folder):
    """Put a session with labels, its dataset, another lab's files and the shipped examples into a folder."""
    (folder / "examples").symlink_to(EXAMPLES)
    foreign(folder / "source")
    session = read_session(session_examples.session(folder / "session", 2))
    episodes = [read_episode(path) for path in session.episodes]
    labels = {episode.number: dent(episode) for episode in episodes}
    (folder / "session" / "labels").mkdir()
    for number, label in labels.items():
        write_label(folder / "session" / "labels" / f"episode-{number:06d}.parquet", label)
    pack(episodes, lambda episode: labels[episode.number], folder / "dataset")


def dent(episode):
    """Return a label by geometry alone: the ball's own shape, as deep as it was pressed; pressure like depth."""
    times, count = episode.taxels.sample_ns, len(episode.taxels.sample_ns)
    tip, grid = episode.tip_at(times), episode.sensor.map
    aside = np.hypot(*np.meshgrid(grid.x - episode.press.x, grid.y - episode.press.y, indexing="ij"))
    below = np.maximum(tip[:, 2], 0.0)[:, None, None] - episode.press.indenter.profile(aside, 0 * aside)
    signed = np.maximum(below, 0.0).astype(np.float32)
    taxels, zero = (count, episode.sensor.taxels.count), np.zeros(count, np.float32)
    parents = {"sensor": episode.sensor.content_hash, "recording": frames.recording_hash(episode), "model": "0" * 64}
    return Label(
        episode=episode.number,
        time_ns=times,
        tip=tip,
        signed=signed,
        error=zero,
        force_error=zero,
        taxel_force=np.zeros(taxels, np.float32),
        taxel_closure=np.zeros(taxels, np.float32),
        taxel_area=np.zeros(taxels, np.float32),
        force=np.zeros((count, 3), np.float32),
        error_map=np.zeros(signed.shape, np.float16),
        traction=np.float16(0.1 * signed[:, None] * np.array([0.2, 0.0, 1.0])[:, None, None]),
        provenance=provenance.stamp("example", parents, {}),
    )


def foreign(folder):
    """Write three presses as `examples/import_foreign.yaml` describes them: a logger and a stage with its own clock."""
    for number in range(3):
        (folder / f"press_{number}").mkdir(parents=True)
        time, stage = np.arange(0, 8, 0.02), np.arange(0, 8, 0.05)
        depth, height = (np.interp(t, [2, 4, 6, 8], [-1.0, 1.2, 1.2, -1.0]) for t in (time, stage))
        lines = ["Zeit;Kraft [g];Pad 1;Pad 2;Pad 3;Pad 4"]
        for t, d in zip(time, np.maximum(depth, 0.0), strict=True):
            lines.append(";".join(f"{value:.3f}".replace(".", ",") for value in (1000 * t, 50 * d, *[10 + d] * 4)))
        (folder / f"press_{number}" / "logger.csv").write_text("\n".join(lines))
        rows = [f"{t - 2.5:.3f} 40.0 25.0 {1000 * (12.0 - d):.1f}" for t, d in zip(stage, height, strict=True)]
        (folder / f"press_{number}" / "stage.txt").write_text("\n".join(rows))
