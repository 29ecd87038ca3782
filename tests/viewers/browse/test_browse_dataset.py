"""A dataset as a list: what is listed, flagged and shown of one episode is what the whole dataset says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tacdata.commands import browse
from tacdata.dataset.flags import flagged_episodes
from tacdata.dataset.format import features
from tacdata.dataset.frames import recording_hash
from tacdata.dataset.pack import pack
from tacdata.dataset.reader import read_dataset
from tacdata.errors import UsageError
from tacdata.training.frames.data import frames_of
from tacdata.training.inference.prediction import write_prediction
from tacdata.viewers.browse.list_sources import episodes_at
from tacdata.viewers.parts.prediction_files import first_predicted
from tacdata.viewers.scenes import single_episode
from tacdata.viewers.source import scene_at

APART = 10**11
DEPTHS = (0.4, 1.1, 0.7)


@pytest.fixture(scope="module")
def dataset(episode, label, prediction, tmp_path_factory):
    """Three presses that differ in depth and time, and a network that is wrong by 0.01, 0.03 and 0.02 mm."""
    folder = tmp_path_factory.mktemp("browsed") / "set"

    def at(number):
        shift, taxels = number * APART, episode.taxels
        return replace(
            episode,
            path=Path(f"nowhere/episode-{number:06d}.mcap"),
            press=replace(episode.press, index=number, depth=DEPTHS[number]),
            taxels=replace(taxels, sample_ns=taxels.sample_ns + shift, arrival_ns=taxels.arrival_ns + shift),
            tip_ns=episode.tip_ns + shift,
            phases=tuple(replace(p, start_ns=p.start_ns + shift, end_ns=p.end_ns + shift) for p in episode.phases),
        )

    def label_of(own):
        parents = {**label.provenance["parents"], "recording": recording_hash(own)}
        made = {**label.provenance, "parents": parents}
        return replace(label, episode=own.number, time_ns=own.taxels.sample_ns, provenance=made)

    pack([at(number) for number in range(3)], label_of, folder)
    for number, off in enumerate((0.01, 0.03, 0.02)):
        time = label.time_ns + number * APART
        own = replace(prediction, episode=number, time_ns=time, depth=np.maximum(label.signed, 0) + np.float32(off))
        write_prediction(folder.parent / "run" / "predictions" / f"episode-{number:06d}.parquet", own)
    return folder


def test_the_list_says_what_was_pressed_without_decoding_anything(dataset, monkeypatch):
    monkeypatch.setattr("tacdata.dataset.cache.open_columns", lambda *_: pytest.fail("the whole dataset was decoded"))
    listed = episodes_at(dataset)
    assert [e.depth for e in listed.entries] == list(DEPTHS)
    assert {(e.indenter, e.label, e.rate) for e in listed.entries} == {("ball", "complete", 1.5)}
    assert scene_at(dataset, episode=1).title == "set/episode 1", "one episode is shown without the others"


def test_errors_rank_episodes(dataset):
    worst = episodes_at(dataset, predictions=dataset.parent / "run").by("error").entries
    assert [e.number for e in worst] == [1, 2, 0]
    assert [e.error for e in worst] == pytest.approx([0.03, 0.02, 0.01], rel=1e-4)


def test_a_single_episode_is_the_same_as_in_the_whole(dataset):
    whole = read_dataset(dataset)
    one, count = single_episode.read_single(dataset, 2)
    entry = whole.episodes[2]
    assert count == 3 and one.episodes[0].record == entry.record
    for key in (features.TIME, features.DEPTH, features.STATE, features.PHASE):
        assert np.array_equal(one[key], whole[key][entry.start : entry.stop])
    with pytest.raises(UsageError, match="0 to 2"):
        scene_at(dataset, episode=3)


def test_the_verb_lists_flags_and_takes_back(dataset, capsys):
    browse.run(dataset, where=["depth>0.5"], sort="-depth")
    said = capsys.readouterr().out
    assert said.index("1.1") < said.index("0.7") and "0.4" not in said and "--episode 1" in said
    browse.run(dataset, flag=1, reason="slipped")
    assert flagged_episodes(read_dataset(dataset)) == {1: "slipped"}
    frames = frames_of(read_dataset(dataset))
    learned = [bool(frames.valid[e.start : e.stop].any()) for e in frames.episodes]
    assert learned == [True, False, True], "training leaves it out"
    browse.run(dataset, where=["flag!="])
    assert "slipped" in capsys.readouterr().out
    browse.run(dataset, unflag=1)
    assert flagged_episodes(read_dataset(dataset)) == {}
    assert frames_of(read_dataset(dataset)).valid.any(), "and takes it back"
    with pytest.raises(UsageError, match="reason"):
        browse.run(dataset, flag=1)


def test_without_a_number_the_first_episode_with_a_prediction_is_shown(dataset, tmp_path):
    run = dataset.parent / "run" / "predictions"
    (tmp_path / "episode-000002.parquet").write_bytes((run / "episode-000002.parquet").read_bytes())
    assert scene_at(dataset, predictions=tmp_path).title == "set/episode 2"
    assert scene_at(dataset, predictions=tmp_path, episode=0).maps[0].name == "label"
    assert "no prediction of this episode" in scene_at(dataset, predictions=tmp_path, episode=0).summary
    start = int(read_dataset(dataset)[features.TIME][0])
    spans = [(number, start + number * APART, start + number * APART + 10**10) for number in range(3)]
    assert first_predicted(tmp_path, spans) == 2
    assert first_predicted(tmp_path, spans[:2]) is None
