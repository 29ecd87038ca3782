"""Fingertip paths: how near to the truth, how honest about it, and every planted fault named."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from demo_examples import START, changed, recording, rig, taxels, truth_at, view
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.paths import tracking
from tacdata.demonstrations.paths.acquisition import acquire
from tacdata.demonstrations.paths.estimator import ALL, Estimator
from tacdata.demonstrations.paths.motion_density import choose
from tacdata.demonstrations.paths.motion_filter import ProcessNoise, exponential, logarithm, smooth
from tacdata.demonstrations.paths.sightings import sightings_of
from tacdata.demonstrations.paths.tracking import track
from tacdata.demonstrations.paths.tracks_file import path_of, read_tracks, write_tracks
from tacdata.errors import FormatError, UsageError
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.demo import FINGERS

NAMES = ("thumb", "index", "middle")


@pytest.fixture(autouse=True, scope="module")
def smoothed_once():
    """Most tests change one finger of the same demonstration: what was smoothed already is not smoothed again."""
    smooth_finger, known = tracking._path, {}

    def path(seen, times):
        key = pickle.dumps((seen, times))
        if key not in known:
            known[key] = pickle.dumps(smooth_finger(seen, times))
        return pickle.loads(known[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracking, "_path", path)
        yield


def errors(made, name):
    """Distance [mm] and angle [deg] from the truth, and the squared error over the covariance."""
    found, truth = made.tracks[name], truth_at(name, made.time_ns)
    inside = ~found.gap
    turns = Rotation.from_matrix(truth[inside, :3, :3]) * Rotation.from_quat(found.quaternion[inside]).inv()
    off = np.concatenate([turns.as_rotvec(), truth[inside, :3, 3] - found.position[inside]], axis=1)
    squares = [e @ np.linalg.solve(c, e) for e, c in zip(off, found.covariance[inside], strict=True)]
    return 1000 * np.linalg.norm(off[:, 3:], axis=1), np.degrees(turns.magnitude()), np.array(squares)


def note(made, *words):
    return [r for r in made.remarks if all(word in r for word in words)]


def test_smoothing_halves_the_noise_and_knows_what_is_left(tmp_path):
    made = track(recording(tmp_path))
    assert set(made.tracks) == set(NAMES) and made.frame == "table" and not made.remarks
    for name in NAMES:
        place, angle, squares = errors(made, name)
        # One sighting alone: 0.4 mm and 0.3 deg an axis, so 0.62 mm and 0.46 deg in the median.
        assert np.median(place) < 0.31 and np.quantile(place, 0.95) < 1.0
        assert np.median(angle) < 0.23
        assert 2.0 < np.mean(squares) < 9.0  # six numbers
        assert made.tracks[name].outliers <= 3


def test_two_cameras_are_better_than_one(tmp_path):
    cameras = ("eye", "other")
    views = tuple(view(name, camera=camera, seed=k) for name in NAMES for k, camera in enumerate(cameras))
    one, two = track(recording(tmp_path)), track(recording(tmp_path, views, cameras=cameras))
    assert np.mean(errors(two, "index")[0]) < 0.9 * np.mean(errors(one, "index")[0])


def test_the_backward_pass_makes_the_past_surer():
    seen = sightings_of("index", (view("index"),), rig())
    times, wander = seen.time_ns[20:-20], choose(seen)
    forth, both = smooth(seen, times, wander, back=False), smooth(seen, times, wander)
    assert (np.trace(both.covariance, axis1=1, axis2=2) <= np.trace(forth.covariance, axis1=1, axis2=2)).all()
    truth = truth_at("index", times)[:, :3, 3]
    assert np.linalg.norm(both.position - truth) < np.linalg.norm(forth.position - truth)


def test_process_noise_is_that_of_the_whole_recording():
    """Rest at the beginning says nothing of the hurry that follows: what it alone asks for loses a sixth of all."""
    seen = sightings_of("index", (view("index", seconds=34.0, rate=40.0),), rig())
    kept = np.zeros(len(seen), bool)
    kept[:30] = True  # before the hand closes
    assert choose(seen).velocity > choose(seen.where(kept)).velocity
    assert smooth(seen, seen.time_ns[:1], choose(seen)).accepted.mean() > 0.995


def test_a_track_that_was_lost_is_taken_up_again():
    seen = sightings_of("index", (view("index"),), rig())
    stiff = ProcessNoise(1e-4, 1e-2)  # a tenth of what the whole path asks for
    lost, found = smooth(seen, seen.time_ns, stiff), acquire(seen, seen.time_ns, stiff)
    truth = truth_at("index", seen.time_ns)[:, :3, 3]
    assert lost.accepted.mean() < 0.5 and found.accepted.mean() > 0.99
    off = [1000 * np.linalg.norm(path.position - truth, axis=1).max() for path in (lost, found)]
    assert off[0] > 50 and off[1] < 3


@pytest.mark.parametrize("seed", range(6))
def test_a_cameras_constant_error_is_not_averaged_away(seed):
    """Two cameras, each where its file does not quite say: the truth lies within three stated standard deviations."""
    rng, views = np.random.default_rng(seed), []
    shift, turn = 0.0005, np.radians(0.1)
    cameras = ("eye", "other")
    bench = rig(cameras=cameras)
    worlds = {name: replace(world, spread=(shift, turn)) for name, world in bench.worlds.items()}
    for k, camera in enumerate(cameras):
        off, turned = rng.normal(0, shift, 3), Rotation.from_rotvec(rng.normal(0, turn, 3))
        whole = view("index", camera=camera, seed=10 * seed + k)
        moved = turned.apply(whole.position) + off
        quaternion = (turned * Rotation.from_quat(whole.quaternion)).as_quat()
        views.append(replace(whole, position=moved, quaternion=quaternion))
    seen = sightings_of("index", views, replace(bench, worlds=worlds))
    path = acquire(seen, seen.time_ns, choose(seen))
    away = path.position - truth_at("index", seen.time_ns)[:, :3, 3]
    stated = np.sqrt(path.covariance[:, range(3, 6), range(3, 6)])
    assert (np.abs(away) < 3 * stated).all(axis=1).mean() > 0.99
    # Two cameras are off by less than one, and 400 images by no less.
    assert 0.5 * shift < np.median(stated) < 1.1 * shift


def test_no_tag_for_a_second_is_a_gap_with_growing_doubt(tmp_path):
    whole = view("index")
    seconds = (whole.sample_ns - START) * 1e-9
    hidden = (seconds > 4.0) & (seconds < 5.0)
    blind = changed(whole, hidden, position=np.nan, quaternion=np.nan, faces=0)
    made = track(recording(tmp_path, (view("thumb"), blind, view("middle"))))
    (words,) = note(made, "index", "no tag")
    assert "from 4.0 to 5.0 s" in words
    found, t = made.tracks["index"], made.seconds
    assert found.gap[(t > 4.1) & (t < 4.9)].all() and not found.gap[(t < 3.9) | ((t > 5.1) & (t < 8.4))].any()
    doubt = np.trace(found.covariance[:, 3:, 3:], axis1=1, axis2=2)
    assert doubt[np.argmin(abs(t - 4.5))] > 5 * doubt[np.argmin(abs(t - 3.5))]
    truth = truth_at("index", made.time_ns)[:, :3, 3]
    assert 1000 * np.nanmax(np.linalg.norm(found.position - truth, axis=1)) < 12  # bridged, not guessed wildly
    assert not made.tracks["thumb"].gap[t < 8.4].any()


def test_mirrored_poses_are_left_out_and_said(tmp_path):
    whole = view("index")
    flipped = np.zeros(len(whole.sample_ns), bool)
    flipped[[30, 31, 80, 120, 121, 122]] = True
    turned = (Rotation.from_quat(whole.quaternion) * Rotation.from_euler("x", 50, degrees=True)).as_quat()
    made = track(recording(tmp_path, (view("thumb"), changed(whole, flipped, quaternion=turned), view("middle"))))
    (words,) = note(made, "index", "turned by")
    assert "6 of" in words
    assert made.tracks["index"].outliers >= 6
    assert errors(made, "index")[1].max() < 3.0  # no jump


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_a_tag_glued_on_turned_is_named_even_if_it_is_seen_most(tmp_path, share):
    whole = view("index", seed=2)
    count = len(whole.sample_ns)
    which = np.random.default_rng(0).random(count)
    turned = (Rotation.from_quat(whole.quaternion) * Rotation.from_euler("z", 180, degrees=True)).as_quat()
    wrong = changed(whole, which < share, quaternion=turned, ids=(9,))
    right = np.where(np.arange(count) % 2, 6, 7)
    for tag in (6, 7):
        wrong = changed(wrong, (which >= share) & (right == tag), ids=(tag,))
    made = track(recording(tmp_path, (view("thumb"), wrong, view("middle"))))
    assert len(note(made, "index: tag 9", "180 deg")) == 1
    assert not note(made, "tag 6, seen") and not note(made, "tag 7, seen")
    assert np.quantile(errors(made, "index")[1], 0.95) < 2.0


@pytest.mark.parametrize("mixed", [False, True])
def test_of_two_tags_that_contradict_each_other_both_are_named(tmp_path, mixed):
    whole = view("index", seed=2)
    count = len(whole.sample_ns)
    often = (np.random.default_rng(0).random(count) if mixed else np.arange(count) / count) < 0.65
    turned = (Rotation.from_quat(whole.quaternion) * Rotation.from_euler("z", 180, degrees=True)).as_quat()
    wrong = changed(changed(whole, often, quaternion=turned, ids=(6,)), ~often, ids=(7,))
    made = track(recording(tmp_path, (view("thumb"), wrong, view("middle"))))
    (words,) = note(made, "index: tags 7 and 6", "do not tell which", "look at both")
    assert "tag 7, seen less often" in words


def test_fingers_whose_numbers_are_exchanged_for_a_while_are_named(tmp_path):
    thumb, index = view("thumb"), view("index")
    seconds = (index.sample_ns - START) * 1e-9
    during = (seconds > 3.0) & (seconds < 3.3)
    swapped = (
        changed(thumb, during, position=index.position, quaternion=index.quaternion),
        changed(index, during, position=thumb.position, quaternion=thumb.quaternion),
    )
    made = track(recording(tmp_path, (*swapped, view("middle"))))
    (words,) = note(made, "thumb and index change places")
    assert "3.0 s after" in words
    assert np.quantile(errors(made, "index")[0], 0.95) < 2.0


def test_two_hands_with_each_others_numbers_are_named(tmp_path):
    left = copy.deepcopy(FINGERS)
    for entry in left["fingers"].values():
        entry["hand"] = "left"
    made = track(recording(tmp_path, fingers=left))
    assert note(made, "left hand stand as those of the other hand", "100%")


def test_a_finger_without_signal_is_named(tmp_path):
    streams = {name: taxels(name) for name in NAMES}
    short, stuck = streams["middle"], streams["index"]
    kept = short.sample_ns < START + 3e9
    fields = ("arrival_ns", "sample_ns", "counter", "counts")
    streams["middle"] = type(short)(*(getattr(short, field)[kept] for field in fields))
    streams["index"] = type(stuck)(stuck.arrival_ns, stuck.sample_ns, stuck.counter, np.full_like(stuck.counts, 9000.0))
    streams["thumb"].counts[:, 5] = 0.0
    made = track(recording(tmp_path, streams=streams))
    assert note(made, "middle: its board is silent from 3.0 s to the end")
    assert note(made, "index: no reading of its board ever changes")
    assert note(made, "thumb: channels 5 never change")
    assert np.isnan(made.tracks["middle"].signals[made.seconds > 3.2]).all()


def test_a_finger_that_never_touched_anything_is_named(tmp_path):
    streams = {name: taxels(name) for name in NAMES}
    rng = np.random.default_rng(0)
    streams["thumb"].counts[:] = np.round(9000 + rng.normal(0, 4, streams["thumb"].counts.shape))
    assert note(track(recording(tmp_path, streams=streams)), "thumb", "nothing ever touched")


def test_predicted_depth_is_a_prediction_with_the_checkpoints_identity(tmp_path):
    sensor = default_sensor()
    identity = {"hash": "a" * 64, "network": "stand-in", "epoch": 3, "lookahead": 4, "sensor": sensor.content_hash}

    def maps(tared):
        return np.repeat(tared.max(axis=1) / 1500, 35 * 26).reshape(-1, 35, 26).astype(np.float32)

    made = track(recording(tmp_path), estimator=Estimator(identity, sensor, maps))
    depth = made.tracks["index"].depth
    held = np.nanmax(depth[np.argmin(abs(made.seconds - 4.0))])
    assert held == pytest.approx(max(truth_depth("index")), rel=0.03)
    assert made.provenance["parents"]["checkpoint"] == "a" * 64
    path = tmp_path / "x.tracks.parquet"
    write_tracks(path, made)
    again = read_tracks(path)
    assert again.network == identity
    for name in NAMES:
        for field in ("position", "quaternion", "covariance", "gap", "signals", "depth"):
            assert np.array_equal(getattr(again.tracks[name], field), getattr(made.tracks[name], field), equal_nan=True)
    assert again.remarks == made.remarks and again.frame == "table" and np.array_equal(again.time_ns, made.time_ns)


def test_depth_from_readings_that_the_network_never_learnt_from_is_called_a_guess(tmp_path):
    sensor = default_sensor()

    def maps(tared):
        return np.ones((len(tared), 35, 26), np.float32)

    def novelty(tared):  # as if nothing above 700 counts had been learnt from
        return tared.max(axis=1) / 700

    made = track(recording(tmp_path), estimator=Estimator({"hash": "a" * 64}, sensor, maps, novelty))
    for name in NAMES:
        (words,) = note(made, f"{name}: ", "unlike all of what the network learnt from")
        assert "guess" in words
        found = made.tracks[name]
        assert np.nanmax(found.novelty[found.signals.max(axis=1) < 100]) < 0.2
    path = tmp_path / "x.tracks.parquet"
    write_tracks(path, made)
    assert np.array_equal(read_tracks(path).tracks["index"].novelty, made.tracks["index"].novelty, equal_nan=True)

    near = track(recording(tmp_path), estimator=Estimator({"hash": "a" * 64}, sensor, maps, lambda t: 0 * t[:, 0]))
    between = track(
        recording(tmp_path), estimator=Estimator({"hash": "a" * 64}, sensor, maps, lambda t: 1.2 + 0 * t[:, 0])
    )
    assert len(note(between, "just outside of", "1.20 times", "may be off")) == len(NAMES)
    assert not note(near, "unlike") and not note(near, "not known")
    silent = track(recording(tmp_path), estimator=Estimator({"hash": "a" * 64}, sensor, maps))
    assert len(note(silent, "is not known", "seen.json")) == 1
    assert silent.tracks["index"].novelty is None


def truth_depth(name):
    from demo_examples import HAND

    return [HAND.press(name, t)[2] for t in np.arange(0, 8, 0.05)]


def test_a_network_of_another_sensor_is_refused(tmp_path):
    document = copy.deepcopy(default_sensor().document)
    document["skin"]["thickness"] = 2.0
    other = type(default_sensor()).from_document(document, "other")
    with pytest.raises(FormatError, match="was trained for"):
        track(recording(tmp_path), estimator=Estimator({"hash": ""}, other, lambda tared: tared))


def test_bad_input_ends_in_words(tmp_path):
    with pytest.raises(UsageError, match="Hz"):
        track(recording(tmp_path), rate=0.0)
    nothing = view("index")
    nothing = changed(nothing, np.ones(len(nothing.sample_ns), bool), position=np.nan, quaternion=np.nan, faces=0)
    with pytest.raises(FormatError, match="no finger was seen"):
        track(recording(tmp_path, (nothing,)))
    with pytest.raises(UsageError, match="tacdata track"):
        read_tracks(tmp_path / "none.tracks.parquet")
    (tmp_path / "bad.tracks.parquet").write_bytes(b"PAR1 nothing")
    with pytest.raises(FormatError, match="holds no tracks"):
        read_tracks(tmp_path / "bad.tracks.parquet")
    assert path_of(tmp_path / "episode-000000.mcap").name == "episode-000000.tracks.parquet"


def test_rotations_and_their_vectors_are_inverse():
    rng = np.random.default_rng(0)
    for angle in (0.0, 1e-9, 1e-4, 0.5, 3.0, np.pi - 1e-6, np.pi):
        axis = rng.normal(size=3)
        vector = angle * axis / np.linalg.norm(axis)
        assert np.allclose(exponential(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)
        assert np.allclose(exponential(logarithm(exponential(vector))), exponential(vector), atol=1e-7)


def test_a_stretch_without_images_is_no_hidden_tag(tmp_path):
    def without(stream):
        seconds = (stream.sample_ns - START) * 1e-9
        kept = (seconds < 4.0) | (seconds > 4.6)
        arrays = {k: getattr(stream, k)[kept] for k in ("sample_ns", "position", "quaternion", "reprojection", "faces")}
        arrays |= {k: getattr(stream, k)[kept] for k in ("covariance", "ambiguous")}
        return replace(stream, **arrays, ids=tuple(i for i, k in zip(stream.ids, kept, strict=True) if k))

    made = track(recording(tmp_path, tuple(without(view(name)) for name in NAMES)))
    (words,) = note(made, "no image was searched for tags from 4.0 to 4.6 s")
    assert note(made, "tacdata track --every-image")
    assert "keep up" in words and not note(made, "no tag that fits")


def test_a_folder_in_place_of_tracks_is_answered_with_what_is_in_it(tmp_path):
    (tmp_path / "demos").mkdir()
    (tmp_path / "demos" / "episode-000000.tracks.parquet").touch()
    with pytest.raises(UsageError, match=r"episode-000000\.tracks\.parquet"):
        read_tracks(tmp_path / "demos.tracks.parquet")


def test_each_fingertip_may_have_a_network_of_its_own(tmp_path):
    sensor, wide = default_sensor(), "learnt from simulated presses alone"

    def one(depth, **more):
        identity = {"hash": f"{depth}" * 64, "network": "stand-in", "epoch": 1, **more}
        return Estimator(identity, sensor, lambda tared: np.full((len(tared), 35, 26), float(depth), np.float32))

    made = track(recording(tmp_path), estimator={ALL: one(1), "index": one(2, unfitted=wide)})
    assert {name: float(np.nanmax(t.depth)) for name, t in made.tracks.items()} == {"thumb": 1, "index": 2, "middle": 1}
    assert made.networks["index"]["hash"] == "2" * 64 and made.networks["thumb"]["hash"] == "1" * 64
    assert made.network["hash"] not in ("1" * 64, "2" * 64)
    assert wide in made.remarks and made.guesses() == [wide] and made.guesses(("thumb",)) == []
    assert len(note(made, "seen.json")) == 1
    unfitted = track(recording(tmp_path), estimator=one(2, unfitted=wide))
    assert note(unfitted, wide) and not note(unfitted, "seen.json")
    path = tmp_path / "x.tracks.parquet"
    write_tracks(path, made)
    assert read_tracks(path).networks == made.networks
    lone = track(recording(tmp_path), estimator={"index": one(2)})
    assert lone.tracks["thumb"].depth is None and note(lone, "thumb", "no network, so no predicted depth")
    with pytest.raises(UsageError, match="a network for pinky, of which there is no board"):
        track(recording(tmp_path), estimator={"pinky": one(1)})


def test_many_stretches_without_a_searched_image_are_one_sentence(tmp_path):
    from tacdata.demonstrations.paths.tracking import _unsearched_words

    stretches = [(0.5 * k, 0.5 * k + 0.3) for k in range(20)]
    (words,) = _unsearched_words([*stretches, (12.0, 13.7)])
    said = "no image was searched for tags in 21 stretches of 7.7 s in all, the longest 1.7 s from 12.0"
    assert words.startswith(said)
    assert len(_unsearched_words(stretches[:3])) == 3


def test_a_recorder_without_time_for_tags_is_no_hidden_tag(tmp_path):
    short = [changed(view(name, seconds=0.12), [True] * 3, faces=0) for name in NAMES]
    with pytest.raises(FormatError, match="only 3 were searched for tags while recording") as caught:
        track(recording(tmp_path, views=short))
    assert "--every-image" in str(caught.value)
