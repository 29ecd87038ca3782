"""Frames that would spoil a training are refused with words."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.errors import FormatError


def spoiled(values, place):
    values = values.copy()
    values[place] = np.nan
    return values


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: {"taxels": spoiled(f.taxels, (30, 7))}, "taxel signals of episode 1, frame 6 are not finite"),
        (lambda f: {"depth": spoiled(f.depth, (50, 3, 3))}, "label maps of episode 2, frame 2 are not finite"),
        (lambda f: {"taxels": f.taxels[:, :23]}, r"taxel signals have shape \(288, 23\)"),
        (lambda f: {"depth": f.depth[:, :, :25]}, r"label maps have shape \(288, 35, 25\)"),
        (lambda f: {"tip": f.tip[:-1]}, "nominal tip have shape"),
        (lambda f: {"episodes": f.episodes[:-1]}, "288 frames, episodes end at 264"),
        (lambda f: {"episodes": f.episodes[1:]}, "do not follow each other"),
    ],
)
def test_damaged_frames_are_refused(frames, change, words):
    with pytest.raises(FormatError, match=words):
        replace(frames, **change(frames))


def test_an_episode_that_is_not_there_is_named(frames):
    with pytest.raises(FormatError, match=r"lacks episodes \[99\]"):
        frames.spans((0, 99))
