"""Channels by the recording's own numbers and the source's names; those that are clipped, those that only look so."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import yaml
from pressing import course

from tacdata import documents
from tacdata.discrepancy.data.channels import Readings, in_source, usable
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.data.sufficiency import stuck
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.run import run
from tacdata.importing.imported_session import import_session
from tacdata.recording.files.reader import Recording


def unknown(counts):
    """Return readings of which nobody knows the depth."""
    return Readings(counts, np.full(len(counts), np.nan))


def test_a_channel_that_is_dead_at_another_reading_each_day_is_left_out_and_named():
    rng = np.random.default_rng(0)
    days = [np.column_stack([rng.normal(size=50), np.full(50, 5.0 + day), rng.normal(size=50)]) for day in (0, 1)]
    kept, _, notes = usable([unknown(day) for day in days])
    assert kept.tolist() == [0, 2]
    assert len(notes) == 1 and "channel 1" in notes[0] and "left out" in notes[0]


def pressed(read, depths=(1.0, 1.6, 2.0, 2.0, 1.3), rates=(0.5, 3.0), noise=0.0, step=1.0, hold=1.0):
    """Return presses whose channel reads a function of time's depth and of the depth a while ago."""
    rng, made = np.random.default_rng(1), []
    for k, deepest in enumerate(depths):
        way = (deepest + 0.5) / rates[k % len(rates)]
        at = np.cumsum([0, 0.5, way, hold, way, 0.5])
        time = np.arange(0, at[-1], 1 / 60)
        depth = np.interp(time, at, [-0.5, -0.5, deepest, deepest, -0.5, -0.5])
        late = np.interp(time - 0.08, at, [-0.5, -0.5, deepest, deepest, -0.5, -0.5])
        play = depth.copy()
        for i in range(1, len(play)):
            play[i] = min(max(depth[i], play[i - 1]), depth[i] + 0.06)
        values = read(depth, late, play) + noise * rng.normal(size=len(time))
        own = depth + 5e-4 * rng.normal(size=len(time))
        made.append(Readings(np.round(values / step)[:, None] * step, own))
    return made


def force(depth):
    """Return what a press of a depth [mm] adds."""
    return 1000 * np.maximum(depth, 0) ** 1.5


@pytest.mark.parametrize("noise", [0.0, 0.5, 20.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_channels_that_stop_while_the_tip_goes_on_are_told_of_whatever_share_stops(noise, sign):
    """At 2500 of 2828 a fiftieth of the readings stop; a twentieth was asked for before."""
    made = pressed(lambda depth, late, play: force(depth), noise=noise, hold=0.1)
    made = [Readings(sign * np.minimum(np.column_stack([r.counts, r.counts / 3]), 2500), r.depth) for r in made]
    assert np.mean(np.concatenate([r.counts[:, 0] for r in made]) == sign * 2500) < 0.05
    _, (least, most), notes = usable(made)
    [words] = [note for note in notes if "clipped" in note]
    assert (most[0] if sign > 0 else least[0]) == sign * 2500
    assert np.isinf(least if sign > 0 else most).all() and np.isinf([least[1], most[1]]).all()
    assert "channel 0 at" in words and "channel 1" not in words
    assert ("largest" if sign > 0 else "smallest") in words


@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("step", [1.0, 20.0])
@pytest.mark.parametrize(
    "read",
    [
        lambda depth, late, play: force(depth),
        lambda depth, late, play: -force(depth),
        lambda depth, late, play: force(late),
        lambda depth, late, play: force(play),
        lambda depth, late, play: 3000 * np.tanh(force(depth) / 1500),
        lambda depth, late, play: 300 * np.maximum(depth - 1.5, 0),
        lambda depth, late, play: 800 * (np.maximum(depth, 0) - 1.4) ** 2,
    ],
    ids=["rises", "falls", "late", "play", "saturates", "late contact", "turns around"],
)
def test_steps_holds_play_and_soft_ends_are_no_clipping(read, step, noise):
    """Without noise all of a hold reads the largest count, and all of the air the smallest."""
    for hold in (0.0, 2.0):
        _, _, notes = usable(pressed(read, noise=noise, step=step, hold=hold))
        assert notes == []


def test_the_sources_names_are_told_where_they_say_more_than_a_number():
    def boards(*names):
        return [cast(Recording, SimpleNamespace(board={"names": list(own)})) for own in names]

    assert in_source(boards(("ch0", "ch1", "ch2")), 3) == [] == in_source(boards(()), 3)
    assert in_source(boards(("ch1", "ch2", "ch3")), 3) == ["channels 0 to 2 are the source's ch1 to ch3, in this order"]
    [words] = in_source(boards(("left", "tip", "time"), ("left", "tip", "time")), 3)
    assert "0 left, 1 tip" in words
    assert in_source(boards(("a", "b"), ("b", "a")), 2) == [], "of two sources neither speaks for both"


def test_a_channel_that_sticks_is_told_of_by_its_own_number():
    made = course(episodes=12)
    readings = np.column_stack([made.readings, made.readings[:, :1]])
    readings[made.episode % 2 == 0, 3] = 77.0
    [words] = stuck(replace(made, readings=readings, numbers=(0, 1, 3, 6)))
    assert words.startswith("channel 6: the same reading")


def test_clipped_readings_count_as_not_read_and_those_beside_them_do():
    made = course(episodes=12)
    clipped = np.zeros(made.readings.shape, dtype=bool)
    clipped[100:110, 1] = True
    read = Streams.of(made).measured(replace(made, clipped=clipped))
    assert np.array_equal(np.isnan(read), clipped[made.read])


MAPPING = {
    "version": "1.0",
    "name": "bench",
    "sensor": {"name": "pads"},
    "indenter": {"shape": "sphere", "radius": 3.0},
    "files": {"log": {"path": "press_{trial}.csv", "time": {"column": "t", "unit": "s", "zero": "shared"}}},
    "taxels": {"file": "log", "columns": ["p*"], "unit": "pF"},
    "position": {"file": "log", "depth": {"column": "depth", "unit": "mm"}},
}


def test_a_verdict_speaks_of_channels_by_the_columns_of_the_file(tmp_path):
    """The second of five is dead; the fourth stops at times; the fifth, numbered 3 of those that are left, is loud."""
    rng = np.random.default_rng(0)
    for k in range(10):
        at = np.cumsum([0, 1.0, (0.6, 1.8)[k % 2], 1.2, (0.6, 1.8)[k % 2], 1.0])
        time = np.arange(0, at[-1], 0.04)
        depth = np.interp(time, at, [-0.3, -0.3, 1.0, 1.0, -0.3, -0.3])
        load = np.maximum(depth, 0) ** 1.5
        values = 50 + load[:, None] * np.array([10, 0, 20, 15, 30]) + 0.05 * rng.normal(size=(len(time), 5))
        values[:, 1] = 40.0
        values[:, 4] += 2 * np.maximum(np.interp(time - 0.3, time, load), 0) * (k + 1)
        if k % 3 == 0:
            values[:, 3] = 50.0
        lines = ["t,depth,p0,p1,p2,p3,p4"]
        lines += [
            f"{20 * k + t:.3f},{d:.5f}," + ",".join(f"{v:.4f}" for v in row)
            for t, d, row in zip(time, depth, values, strict=True)
        ]
        (tmp_path / f"press_{k}.csv").write_text("\n".join(lines))
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    session = import_session(tmp_path, tmp_path / "mapping.yaml", tmp_path / "session").folder
    run([session], read_spec(None), tmp_path / "verdict", until="locate")
    answer = documents.read(tmp_path / "verdict" / "verdict.json", "verdict")
    told = json.dumps(answer["remarks"])
    assert "channel 1: always" in told and "channel 3: the same reading" in told and "channel 2" not in told
    assert answer["data"]["channel_numbers"] == [0, 2, 3, 4]
    assert [s["name"] for s in answer["slices"] if s["by"] == "stream"] == [f"channel {k}" for k in (0, 2, 3, 4)]
