"""What a camera or a gauge saw of the tip is laid onto the path, and keeps what the guide did wrong."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tacdata.discrepancy.data.tip_observation import second_views
from tacdata.recording import Episode


def episode(number, turn, shift=0.0, gauge=None, sites=((0, 0), (3, 1), (-2, 2))):
    rng = np.random.default_rng(number)
    time = np.arange(0, 4, 0.05)
    depth = np.interp(time, [0, 1, 2, 3, 4], [-1, 1, 1, -1, -1])
    x, y = sites[number % len(sites)]
    tip = np.column_stack([np.full(80, x), np.full(80, y), depth]).astype(float)
    true = tip + np.array([0, 0, shift])
    seen = (true * [1, 1, -1]) @ turn.T + [10, -40, 300] + 0.01 * rng.normal(size=(80, 3))
    ns = (time * 1e9).astype(np.int64)
    tags = SimpleNamespace(sample_ns=ns, position=seen / 1e3, faces=np.ones(80, int), ambiguous=None)
    stream = SimpleNamespace(name="displacement", unit="mm", sample_ns=ns, values=5 - 1.0 * true[:, 2:3])
    return SimpleNamespace(
        tags=() if gauge else (tags,),
        measured=(stream,) if gauge else (),
        tip=tip,
        tip_at=lambda at: np.stack([np.interp(at, ns, tip[:, k]) for k in range(3)], axis=-1),
        ns=ns,
    )


@pytest.mark.parametrize("gauge", [False, True])
def test_a_step_of_the_guide_stays_in_what_was_seen(gauge):
    turn = Rotation.from_euler("xyz", [170, 20, 35], degrees=True).as_matrix()
    episodes = [episode(k, turn, shift=0.0 if k < 6 else -0.2, gauge=gauge) for k in range(12)]
    views = second_views(cast(list[Episode], episodes))
    off = [np.nanmean(views[k].at(e.ns)[:, 2] - e.tip[:, 2]) for k, e in enumerate(episodes)]
    assert np.mean(off[:6]) - np.mean(off[6:]) == pytest.approx(0.2, abs=0.03)
    assert np.isnan(views[0].at(episodes[0].ns)[:, 0]).all() == gauge


def test_readings_far_from_any_view_have_none():
    turn = np.eye(3)
    views = second_views(cast(list[Episode], [episode(k, turn) for k in range(3)]))
    at = views[0].at(np.array([1_000_000_000, 9_000_000_000]))
    assert np.isfinite(at[0]).all()
    assert np.isnan(at[1]).all()


def test_few_views_tell_nothing():
    assert second_views(cast(list[Episode], [SimpleNamespace(tags=(), measured=())])) == {}
