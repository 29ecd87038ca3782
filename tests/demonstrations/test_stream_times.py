"""Streams that tell another time are refused or moved, and said."""

from dataclasses import replace

import numpy as np
import pytest
from demo_examples import recording, taxels, truth_at, view

from tacdata.demonstrations.paths.tracking import track
from tacdata.errors import FormatError, UsageError
from tacdata.replay.targets import check_guesses, targets_of

NAMES = ("thumb", "index", "middle")
TWO = {"cameras": ("eye", "other")}


def later(stream, seconds, rows=slice(None)):
    times = stream.sample_ns.copy()
    times[rows] += round(seconds * 1e9)
    return replace(stream, sample_ns=times)


def views(change=lambda stream: stream, rate=25.0):
    own = [view(name) for name in NAMES]
    return (*own, *(change(view(name, rate=rate, camera="other", seed=1)) for name in NAMES))


def errors(made):
    off = [t.position - truth_at(name, made.time_ns)[:, :3, 3] for name, t in made.tracks.items()]
    return 1000 * np.linalg.norm(np.concatenate(off), axis=1)


@pytest.mark.parametrize("lag", [0.04, 0.5, 5.0, -0.1])
def test_a_camera_that_is_late_is_said_and_moved_back(tmp_path, lag):
    made = track(recording(tmp_path, views=views(lambda stream: later(stream, lag), rate=20.0), **TWO))
    late, early = ("other", "eye") if lag > 0 else ("eye", "other")
    (words,) = made.remarks[:1]
    assert words.startswith(f"the images of camera {late} are {abs(lag):.2f} s later than those of camera {early}")
    # The path is where the fingers were by the clock of the camera that is not late.
    shift = min(lag, 0.0)
    moved = replace(made, time_ns=made.time_ns - round(shift * 1e9))
    off = errors(moved)
    assert np.nanmedian(off) < 0.4 and np.nanmax(off) < 2.0
    assert sum(t.outliers for t in made.tracks.values()) < 5


@pytest.mark.parametrize("rates", [(25.0, 25.0), (60.0, 7.0)])
def test_cameras_in_step_are_left_alone_whatever_their_rates(tmp_path, rates):
    own = [view(name, rate=rates[0]) for name in NAMES]
    other = [view(name, rate=rates[1], camera="other", seed=1) for name in NAMES]
    made = track(recording(tmp_path, views=(*own, *other), **TWO))
    assert made.remarks == () and np.nanmax(errors(made)) < 1.5


def test_a_stream_of_another_hour_is_refused(tmp_path):
    with pytest.raises(FormatError, match="camera other lies 3592 s after all other streams"):
        track(recording(tmp_path, views=views(lambda stream: later(stream, 3600.0)), **TWO))
    felt = {name: taxels(name) for name in NAMES}
    felt["index"] = later(felt["index"], -3600.0)
    with pytest.raises(FormatError, match="the board of index lies 3592 s before"):
        track(recording(tmp_path, streams=felt))


def test_times_that_go_back_are_refused(tmp_path):
    own = [view(name) for name in NAMES]
    with pytest.raises(FormatError, match=r"camera eye on index go back by 2\.0 s, 4\.0 s after its first"):
        track(recording(tmp_path, views=[own[0], later(own[1], -2.0, slice(100, None)), own[2]]))
    felt = {name: taxels(name) for name in NAMES}
    felt["thumb"] = later(felt["thumb"], -2.0, slice(120, None))
    with pytest.raises(FormatError, match="the board of thumb go back"):
        track(recording(tmp_path, streams=felt))


@pytest.mark.parametrize("lag", [0.15, 0.3])
def test_images_that_are_late_all_the_time_are_betrayed_by_touch(tmp_path, lag):
    """No clock shows it: the paths are as uncertain as the lag, and not fit for a robot.

    One camera with a noise of 0.4 mm tells the lag to some 0.03 s.
    """
    tracked = track(recording(tmp_path, views=tuple(later(view(name), lag) for name in NAMES)))
    (words,) = [words for words in tracked.remarks if "later than the readings" in words]
    assert float(words.split()[3]) == pytest.approx(lag, abs=0.04)
    off = np.concatenate([t.position - truth_at(n, tracked.time_ns)[:, :3, 3] for n, t in tracked.tracks.items()])
    spread = np.concatenate([np.sqrt(t.covariance[:, range(3, 6), range(3, 6)]) for t in tracked.tracks.values()])
    assert 1000 * np.nanmax(np.abs(off)) > 10.0 and (np.abs(off) > 3 * spread).any(axis=1).mean() < 0.01
    with pytest.raises(UsageError, match="of its targets are uncertain"):
        check_guesses(targets_of(tracked, None))


def test_late_images_do_not_average_out(tmp_path):
    """All images are 60 ms late, as their clock allows: the truth lies within what is stated, and it is said."""
    made = recording(tmp_path, views=tuple(later(view(name), 0.06) for name in NAMES))
    tracked = track(replace(made, timing={"eye": 0.06}))
    stated, felt = tracked.remarks
    assert stated.startswith("the times of camera eye's images are known to 0.06 s only")
    assert "later than the readings" in felt
    off = np.concatenate([t.position - truth_at(n, tracked.time_ns)[:, :3, 3] for n, t in tracked.tracks.items()])
    spread = np.concatenate([np.sqrt(t.covariance[:, range(3, 6), range(3, 6)]) for t in tracked.tracks.values()])
    assert 1000 * np.nanmax(np.abs(off)) > 5.0
    assert (np.abs(off) > 3 * spread).any(axis=1).mean() < 0.01


def test_an_image_that_is_repeated_under_fresh_stamps_does_not_count(tmp_path):
    frozen = []
    for name in NAMES:
        stream = view(name)
        rows = slice(61, 70)
        for values in (stream.position, stream.quaternion):
            values[rows] = values[60]
        frozen.append(stream)
    made = track(recording(tmp_path, views=tuple(frozen)))
    assert any(words.startswith("camera eye repeated an image 9 times from 2.4 to 2.8 s") for words in made.remarks)
    assert not any("contradict" in words or "change places" in words for words in made.remarks)
    assert all(t.outliers == 0 and t.gap[75:81].any() for t in made.tracks.values())


def test_neighbours_in_the_wrong_order_are_noticed_by_the_motion(tmp_path):
    """Without stamps the reader gives their times in the order of arrival."""
    exchanged, pairs = [], range(20, 200, 12)
    for name in NAMES:
        stream, order = view(name), np.arange(212)
        for k in pairs:
            order[[k, k + 1]] = order[[k + 1, k]]
        arrays = {"position": stream.position[order], "quaternion": stream.quaternion[order]}
        exchanged.append(replace(stream, **arrays))
    tracked = track(recording(tmp_path, views=tuple(exchanged)))
    (words,) = [words for words in tracked.remarks if "wrong order" in words]
    assert 3 <= int(words.split()[0]) <= len(pairs) and "camera eye" in words
    off = np.concatenate([t.position - truth_at(n, tracked.time_ns)[:, :3, 3] for n, t in tracked.tracks.items()])
    spread = np.concatenate([np.sqrt(t.covariance[:, range(3, 6), range(3, 6)]) for t in tracked.tracks.values()])
    assert (np.abs(off) > 3 * spread).any(axis=1).mean() < 0.01
    assert not any("contradict" in words or "moved" in words for words in tracked.remarks)
