"""Readings measured and predicted, before and after a revision, as a Rerun file."""

from collections.abc import Sequence
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from tacdata.viewers.output_file import RERUN, new_file, written_beside
from tacdata.viewers.scene.color_scale import HUES
from tacdata.viewers.scene.episode_curves import EpisodeCurves

TIMELINE = "time_in_episode"
COLORS = {"measured": (30, 30, 30), "before": HUES[5], "after": HUES[0]}


def write(episodes: Sequence[EpisodeCurves], path: Path, title: str) -> None:
    """Write episodes, one view each of its telling channel and of its depth.

    Args:
        episodes: Episodes to show.
        path: File to write (.rrd).
        title: Its name.

    Raises:
        UsageError: If the file exists or does not end in .rrd.
    """
    path = new_file(path, RERUN)
    views = []
    for k, episode in enumerate(episodes):
        root = f"episode_{k}"
        views.append(rrb.TimeSeriesView(origin=f"{root}/reading", name=f"{episode.name}, {episode.channel_name}"))
        views.append(rrb.TimeSeriesView(origin=f"{root}/depth", name=f"{episode.name}, depth [mm]"))
    blueprint = rrb.Blueprint(rrb.Grid(*views, grid_columns=2), collapse_panels=True)
    with written_beside(path) as temporary:
        recording = rr.RecordingStream("tacdata")
        recording.save(temporary, default_blueprint=blueprint)
        recording.send_recording_name(title)
        for k, episode in enumerate(episodes):
            _episode(recording, f"episode_{k}", episode)
        recording.flush()
        recording.disconnect()


def _episode(recording: rr.RecordingStream, root: str, episode: EpisodeCurves) -> None:
    index = [rr.TimeColumn(TIMELINE, duration=episode.time)]
    curves = {name: getattr(episode, name)[:, episode.channel] for name in COLORS}
    for name, values in curves.items():
        entity = f"{root}/reading/{name}"
        recording.log(entity, rr.SeriesLines(colors=[COLORS[name]], names=[name], widths=[1.5]), static=True)
        recording.send_columns(entity, index, columns=rr.Scalars.columns(scalars=values))
    entity = f"{root}/depth/commanded"
    recording.log(entity, rr.SeriesLines(colors=[HUES[2]], names=["depth [mm]"]), static=True)
    recording.send_columns(entity, index, columns=rr.Scalars.columns(scalars=episode.depth))
