"""The tip's true path in every recorded episode by a model's kinematic effects; labels belong to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Tool
from tacdata.chain.state import State
from tacdata.discrepancy.data.recordings import places
from tacdata.effects import Placed
from tacdata.recording import Episode

BETWEEN = 0.02
"""Largest distance between points of a path [mm]."""


def moved_episodes(episodes: Sequence[Episode], placed: Sequence[Placed]) -> list[Episode]:
    """Return the episodes with the tip's path under the kinematic effects, in the order of their time.

    Effects with memory see the whole session with its turning points. Rows are the commanded profile's own points, and
    points between them, since the path under an effect need not be straight. Where readings come late the path is
    delayed with them, because a label is paired with a reading by its time.

    Args:
        episodes: The episodes of one session.
        placed: The model's effects; all but kinematic ones and a constant delay are ignored.
    """
    delay_ns = round(1e9 * sum(p.effect.delay(p.values) for p in placed))
    return [replace(e, tip_ns=e.tip_ns + delay_ns) for e in _placed_elsewhere(episodes, placed)]


def _placed_elsewhere(episodes: Sequence[Episode], placed: Sequence[Placed]) -> list[Episode]:
    ordered = [_dense(e) for e in sorted(episodes, key=lambda e: int(e.tip_ns[0]) if len(e.tip_ns) else 0)]
    kinematic = [p for p in placed if p.stage == "kinematics"]
    ready = [e for e in ordered if len(e.tip_ns) > 1]
    if not kinematic or not ready:
        return ordered
    course = _course(ready)
    empty = np.empty(0)
    state = State(course, None, course.tip, empty, empty, empty)  # ty: ignore[invalid-argument-type]
    # In the chain's order: first what moves the carriage with its tag.
    for effect in sorted(kinematic, key=lambda p: not p.seen_by_tag):
        state = effect.act(state)
    cut = np.cumsum([len(e.tip_ns) for e in ready])[:-1]
    paths = {id(e): path for e, path in zip(ready, np.split(state.pose, cut), strict=True)}
    return [replace(e, tip=paths[id(e)]) if id(e) in paths else e for e in ordered]


def _dense(episode: Episode) -> Episode:
    """Return an episode whose path has no points farther apart than `BETWEEN`."""
    if len(episode.tip_ns) < 2:
        return episode
    way = np.linalg.norm(np.diff(episode.tip, axis=0), axis=1)
    count = np.maximum(np.ceil(way / BETWEEN), 1).astype(int)
    first = np.repeat(np.arange(len(count)), count)
    # Evenly between two points of the path.
    share = (np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)) / count[first]
    gap = np.diff(episode.tip_ns)
    time = np.append(episode.tip_ns[first] + np.round(share * gap[first]).astype(np.int64), episode.tip_ns[-1])
    # Rounded to nanoseconds, two points may coincide.
    time = np.unique(time)
    return replace(episode, tip_ns=time, tip=episode.tip_at(time))


def _course(episodes: Sequence[Episode]) -> Course:
    count = [len(e.tip_ns) for e in episodes]
    origin = int(episodes[0].tip_ns[0])
    tools = tuple(
        dict.fromkeys(
            Tool(e.press.indenter_name, e.press.indenter.shape, float(getattr(e.press.indenter, "radius", np.nan)))
            for e in episodes
        )
    )
    number = [[t.name for t in tools].index(e.press.indenter_name) for e in episodes]
    episode = np.repeat(np.arange(len(episodes)), count)
    at = np.array([e.tip[np.argmax(e.tip[:, 2]), :2] for e in episodes])
    return Course(
        time=np.concatenate([(e.tip_ns - origin) * 1e-9 for e in episodes]),
        episode=episode,
        tip=np.concatenate([e.tip for e in episodes]),
        tool=np.array(number)[episode],
        readings=np.zeros((sum(count), 0)),
        averaged=np.ones(sum(count)),
        session=np.zeros(len(episodes), dtype=np.int64),
        site=places(at),
        tools=tools,
        names=tuple(e.path.stem for e in episodes),
    )
