"""What a network has seen: presses like those it learnt from are near, wider and deeper ones far."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.errors import FormatError
from tacdata.training.metrics import novelty
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train

LEARNED, VALIDATED, KEPT_APART = slice(0, 60), slice(60, 80), slice(80, 100)


@pytest.fixture
def many(make_frames):
    """A hundred presses, twenty-four frames each."""
    return make_frames(episodes=100)


def rows(frames, episodes):
    return frames.indices(tuple(range(episodes.start, episodes.stop)))


def known_of(frames, **options):
    found = novelty.gathered(frames, [(rows(frames, LEARNED), rows(frames, VALIDATED))], "a" * 64, **options)
    assert found is not None
    return found


def test_presses_alike_are_near_and_wider_ones_far(many):
    known = known_of(many)
    alike = many.taxels[rows(many, KEPT_APART)]
    assert (known.novelty(alike) > 1).mean() < 0.03
    assert (known.novelty(many.taxels[rows(many, LEARNED)]) > 1).mean() < 0.01
    wide = np.full((1, 24), alike.max())  # every taxel reads what the strongest read
    deep = 3 * alike[[alike.max(axis=1).argmax()]]
    quiet = np.random.default_rng(0).normal(0, 2, (50, 24))
    assert known.novelty(wide)[0] > 2 and known.novelty(deep)[0] > 1
    assert (known.novelty(quiet) < 1).all()
    assert np.isnan(known.novelty(np.full((1, 24), np.nan))).all()


def test_mirrored_training_knows_mirrored_presses(many):
    one_sided = replace(many, taxels=many.taxels * (np.arange(24) % 6 < 3))
    other = one_sided.taxels.reshape(-1, 4, 6)[:, :, ::-1].reshape(-1, 24)
    pressed = one_sided.taxels.max(axis=1) > 300
    plain, mirrored = known_of(one_sided), known_of(one_sided, mirror=True)
    assert (plain.novelty(other[pressed]) > 1).mean() > 0.9
    assert (mirrored.novelty(other[pressed]) > 1).mean() < 0.05


def test_nothing_is_said_without_enough_validation(many):
    few = rows(many, VALIDATED)[:10]
    assert novelty.gathered(many, [(rows(many, LEARNED), few)], "a" * 64) is None


def test_what_is_written_is_read_for_its_checkpoint_alone(many, tmp_path):
    known = known_of(many)
    assert novelty.read(tmp_path, "a" * 64) is None
    novelty.write(tmp_path, known)
    again = novelty.read(tmp_path, "a" * 64)
    assert again is not None and novelty.read(tmp_path, "b" * 64) is None
    np.testing.assert_array_equal(again.novelty(many.taxels[:50]), known.novelty(many.taxels[:50]))
    (tmp_path / novelty.FILE).write_text("{")
    with pytest.raises(FormatError, match=r"seen\.json"):
        novelty.read(tmp_path, "a" * 64)


def test_a_training_run_says_what_it_has_seen(make_frames, tmp_path):
    frames = make_frames(episodes=30)
    small = TrainingSettings(arguments={"hidden": 8, "channels": 4}, epochs=1)
    run = tmp_path / "run"
    trained = train(frames, small, run, "cpu", threads=1)
    known = novelty.read(run, trained.content_hash)
    assert known is not None and len(known.readings) <= novelty.KEPT
    assert (known.novelty(frames.taxels[frames.indices(trained.split.train)]) > 1).mean() < 0.01
    assert known.novelty(np.full((1, 24), 5000.0))[0] > 2
    (run / novelty.FILE).unlink()
    train(
        frames, small, run, "cpu", resume=True, threads=1
    )  # as somebody does who trained before there was such a file
    assert (run / novelty.FILE).is_file()
