"""Stock `lerobot-record` finds the plug-in and records emulated boards; lerobot's tools edit and stream the result."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from tacdata.clock import Clock
from tacdata.virtual_rig.board import VirtualBoard, draw_timing
from tacdata.wire import default_format
from tacdata.wire.frames.frame_format import from_document

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "examples" / "lerobot_robot_tacdata"
RATE, BAUD, CHANNELS, STUCK = 150, 460800, 24, 5
pytestmark = pytest.mark.long(
    "examples/lerobot_robot_tacdata",
    "tacdata/recording",
    "tacdata/devices",
    "tacdata/live",
    reason="lerobot-record runs for seconds, with the import of all of lerobot",
)


def installed(site: Path, module: Path, name: str) -> None:
    """Install a module as pip does, as far as lerobot looks: the module and the distribution's name."""
    shutil.copytree(module, site / name) if module.is_dir() else shutil.copy(module, site / f"{name}.py")
    metadata = site / f"{name}-0.1.dist-info" / "METADATA"
    metadata.parent.mkdir()
    metadata.write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A folder with two recorded episodes: `data` by lerobot, `records` by the plug-in; two boards and a network."""
    folder = tmp_path_factory.mktemp("plugin")
    site = folder / "site"
    site.mkdir()
    installed(site, PLUGIN / "lerobot_robot_tacdata", "lerobot_robot_tacdata")
    installed(site, Path(__file__).with_name("lerobot_arm.py"), "lerobot_robot_still")
    layout = {**default_format().document, "rate": RATE}
    (folder / "format.yaml").write_text(yaml.safe_dump(layout))
    clock, rng = Clock.start(), np.random.default_rng(0)
    boards = {
        name: VirtualBoard(
            clock,
            from_document(layout, "test"),
            draw_timing(seed, clock.now_ns(), RATE),
            lambda sampled_ns: 1000 + (np.arange(CHANNELS) != STUCK) * rng.normal(0, 3, CHANNELS).round(),
            BAUD,
            seed,
        )
        for seed, name in enumerate(("thumb", "index"))
    }
    entries = {
        name: {"port": board.port.path, "baud": BAUD, "format": str(folder / "format.yaml")}
        for name, board in boards.items()
    }
    entries["thumb"] |= {"network": "shipped", "tare": 0.3}
    for board in boards.values():
        board.start()
    try:
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "lerobot.scripts.lerobot_record",
                "--robot.type=tacdata",
                "--robot.arm={type: still_arm}",
                f"--robot.boards={json.dumps(entries)}",
                f"--robot.records={folder / 'records'}",
                "--teleop.type=still_hand",
                "--dataset.repo_id=local/touch",
                f"--dataset.root={folder / 'data'}",
                "--dataset.single_task=grasp",
                "--dataset.num_episodes=2",
                "--dataset.episode_time_s=1.5",
                "--dataset.reset_time_s=0.2",
                "--dataset.fps=30",
                "--dataset.video=false",
                "--dataset.push_to_hub=false",
                "--play_sounds=false",
            ],
            env={
                **os.environ,
                "PYTHONPATH": f"{site}{os.pathsep}{ROOT}",
                "HF_HUB_OFFLINE": "1",
                "HF_HOME": str(folder / "hf"),
            },
            capture_output=True,
            text=True,
        )
    finally:
        for board in boards.values():
            board.stop()
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.fixture
def plugin(monkeypatch):
    monkeypatch.syspath_prepend(str(PLUGIN))
    import lerobot_robot_tacdata

    return lerobot_robot_tacdata


def opened(root: Path):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    return LeRobotDataset("local/touch", root=root)


def rows_of(root: Path, episode: int) -> tuple[list[str], np.ndarray]:
    """Return the names and values of an episode's states, shape (rows, names)."""
    dataset = opened(root)
    state = [np.asarray(row["observation.state"]) for row in dataset.hf_dataset if row["episode_index"] == episode]
    return dataset.meta.features["observation.state"]["names"], np.array(state)


def check_rows(plugin, root: Path, records: Path, episode: int) -> None:
    """Every row has, bit for bit, the readings of the sample that it names."""
    names, state = rows_of(root, episode)
    for board, found in plugin.samples(root, episode, records).items():
        columns = [names.index(f"{board}.taxel_{k:02d}.counts") for k in range(CHANNELS)]
        assert np.array_equal(found.counts[found.rows], state[:, columns])
        assert len(found.counts) > 3 * len(state)  # 150 Hz beside 30


def test_every_sample_is_kept_at_its_own_rate_and_every_row_finds_its_own(recorded, plugin):
    from tacdata.recording.files.mcap_records import read_records

    (path,) = (recorded / "records").iterdir()
    records = read_records(path)
    for board in ("thumb", "index"):
        counts = records.metadata[f"stream_counts/taxels {board}"]
        assert (counts["lost"], counts["corrupt"]) == ("0", "0")
        document = json.loads(records.attachments["boards.json"].data)[board]
        assert (document["unit"], document["rate"]["nominal"]) == ("counts", RATE)
    assert json.loads(records.attachments["lerobot.json"].data)["networks"]["thumb"]["network"] == "pattern"
    for episode in (0, 1):
        check_rows(plugin, recorded / "data", recorded / "records", episode)
        for found in plugin.samples(recorded / "data", episode, recorded / "records").values():
            assert 1e9 / np.diff(found.time_ns).mean() == pytest.approx(RATE, rel=0.05)


def test_the_prediction_is_a_feature_and_a_picture(recorded):
    dataset = opened(recorded / "data")
    assert dataset[0]["observation.images.thumb_depth"].shape == (3, 140, 104)
    names, state = rows_of(recorded / "data", 1)
    assert 0.0 <= state[:, names.index("thumb.depth.mm")].max() < 0.1  # nothing touches


def test_rows_find_their_samples_after_delete_split_and_merge(recorded, plugin, tmp_path):
    from lerobot.datasets import dataset_tools as tools

    records = recorded / "records"
    source = opened(recorded / "data")
    tools.delete_episodes(source, episode_indices=[0], output_dir=tmp_path / "later", repo_id="local/later")
    check_rows(plugin, tmp_path / "later", records, 0)
    parts = tools.split_dataset(source, {"first": [0], "second": [1]}, output_dir=tmp_path / "parts")
    tools.merge_datasets([parts["second"], parts["first"]], output_repo_id="local/both", output_dir=tmp_path / "both")
    for episode in (0, 1):
        check_rows(plugin, tmp_path / "both", records, episode)
    first, last = (plugin.samples(tmp_path / "both", k, records)["thumb"].time_ns[0] for k in (1, 0))
    assert first < last  # the order of the merge, and each with its own samples


def test_lerobot_streams_it(recorded):
    from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset

    stream = StreamingLeRobotDataset("local/touch", root=recorded / "data", shuffle=False)
    assert sum(1 for _ in stream) == len(opened(recorded / "data"))


def test_recordings_and_channels_go_into_the_folder_that_is_pushed(recorded, plugin, tmp_path, monkeypatch, capsys):
    from lerobot.datasets import dataset_tools as tools
    from lerobot_robot_tacdata.samples import main

    from tacdata.sensor import default_sensor

    shutil.copytree(recorded / "data", tmp_path / "data")
    monkeypatch.setattr(sys, "argv", ["samples", str(tmp_path / "data"), str(recorded / "records")])
    main()
    printed = capsys.readouterr().out
    assert "1 recordings in" in printed
    assert printed.count(f"stuck or saturated: channels [{STUCK}]") == 4, printed  # two boards, two episodes
    check_rows(plugin, tmp_path / "data", tmp_path / "data" / "tacdata", 0)
    parts = tools.split_dataset(opened(tmp_path / "data"), {"a": [0], "b": [1]}, output_dir=tmp_path / "parts")
    merged = tools.merge_datasets([parts["b"], parts["a"]], output_repo_id="local/m", output_dir=tmp_path / "m")
    described = merged.meta.features["observation.state"]["info"]["channels"]
    places = default_sensor().taxels.centers
    for board in ("thumb", "index"):
        entry = described[f"{board}.taxel_07.counts"]
        assert entry == {"unit": "counts", "frame": f"skin of {board}", "place_mm": places[7].tolist()}
    assert len(described) == 2 * CHANNELS
    assert not plugin.samples(tmp_path / "data", 1, tmp_path / "data" / "tacdata")["index"].valid[STUCK]
