"""Splits hold whole episodes apart, in the way that their name says, the same for the same seed."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata import registry
from tacdata.errors import FormatError, UsageError
from tacdata.training.splits.split import BASE, ROOM, Split, divide


@pytest.mark.parametrize("name", registry.names(ROOM, BASE))
def test_every_split_divides_whole_episodes_and_repeats_itself(name, make_frames):
    frames = make_frames(episodes=24, length=12)
    split = divide(frames, name, seed=3)
    parts = [set(split.train), set(split.validation), set(split.test)]
    assert all(parts)
    assert sorted(n for part in parts for n in part) == list(range(24))
    assert split == divide(frames, name, seed=3)
    assert Split.from_document(split.document) == split
    owner = [{frames.indices(tuple(part))[0] for part in parts}]
    assert len(owner[0]) == 3


def test_another_seed_draws_another_test_set(make_frames):
    frames = make_frames(episodes=24, length=12)
    assert len({divide(frames, "episode", seed).test for seed in range(6)}) > 1


def test_shapes_sites_and_depths_are_held_apart(make_frames):
    frames = make_frames(episodes=24, length=12)
    for seed in range(3):
        split = divide(frames, "indenter", seed)
        shapes = [{e.shape for e in frames.spans(part)} for part in (split.train + split.validation, split.test)]
        assert not shapes[0] & shapes[1]
    split = divide(frames, "depth", 0)
    assert min(e.depth for e in frames.spans(split.test)) > max(e.depth for e in frames.spans(split.train))
    split = divide(frames, "rate", 0)
    assert min(e.speed for e in frames.spans(split.test)) > max(e.speed for e in frames.spans(split.train))
    split = divide(frames, "specimen", 0)
    specimens = [{e.specimen for e in frames.spans(part)} for part in (split.train + split.validation, split.test)]
    assert not specimens[0] & specimens[1]
    split = divide(frames, "site", 0)
    # TacPrint: the outermost taxels stand at 4.75 and 3.75 mm, the next at 2.85 and 1.25 mm; the
    # middle between them is 3.8 and 2.5 mm.
    assert all(abs(e.x) > 3.8 or abs(e.y) > 2.5 for e in frames.spans(split.test))
    assert all(abs(e.x) <= 3.8 and abs(e.y) <= 2.5 for e in frames.spans(split.train + split.validation))


def test_repeats_of_a_configuration_stay_together(make_frames):
    frames = make_frames(episodes=12, length=12)
    pairs = tuple(
        replace(e, **{k: getattr(frames.episodes[e.number // 2], k) for k in ("indenter", "x", "y", "depth")})
        for e in frames.episodes
    )
    split = divide(replace(frames, episodes=pairs), "configuration", 0)
    assert {n // 2 for n in split.test}.isdisjoint(n // 2 for n in split.train + split.validation)
    assert len(split.test) == 2


@pytest.mark.parametrize(("name", "episodes"), [("episode", 2), ("indenter", 1), ("depth", 1)])
def test_a_split_that_leaves_a_part_empty_is_refused(name, episodes, make_frames):
    with pytest.raises(UsageError, match="leaves no"):
        divide(make_frames(episodes=episodes, length=12), name, 0)


def test_an_unknown_split_is_answered_with_a_known_one(frames):
    with pytest.raises(UsageError, match="did you mean 'episode'"):
        divide(frames, "episodes", 0)


def test_invalid_frames_are_never_learned_from(frames):
    valid = np.ones(len(frames.taxels), dtype=bool)
    valid[frames.episodes[2].start : frames.episodes[2].stop] = False
    valid[5] = False
    marked = replace(frames, valid=valid)
    assert 5 not in marked.indices((0, 2))
    with pytest.raises(FormatError, match="is valid"):
        marked.indices((2,))


def test_speeds_that_nobody_knows_are_not_divided(frames):
    unknown = tuple(replace(e, speed=None) if e.number == 3 else e for e in frames.episodes)
    with pytest.raises(FormatError, match="speed of 1 episodes is not known"):
        divide(replace(frames, episodes=unknown), "rate", 0)
