"""Images, statistics, taring: what single columns become."""

import io
from dataclasses import replace

import numpy as np
import press_example as example
import pyarrow as pa
import pytest
from PIL import Image

from tacdata.dataset import frames
from tacdata.dataset.format import features, statistics, tiff
from tacdata.errors import FormatError
from tacdata.sensor import default_sensor


def test_images_are_tiffs_that_pillow_reads_bit_for_bit() -> None:
    maps = np.random.default_rng(0).normal(size=(5, 35, 26)).astype(np.float32)
    column = tiff.encode(maps)
    assert column.type == pa.struct({"bytes": pa.binary(), "path": pa.string()})
    for blob, expected in zip(column.field("bytes").to_pylist(), maps, strict=True):
        with Image.open(io.BytesIO(blob)) as image:
            image.load()
            assert image.mode == "F"
            assert np.array_equal(np.asarray(image), expected)
    assert np.array_equal(tiff.decode(column, (35, 26)), maps)
    assert np.array_equal(tiff.decode(column.slice(2, 2), (35, 26)), maps[2:4])


def pillow_column(maps, **options) -> pa.StructArray:
    blobs = []
    for values in maps:
        stream = io.BytesIO()
        Image.fromarray(values).save(stream, format="TIFF", **options)
        blobs.append(stream.getvalue())
    return pa.StructArray.from_arrays([pa.array(blobs), pa.nulls(len(blobs), pa.string())], ["bytes", "path"])


def test_images_of_other_makers_are_read_too() -> None:
    maps = np.random.default_rng(1).normal(size=(3, 35, 26)).astype(np.float32)
    ours = tiff.encode(maps[:1]).field("bytes").to_pylist()
    theirs = pillow_column(maps).field("bytes").to_pylist()
    mixed = pa.StructArray.from_arrays([pa.array(ours + theirs), pa.nulls(4, pa.string())], ["bytes", "path"])
    assert np.array_equal(tiff.decode(pillow_column(maps), (35, 26)), maps)
    assert np.array_equal(tiff.decode(pillow_column(maps, compression="tiff_lzw"), (35, 26)), maps)
    assert np.array_equal(tiff.decode(mixed, (35, 26)), maps[[0, 0, 1, 2]])


@pytest.mark.parametrize("shape", [(26, 35), (35, 27)])
def test_images_of_another_size_are_refused(shape) -> None:
    with pytest.raises(ValueError, match="not float32"):
        tiff.decode(tiff.encode(np.zeros((2, *shape), np.float32)), (35, 26))


def test_missing_and_unreadable_images_are_refused() -> None:
    struct = pa.struct({"bytes": pa.binary(), "path": pa.string()})
    with pytest.raises(ValueError, match="missing"):
        tiff.decode(pa.array([{"bytes": None, "path": "x"}], struct), (35, 26))
    with pytest.raises(ValueError, match="unreadable"):
        tiff.decode(pa.array([{"bytes": b"not an image", "path": None}], struct), (35, 26))


@pytest.mark.parametrize("shape", [(41,), (41, 24), (41, 5, 4)])
def test_statistics_are_numpys(shape) -> None:
    values = np.random.default_rng(2).normal(size=shape).astype(np.float32)
    found = statistics.column_statistics(values)
    axis = None if values.ndim == 3 else 0
    expected = {1: (1,), 2: (24,), 3: (1, 1, 1)}[values.ndim]
    for name, q in statistics.QUANTILES.items():
        assert np.allclose(found[name].ravel(), np.quantile(values.astype(float), q, axis=axis), atol=1e-6)
    for name in ("min", "max", "mean", "std"):
        assert np.allclose(found[name].ravel(), getattr(values.astype(float), name)(axis=axis), atol=1e-7)
        assert found[name].shape == expected
    assert found["count"].tolist() == [41]


def test_merged_statistics_are_those_of_the_whole() -> None:
    values = np.random.default_rng(3).normal(3.0, 2.0, size=(100, 6))
    merged = statistics.merge(
        [statistics.column_statistics(part) for part in (values[:13], values[13:20], values[20:])]
    )
    whole = statistics.column_statistics(values)
    for name in ("min", "max", "mean", "std", "count"):
        assert np.allclose(merged[name], whole[name], atol=1e-12)


def test_state_is_tared_by_the_rest_phase() -> None:
    episode = example.episode(count=20)
    columns = frames.episode_columns(episode, example.label(episode))
    assert set(columns) == set(features.DTYPES) - {features.SENSOR, features.RECORD}
    resting = columns[features.PHASE] == 0
    assert resting.sum() == 4
    assert np.abs(columns[features.STATE][resting].mean(axis=0)).max() < 1e-3
    moved = columns[features.RAW] - columns[features.STATE]
    assert np.allclose(moved, episode.baseline, atol=1e-3)
    assert columns[features.DEPTH].min() == 0


def test_no_rest_no_tare() -> None:
    with pytest.raises(FormatError, match="rest phase"):
        _ = example.episode(rest=False).baseline


def test_lost_frames_and_frames_off_the_path_are_not_valid() -> None:
    episode = example.episode(count=20)
    assert frames.valid(episode).all()
    counter = np.where(np.arange(20) >= 7, episode.taxels.counter + 3, episode.taxels.counter)
    lossy = replace(
        episode, taxels=replace(episode.taxels, counter=counter), tip_ns=episode.tip_ns - 2 * example.PERIOD
    )
    assert np.flatnonzero(~frames.valid(lossy)).tolist() == [7, 19]
    bare = replace(episode, taxels=replace(episode.taxels, counter=np.full_like(episode.taxels.counter, -1)))
    assert frames.valid(bare).all(), "without a counter the times tell"
    kept = np.delete(np.arange(len(bare.taxels.counter)), 7)
    gone = {n: getattr(bare.taxels, n)[kept] for n in ("arrival_ns", "sample_ns", "counter", "counts")}
    assert np.flatnonzero(~frames.valid(replace(bare, taxels=replace(bare.taxels, **gone)))).tolist() == [7]


@pytest.mark.parametrize("name", ["recording", "sensor", "model"])
def test_labels_of_something_else_are_refused(name) -> None:
    episode = example.episode()
    label = example.label(episode)
    wanted = dict(label.provenance["parents"])
    frames.check_pair(episode, label, wanted)
    with pytest.raises(FormatError, match=f"made for {name}"):
        frames.check_pair(episode, label, {**wanted, name: "f" * 64})


def test_labels_must_have_the_recordings_times() -> None:
    episode = example.episode()
    wanted = example.label(episode).provenance["parents"]
    with pytest.raises(FormatError, match="times are not those"):
        frames.check_pair(episode, example.label(episode, time_ns=episode.taxels.sample_ns + 1), wanted)
    with pytest.raises(FormatError, match="19 frames, the recording has 20"):
        frames.check_pair(episode, example.label(episode, time_ns=episode.taxels.sample_ns[1:]), wanted)


def test_features_carry_no_slash_and_all_have_units() -> None:
    described = features.lerobot_features(default_sensor())
    assert not [key for key in described if "/" in key]
    assert {key for key, f in described.items() if "info" in f} == set(features.DTYPES)
    assert all(f["info"]["unit"] for f in described.values() if "info" in f)
    assert described[features.DEPTH]["info"]["is_depth_map"] is True
    assert len(described[features.STATE]["names"]) == 24
