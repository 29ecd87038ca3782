"""The real lerobot opens, compares, deletes from, splits, merges and resumes our folders; no network."""

import json
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import press_example as example
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from tacdata.dataset import LostProvenanceWarning, frames, pack, read_dataset, restore
from tacdata.dataset.format import features, folder, metadata
from tacdata.dataset.windows import WindowDataset, centred
from tacdata.errors import FormatError
from tacdata.sensor import default_sensor

COUNT, FRAMES = 4, 20
WINDOW = {features.STATE: centred(9), features.DEPTH: (-1, 0)}


@pytest.fixture(scope="module")
def lerobot():
    from lerobot.datasets import dataset_tools, lerobot_dataset

    class LeRobot:
        tools = dataset_tools

        @staticmethod
        def open(root: Path, **options):
            return lerobot_dataset.LeRobotDataset("local/test", root=root, **options)

        @staticmethod
        def resume(root: Path):
            return lerobot_dataset.LeRobotDataset.resume("local/test", root=root)

    return LeRobot


@pytest.fixture(scope="module")
def packed(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("lerobot") / "d"
    pack([example.episode(n, FRAMES) for n in range(COUNT)], example.label, root)
    return root


def equal(ours: dict, theirs: dict) -> None:
    """Every key, type, shape and value of an item is the same."""
    assert set(ours) == set(theirs)
    for key, value in theirs.items():
        if isinstance(value, torch.Tensor):
            assert ours[key].dtype == value.dtype, key
            assert ours[key].shape == value.shape, key
            assert torch.equal(ours[key], value), key
        else:
            assert ours[key] == value, key


def same_as_recorded(dataset, numbers) -> None:
    """Episode by episode, LeRobot gives the values that went in."""
    assert dataset.num_episodes == len(numbers)
    for place, number in enumerate(numbers):
        recorded = example.episode(number, FRAMES)
        wanted = frames.episode_columns(recorded, example.label(recorded))
        for frame in (0, FRAMES - 1):
            item = dataset[place * FRAMES + frame]
            assert item["episode_index"] == place
            for key, values in wanted.items():
                value = features.cast(key, values)[frame]
                if key == features.DEPTH:
                    assert np.abs(item[key].numpy()[0] - value).max() <= np.spacing(np.float32(1.5))
                else:
                    assert np.array_equal(item[key].numpy(), value), key


def test_lerobot_opens_it_and_gives_the_same_windows(lerobot, packed: Path) -> None:
    deltas = {key: [offset / 30 for offset in offsets] for key, offsets in WINDOW.items()}
    theirs = lerobot.open(packed, delta_timestamps=deltas)
    ours = WindowDataset(read_dataset(packed), WINDOW)
    assert len(ours) == len(theirs) == COUNT * FRAMES
    assert theirs.meta.robot_type == "tacprint"
    for frame in (*range(2 * FRAMES), len(ours) - 1):
        equal(ours[frame], theirs[frame])
    same_as_recorded(lerobot.open(packed), range(COUNT))


def test_columns_that_were_asked_for_open_and_outlive_an_edit(lerobot, tmp_path: Path) -> None:
    def knowing(episode):
        label = example.label(episode)
        maps = np.random.default_rng(episode.number).random(label.signed.shape).astype(np.float16)
        return replace(label, uncertainty=maps, interpolation_error=label.error)

    extra = features.asked_for(["uncertainty", "interpolation_error"])
    pack([example.episode(n, FRAMES) for n in range(2)], knowing, tmp_path / "d", extra=extra)
    whole = lerobot.open(tmp_path / "d")
    frame = WindowDataset(read_dataset(tmp_path / "d"), {features.STATE: (0,)})[FRAMES + 3]
    for key in extra:
        assert torch.equal(frame[key], whole[FRAMES + 3][key]), key
    fewer = lerobot.tools.delete_episodes(whole, [0], output_dir=tmp_path / "fewer", repo_id="local/fewer")
    maps = knowing(example.episode(1, FRAMES)).uncertainty.reshape(FRAMES, -1).astype(np.float32)
    assert np.array_equal(fewer[3]["tacdata.uncertainty"].numpy(), maps[3])
    kept = read_after_edit(tmp_path / "fewer", tmp_path / "d")
    assert np.array_equal(kept["tacdata.uncertainty"], maps) and kept.units["tacdata.uncertainty"] == "mm"


def test_lerobot_streams_it(lerobot, packed: Path) -> None:
    from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset

    deltas = {features.STATE: [offset / 30 for offset in centred(9)]}
    ours, seen = WindowDataset(read_dataset(packed)), 0
    for item in StreamingLeRobotDataset("local/test", root=packed, delta_timestamps=deltas, shuffle=False):
        wanted = ours[int(item["index"])]
        assert torch.equal(item[features.STATE], wanted[features.STATE])
        assert torch.equal(item[features.DEPTH], wanted[features.DEPTH])
        assert item[features.TIME] == wanted[features.TIME]
        seen += 1
    assert seen == COUNT * FRAMES


def test_lerobot_filters_by_our_columns_and_takes_the_map_for_a_depth_image(lerobot, packed: Path) -> None:
    chosen = lerobot.open(packed, episode_filter=lambda row: row["tacdata/indenter"] == "sphere")
    assert chosen.num_episodes == COUNT
    assert lerobot.open(packed, episodes=[1, 3]).num_frames == 2 * FRAMES
    assert chosen.meta.depth_keys == [features.DEPTH]
    assert chosen.meta.names[features.STATE][7] == "taxel_1_1"


def test_lerobots_statistics_are_ours(lerobot, packed: Path) -> None:
    from lerobot.datasets.compute_stats import aggregate_stats, get_feature_stats

    stats = lerobot.open(packed).meta.stats
    data = read_dataset(packed)
    assert set(stats) == set(data.columns)
    state = get_feature_stats(np.asarray(data[features.STATE]), axis=0, keepdims=False)
    # Stored in metres; LeRobot gives them, as the maps, in millimetres.
    maps = np.asarray(data[features.DEPTH], dtype=np.float64)[:, None]
    depth = get_feature_stats(maps, (0, 2, 3), keepdims=True)
    depth = {name: value if name == "count" else value[0] for name, value in depth.items()}
    for key, wanted in ((features.STATE, state), (features.DEPTH, depth)):
        for name in ("min", "max", "mean", "std", "count"):
            assert stats[key][name].shape == wanted[name].shape, (key, name)
            assert np.allclose(stats[key][name], wanted[name], rtol=2e-3), (key, name)
    aggregate_stats([stats, stats])  # checks types and shapes


def read_after_edit(root: Path, source: Path):
    """An edit drops our metadata: that is noticed, and the original gives it back."""
    with pytest.raises(FormatError, match=r"no meta/tacdata\.json"):
        read_dataset(root)
    assert restore(root, [source]) == []
    return read_dataset(root)


def test_delete_split_merge(lerobot, packed: Path, tmp_path: Path) -> None:
    whole = lerobot.open(packed)
    fewer = lerobot.tools.delete_episodes(whole, [1], output_dir=tmp_path / "fewer", repo_id="local/fewer")
    same_as_recorded(fewer, [0, 2, 3])
    parts = lerobot.tools.split_dataset(whole, {"a": [0, 3], "b": [1]}, output_dir=tmp_path / "parts")
    same_as_recorded(parts["a"], [0, 3])
    same_as_recorded(parts["b"], [1])
    merged = lerobot.tools.merge_datasets(
        [parts["a"], parts["b"]], output_repo_id="local/merged", output_dir=tmp_path / "merged"
    )
    same_as_recorded(merged, [0, 3, 1])
    for root, numbers in ((tmp_path / "fewer", [0, 2, 3]), (tmp_path / "merged", [0, 3, 1])):
        data = read_after_edit(root, packed)
        assert [episode.press.index for episode in data.episodes] == numbers
        theirs = lerobot.open(root)
        ours = WindowDataset(data, {})
        for frame in (0, FRAMES, len(ours) - 1):
            equal(ours[frame], theirs[frame])
        # Both writers may go on with it.
        pack([example.episode(7, FRAMES)], example.label, root, append=True)
        same_as_recorded(lerobot.open(root), [*numbers, 7])
        info = json.loads((root / "meta/info.json").read_text())
        assert info["features"][features.STATE]["info"] == {"unit": "counts"}


def test_removing_a_column_is_noticed(lerobot, packed: Path, tmp_path: Path) -> None:
    lerobot.tools.remove_feature(
        lerobot.open(packed), [features.FORCE, features.TIME], output_dir=tmp_path / "less", repo_id="local/less"
    )
    with pytest.raises(FormatError, match=r"without tacdata\.force, tacdata\.time_ns"):
        read_dataset(tmp_path / "less")


def add_by_lerobot(dataset, number: int, sensor_key: int) -> None:
    recorded = example.episode(number, FRAMES)
    columns = frames.episode_columns(recorded, example.label(recorded))
    for frame in range(FRAMES):
        values = {key: np.atleast_1d(features.cast(key, column)[frame]) for key, column in columns.items()}
        values[features.DEPTH] = values[features.DEPTH][..., None] / np.float32(1000)
        extra = {features.SENSOR: np.array([sensor_key]), features.RECORD: np.array([0]), "task": "by hand"}
        dataset.add_frame({**values, **extra})
    dataset.save_episode()


def test_resume_by_lerobots_own_writer(lerobot, packed: Path, tmp_path: Path) -> None:
    root = tmp_path / "d"
    shutil.copytree(packed, root)
    dataset = lerobot.resume(root)
    add_by_lerobot(dataset, 8, features.short_hash(default_sensor().content_hash))
    dataset.finalize()
    same_as_recorded(lerobot.open(root), [0, 1, 2, 3, 8])
    with pytest.warns(LostProvenanceWarning, match=r"1 of 5 episodes \(first: 4\)"):
        data = read_dataset(root)
    assert data.episodes[4].task == "by hand"
    assert data.episodes[4].record is None
    assert data.sensor == default_sensor()
    pack([example.episode(9, FRAMES)], example.label, root, append=True)
    same_as_recorded(lerobot.open(root), [0, 1, 2, 3, 8, 9])


def test_an_episode_of_an_unknown_sensor_is_refused(lerobot, packed: Path, tmp_path: Path) -> None:
    root = tmp_path / "d"
    shutil.copytree(packed, root)
    dataset = lerobot.resume(root)
    add_by_lerobot(dataset, 8, 12345)
    dataset.finalize()
    with pytest.raises(FormatError, match="episode 4 is of sensor 000000000003039"):
        read_dataset(root)


def test_lerobot_opens_what_a_crash_of_ours_left(lerobot, packed: Path, tmp_path: Path, monkeypatch) -> None:
    root = tmp_path / "d"
    shutil.copytree(packed, root)

    def crash(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(folder, "write_stats", crash)
    with pytest.raises(KeyboardInterrupt):
        pack([example.episode(9, FRAMES)], example.label, root, append=True)
    assert (root / folder.row_path(COUNT)).exists()
    same_as_recorded(lerobot.open(root), range(COUNT))


def test_a_dataset_that_lerobot_never_finished(lerobot, packed: Path, tmp_path: Path) -> None:
    root = tmp_path / "d"
    shutil.copytree(packed, root)
    data_file = root / "data/chunk-000/file-004.parquet"
    data_file.write_bytes(b"PAR1 no footer")
    # Nothing of it counts, so it does not disturb us, and appending replaces it.
    assert len(read_dataset(root)) == COUNT * FRAMES
    pack([example.episode(9, FRAMES)], example.label, root, append=True)
    same_as_recorded(lerobot.open(root), [0, 1, 2, 3, 9])
    assert (root / metadata.RECORDS).read_text().count("\n") == COUNT + 1


def older(root: Path) -> None:
    """A folder as lerobot wrote it up to 0.3: a file an episode, its metadata as lines of JSON."""
    shapes = {"observation.state": 2, "timestamp": 1, "frame_index": 1, "episode_index": 1, "index": 1, "task_index": 1}
    described = {
        k: {"dtype": "float32" if k[0] in "ot" and k != "task_index" else "int64", "shape": [n], "names": None}
        for k, n in shapes.items()
    }
    frames_of = np.arange(FRAMES)
    for number in range(2):
        table = {
            "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(np.ones(2 * FRAMES, np.float32)), 2),
            "timestamp": (frames_of / 30).astype(np.float32),
            "frame_index": frames_of,
            "episode_index": np.full(FRAMES, number),
            "index": frames_of + number * FRAMES,
            "task_index": np.zeros(FRAMES, np.int64),
        }
        path = root / f"data/chunk-000/episode_{number:06d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.table(table), path)
    info = {
        "codebase_version": "v2.1",
        "robot_type": "x",
        "total_episodes": 2,
        "total_frames": 2 * FRAMES,
        "total_tasks": 1,
        "total_videos": 0,
        "total_chunks": 1,
        "chunks_size": 1000,
        "fps": 30,
        "splits": {"train": "0:2"},
        "video_path": None,
        "features": described,
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    }
    stats = {k: {**{s: [0.5] * n for s in ("min", "max", "mean", "std")}, "count": [FRAMES]} for k, n in shapes.items()}
    lines = {
        "tasks": [{"task_index": 0, "task": "press"}],
        "episodes": [{"episode_index": k, "tasks": ["press"], "length": FRAMES} for k in range(2)],
        "episodes_stats": [{"episode_index": k, "stats": stats} for k in range(2)],
    }
    (root / "meta").mkdir()
    (root / "meta/info.json").write_text(json.dumps(info))
    for name, entries in lines.items():
        (root / f"meta/{name}.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in entries))


@pytest.mark.long("tacdata/dataset", reason="lerobot converts a folder in a process of its own")
def test_a_folder_of_the_version_before_is_refused_with_the_command_that_converts_it(lerobot, tmp_path: Path) -> None:
    root = tmp_path / "my set"
    older(root)
    with pytest.raises(FormatError, match=r"LeRobot format v2\.1") as error:
        read_dataset(root)
    command = shlex.split(error.value.remedy.split("  (")[0])
    done = subprocess.run([sys.executable, *command[1:]], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert lerobot.open(root).num_frames == 2 * FRAMES
    with pytest.raises(FormatError, match="LeRobot dataset without"):
        read_dataset(root)
