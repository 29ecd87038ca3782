"""Writing and reading back: values, crashes, appending, refusals."""

import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import press_example as example
import pyarrow.parquet as pq
import pytest

from tacdata import documents
from tacdata.dataset import DatasetWriter, LostProvenanceWarning, frames, pack, read_dataset, restore
from tacdata.dataset.format import features, folder, metadata
from tacdata.errors import FormatError, UsageError
from tacdata.sensor import default_sensor


def packed(root: Path, numbers=range(3), **options) -> Path:
    pack([example.episode(n) for n in numbers], example.label, root, **options)
    return root


def other_sensor():
    sensor = default_sensor()
    return replace(sensor, name="stiffer", material=replace(sensor.material, youngs_modulus=0.4))


def test_every_value_comes_back(tmp_path: Path) -> None:
    dataset = read_dataset(packed(tmp_path / "d"))
    assert len(dataset) == 60
    assert dataset.units[features.DEPTH] == "mm"
    assert dataset.sensor == default_sensor()
    for episode in dataset.episodes:
        recorded = example.episode(episode.index)
        wanted = frames.episode_columns(recorded, example.label(recorded))
        for key, values in wanted.items():
            found = dataset[key][episode.start : episode.stop]
            if key == features.DEPTH:
                # Stored in metres: the way there and back costs at most one unit in the last place.
                assert np.abs(found - values).max() <= np.spacing(np.float32(1.5))
            else:
                assert np.array_equal(found, features.cast(key, values)), key
        assert episode.press == recorded.press
        assert episode.record.label_provenance["parents"]["model"] == "c" * 64
        assert episode.record.virtual
        assert episode.task == f"press the skin with sphere{episode.index % 2}"
    assert np.array_equal(dataset["index"], np.arange(60))
    assert isinstance(dataset[features.STATE], np.memmap)


def test_pack_says_what_it_left_out(tmp_path: Path) -> None:
    broken = example.episode(3)
    counts = broken.taxels.counts.copy()
    counts[7, 2] = np.nan
    broken = replace(broken, taxels=replace(broken.taxels, counts=counts))
    episodes = [example.episode(0), example.episode(1), example.episode(2, rest=False), broken]
    result = pack(episodes, lambda e: None if e.number == 1 else example.label(e), tmp_path / "d")
    assert (result.episodes, result.frames) == (1, 20)
    reasons = dict(result.left_out)
    assert reasons["episode-000001.mcap"] == "it has no label"
    assert "rest phase" in reasons["episode-000002.mcap"]
    assert "not finite (first in frame 7)" in reasons["episode-000003.mcap"]
    assert len(read_dataset(tmp_path / "d").episodes) == 1


def test_nothing_to_pack_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="it has no label"):
        pack([example.episode(0)], lambda e: None, tmp_path / "d")
    assert not (tmp_path / "d").exists()


def test_an_existing_folder_is_not_touched(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    before = {p: p.read_bytes() for p in root.rglob("*") if p.is_file()}
    with pytest.raises(UsageError, match="exists"):
        packed(root)
    with pytest.raises(UsageError, match="exists"):
        DatasetWriter.create(root, default_sensor())
    assert {p: p.read_bytes() for p in root.rglob("*") if p.is_file()} == before


def test_appending_later_adds_only_what_is_new(tmp_path: Path) -> None:
    root = packed(tmp_path / "d", range(2))
    result = pack([example.episode(n) for n in range(4)], example.label, root, append=True)
    assert result.episodes == 2
    assert [reason for _, reason in result.left_out] == ["the dataset holds it already"] * 2
    later, once = read_dataset(root), read_dataset(packed(tmp_path / "once", range(4)))
    for key in once.columns:
        assert np.array_equal(later[key], once[key]), key
    assert stats(root).keys() == stats(tmp_path / "once").keys()
    for key, values in stats(root).items():
        for name in ("mean", "std", "min", "max", "count"):
            assert np.allclose(values[name], stats(tmp_path / "once")[key][name], rtol=1e-12, atol=1e-12), (key, name)


def stats(root: Path) -> dict:
    return json.loads((root / folder.STATS).read_text())


def test_statistics_of_the_dataset(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    dataset = read_dataset(root)
    state, depth = dataset[features.STATE].astype(float), dataset[features.DEPTH].astype(float) / 1000
    assert np.allclose(stats(root)[features.STATE]["std"], state.std(axis=0))
    assert np.allclose(np.ravel(stats(root)[features.DEPTH]["mean"]), depth.mean())
    assert np.shape(stats(root)[features.DEPTH]["q50"]) == (1, 1, 1)


CRASHES = {
    "data": (folder, "write_parquet"),
    "record": (metadata, "append_record"),
    "row": (folder, "write_row"),
    "tasks": (folder, "write_tasks"),
    "stats": (folder, "write_stats"),
}


@pytest.mark.parametrize("stage", [*CRASHES, "info"])
@pytest.mark.parametrize("earlier", [0, 2])
def test_a_crash_costs_only_the_episode_being_written(tmp_path: Path, monkeypatch, stage: str, earlier: int) -> None:
    root = tmp_path / "d"
    if earlier:
        packed(root, range(earlier))

    class Crash(BaseException):
        pass

    def crash(*args, **kwargs):
        raise Crash

    real = documents.write_text
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", lambda *_, **__: None)  # a power cut tidies nothing up
        if stage == "info":
            patch.setattr(
                documents, "write_text", lambda path, text: crash() if path.name == "info.json" else real(path, text)
            )
        else:
            patch.setattr(*CRASHES[stage], crash)
        newcomer = example.episode(earlier)
        # Another name makes a task that the dataset does not know, so that the tasks are written too.
        newcomer = replace(newcomer, press=replace(newcomer.press, indenter_name="other"))
        with pytest.raises(Crash):
            pack([newcomer], example.label, root, append=True)
    if earlier:
        assert len(read_dataset(root).episodes) == earlier
    pack([example.episode(n) for n in range(earlier, earlier + 2)], example.label, root, append=True)
    dataset = read_dataset(root)
    assert [e.press.index for e in dataset.episodes] == list(range(earlier + 2))
    assert stats(root)["index"]["count"] == [20 * (earlier + 2)]
    assert not list(root.rglob(".*"))


def test_an_interrupted_first_episode_leaves_no_folder(tmp_path: Path, monkeypatch) -> None:
    root = tmp_path / "d"

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(folder, "write_stats", interrupted)
        with pytest.raises(KeyboardInterrupt):
            packed(root)
        assert not root.exists()
        packed_before = tmp_path / "other"
        patch.setattr(shutil, "rmtree", lambda *_, **__: None)
        with pytest.raises(KeyboardInterrupt):
            packed(packed_before)
    with pytest.raises(UsageError, match="never finished") as error:
        packed(packed_before)
    assert "--append" in error.value.remedy
    assert len(read_dataset(packed(packed_before, append=True)).episodes) == 3


def test_a_killed_process_leaves_a_readable_dataset(tmp_path: Path) -> None:
    script = (
        "import sys, itertools; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "import press_example as x\n"
        "from tacdata.dataset import pack\n"
        "pack((x.episode(n) for n in itertools.count()), x.label, Path(sys.argv[2]),"
        " done=lambda e, reason: print(e.number, flush=True))"
    )
    root = tmp_path / "d"
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(Path(__file__).parent), str(root)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    told = [process.stdout.readline() for _ in range(5)][-1]
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert told.strip() == "4"
    dataset = read_dataset(root)
    assert len(dataset.episodes) >= 5
    assert np.isfinite(dataset[features.STATE]).all()


def test_two_sensors_in_one_dataset(tmp_path: Path) -> None:
    root = packed(tmp_path / "d", range(2))
    pack([example.episode(2, sensor=other_sensor())], example.label, root, append=True)
    dataset = read_dataset(root)
    assert [dataset.sensors[e.sensor].name for e in dataset.episodes] == ["tacprint", "tacprint", "stiffer"]
    with pytest.raises(FormatError, match="2 sensors"):
        _ = dataset.sensor


def test_a_sensor_with_other_taxels_needs_its_own_dataset(tmp_path: Path) -> None:
    root = packed(tmp_path / "d", range(1))
    sensor = default_sensor()
    small = replace(sensor, taxels=replace(sensor.taxels, columns=5))
    with pytest.raises(FormatError, match=r"observation\.state is float32 \[24\]"):
        pack([example.episode(5, sensor=small)], example.label, root, append=True)


def test_a_writer_refuses_wrong_columns(tmp_path: Path) -> None:
    episode = example.episode()
    label = example.label(episode)
    columns = frames.episode_columns(episode, label)
    record = frames.episode_record(episode, label, "a" * 64, episode.sensor)
    target = DatasetWriter.create(tmp_path / "d", episode.sensor)
    for change, word in [
        ({features.DEPTH: columns[features.DEPTH][:, :, :25]}, r"\(20, 35, 26\)"),
        ({features.STATE: columns[features.STATE][:, :23]}, r"\(20, 24\)"),
        ({"extra": columns[features.STATE]}, "extra missing or unknown"),
    ]:
        with pytest.raises(FormatError, match=word):
            target.append({**columns, **change}, record, "press")
    with pytest.raises(FormatError, match="is of sensor"):
        target.append(columns, replace(record, sensor="e" * 64), "press")
    assert not (tmp_path / "d").exists()
    target.append(columns, record, "press")
    with pytest.raises(UsageError, match="already"):
        target.append(columns, record, "press")


def test_lost_metadata_is_noticed_and_found_again(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    whole = read_dataset(root)
    (root / metadata.MAIN).unlink()
    (root / metadata.RECORDS).unlink()
    with pytest.warns(LostProvenanceWarning, match="taken from the data files"):
        again = read_dataset(root)
    assert again.episodes == whole.episodes
    for path in root.glob("data/*/*.parquet"):
        strip_stamp(path)
    with pytest.raises(FormatError, match=r"no meta/tacdata\.json"):
        read_dataset(root)


def strip_stamp(path: Path) -> None:
    table = pq.read_table(path)
    pq.write_table(table.replace_schema_metadata({}), path)


def test_restoring_takes_only_what_belongs(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    kept = {p: p.read_bytes() for p in (root / metadata.MAIN, root / metadata.RECORDS)}
    source = tmp_path / "source"
    for path, content in kept.items():
        (source / path.relative_to(root)).parent.mkdir(parents=True, exist_ok=True)
        (source / path.relative_to(root)).write_bytes(content)
        path.unlink()
    for path in root.glob("data/*/*.parquet"):
        strip_stamp(path)
    foreign = tmp_path / "foreign"
    pack([example.episode(9, sensor=other_sensor())], example.label, foreign)
    with pytest.raises(FormatError, match="no source describes"):
        restore(root, [foreign])
    assert restore(root, [foreign, source]) == []
    dataset = read_dataset(root)
    assert [s.name for s in dataset.sensors.values()] == ["tacprint"]
    assert [e.press.index for e in dataset.episodes] == [0, 1, 2]


def test_another_sensors_description_is_refused(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    foreign = tmp_path / "foreign"
    pack([example.episode(9, sensor=other_sensor())], example.label, foreign)
    (root / metadata.MAIN).write_bytes((foreign / metadata.MAIN).read_bytes())
    with pytest.raises(FormatError, match=r"episode 0 is of sensor"):
        read_dataset(root)
    main = json.loads((foreign / metadata.MAIN).read_text())
    next(iter(main["sensors"].values()))["material"]["youngs_modulus"] = 300.0
    (root / metadata.MAIN).write_text(json.dumps(main))
    with pytest.raises(FormatError, match="is not the one that it was filed for"):
        read_dataset(root)


def test_lost_records_are_a_warning(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    lines = (root / metadata.RECORDS).read_text().splitlines()
    (root / metadata.RECORDS).write_text(lines[0] + "\n" + lines[1][:50])
    with pytest.warns(LostProvenanceWarning, match=r"2 of 3 episodes \(first: 1\)"):
        dataset = read_dataset(root)
    assert dataset.episodes[1].press is None


def test_maps_are_made_once_and_anew_after_a_change(tmp_path: Path, own_cache: Path) -> None:
    root = packed(tmp_path / "d", range(2))
    first = read_dataset(root)
    made = {p: p.stat().st_mtime_ns for p in own_cache.rglob("*.npy")}
    assert made
    assert read_dataset(root).content_hash == first.content_hash
    assert {p: p.stat().st_mtime_ns for p in own_cache.rglob("*.npy")} == made
    packed(root, range(4), append=True)
    second = read_dataset(root)
    assert second.content_hash != first.content_hash
    assert len(second) == 80
    assert len(list(own_cache.rglob("index.npy"))) == 1
    assert len(first[features.STATE]) == 40  # an open map stays whole


@pytest.mark.parametrize(
    ("damage", "kind", "word"),
    [
        (lambda root: root.rename(root.parent / "away"), UsageError, "no folder"),
        (lambda root: (root / folder.INFO).unlink(), UsageError, "info.json is missing"),
        (lambda root: (root / folder.INFO).write_text("{"), FormatError, "unreadable"),
        (lambda root: edit_info(root, codebase_version="v2.1"), FormatError, "LeRobot format v2.1"),
        (lambda root: edit_info(root, codebase_version="v2.1"), FormatError, "convert_dataset_v21_to_v30"),
        (lambda root: edit_info(root, codebase_version="v2.0"), FormatError, "convert_dataset_v20_to_v21"),
        (lambda root: edit_info(root, codebase_version="v1.6"), FormatError, "pack the session again"),
        (lambda root: edit_info(root, fps=29.97), FormatError, "29.97 frames a second"),
        (lambda root: edit_info(root, total_episodes=7), FormatError, "describes 3 episodes"),
        (lambda root: edit_info(root, features={"action": {}}), FormatError, "LeRobot dataset without observation"),
        (lambda root: cut(root / folder.data_path(1)), FormatError, "damaged"),
        (lambda root: flip(root / folder.data_path(1)), FormatError, "damaged"),
        (lambda root: (root / folder.data_path(1)).unlink(), FormatError, "is missing"),
        (lambda root: (root / folder.row_path(2)).unlink(), FormatError, "describes 2 episodes"),
        (lambda root: swap(root / folder.data_path(0), root / folder.data_path(1)), FormatError, "frames are not 0"),
        (lambda root: edit_units(root), FormatError, r"observation\.state is in pF"),
    ],
)
def test_damaged_and_foreign_folders_are_refused_in_words(tmp_path: Path, damage, kind, word: str) -> None:
    root = packed(tmp_path / "d")
    damage(root)
    with pytest.raises(kind, match=word) as caught:
        read_dataset(root)
    assert caught.value.remedy


def test_a_rate_written_with_a_point_is_the_same_rate(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    rate = read_dataset(root).fps
    edit_info(root, fps=float(rate))
    found = read_dataset(root).fps
    assert found == rate and isinstance(found, int)


def edit_info(root: Path, **changes) -> None:
    info = json.loads((root / folder.INFO).read_text())
    (root / folder.INFO).write_text(json.dumps({**info, **changes}))


def edit_units(root: Path) -> None:
    info = json.loads((root / folder.INFO).read_text())
    info["features"][features.STATE]["info"]["unit"] = "pF"
    (root / folder.INFO).write_text(json.dumps(info))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(content))


def swap(one: Path, other: Path) -> None:
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)


def test_plain_pyarrow_and_pandas_free_reading(tmp_path: Path) -> None:
    root = packed(tmp_path / "d")
    table = pq.read_table(root / folder.data_path(1))
    assert table[features.TIME].to_pylist()[0] == int(example.episode(1).taxels.sample_ns[0])
    stamp = json.loads(table.schema.metadata[metadata.SHARD_KEY])
    assert stamp["units"][features.STATE] == "counts"
    assert stamp["sensor_hash"] == default_sensor().content_hash
    row = pq.read_table(root / folder.row_path(1)).to_pylist()[0]
    assert row["tacdata/indenter"] == "sphere"
    assert row["tacdata/quality"] == 1.0
