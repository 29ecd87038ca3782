"""How far labels' tips are off where the tip truly was: a right effect brings them nearer, a wrong one does not."""

import numpy as np
import pytest
from revised_bench import verdict

from tacdata.discrepancy.model.spec import read_spec
from tacdata.effects import Placed, load
from tacdata.errors import FormatError, UsageError
from tacdata.recording import read_episode, read_session
from tacdata.revision.labels.realised import COLUMNS, tip_error
from tacdata.revision.revise import RevisionOptions, revise

PLAY = 0.06


def placed(name, **values):
    return [Placed(load(name), {k: np.array(v) for k, v in values.items()})]


@pytest.fixture(scope="module")
def truth(loose, tmp_path_factory):
    """Where a drive with play had the tip, stepped by hand along the recorded paths."""
    follower, lines = -0.3, [",".join(COLUMNS)]
    for path in read_session(loose).episodes:
        episode = read_episode(path)
        time = np.arange(episode.tip_ns[0], episode.tip_ns[-1], 5_000_000)
        for t, (x, y, z) in zip(time, episode.tip_at(time), strict=True):
            follower = min(max(follower, z), z + PLAY)
            lines.append(f"{t},{x:.5f},{y:.5f},{follower:.5f}")
    file = tmp_path_factory.mktemp("truth") / "truth.csv"
    file.write_text("\n".join(lines))
    return file


def test_play_that_is_known_brings_the_tip_to_where_it_was(loose, truth):
    told = tip_error(loose, placed("backlash", b=PLAY), truth)
    assert told is not None and told.episodes == 16 and told.against == "truth.csv"
    assert 0.4 * PLAY < told.before < 0.6 * PLAY and told.after < 0.05 * told.before
    assert (told.better, told.worse) == (16, 0)


def test_a_wrong_effect_is_seen_to_make_labels_worse(loose, truth):
    told = tip_error(loose, placed("z_offset", dz=-0.1), truth)
    assert told is not None and told.better == 0
    assert told.constant_after > told.constant_before + 0.09, "no tip was ever so much higher"
    wrong = tip_error(loose, placed("backlash", b=3 * PLAY), truth)
    assert wrong is not None and wrong.after > 1.1 * wrong.before and wrong.worse == 16


def test_the_revision_says_how_far_labels_were_off(loose, truth, tmp_path):
    judged = verdict(tmp_path / "verdict", "backlash", {"b": PLAY})
    made = revise(judged, [loose], read_spec(None), tmp_path / "revision", RevisionOptions(truth=truth))
    [told] = made.document["tips"]
    assert told["better"] == 16 and told["after"] < 0.1 * told["before"]
    assert "Tip error of the labels" in (made.folder / "card.html").read_text()
    assert "truth.csv" in (made.folder / "gap.md").read_text()


def test_effects_of_readings_alone_have_no_tip_to_tell_of(loose, truth):
    assert tip_error(loose, placed("latency", L=0.1), truth) is None
    assert tip_error(loose, placed("backlash", b=PLAY)) is None, "no tag saw it"


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("time_ns,x,y\n1,2,3\n", FormatError, "depth"),
        ("time_ns,x,y,depth\n", FormatError, "empty"),
        ("time_ns,x,y,depth\n1,0,0,zero\n", FormatError, "zero"),
        ("time_ns,x,y,depth\n1,0,0,0\n2,0,0,0\n", UsageError, "time_ns"),
    ],
)
def test_a_truth_that_is_none_is_refused_in_words(loose, tmp_path, text, error, words):
    (tmp_path / "truth.csv").write_text(text)
    with pytest.raises(error, match=words):
        tip_error(loose, placed("backlash", b=PLAY), tmp_path / "truth.csv")
    with pytest.raises(UsageError, match="no file"):
        tip_error(loose, placed("backlash", b=PLAY), tmp_path / "nothing.csv")
