import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from recording_examples import SENSOR, T0, Press, header

from tacdata.clock import Clock
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.recording import read_episode
from tacdata.recording.clocks import envelope_fit
from tacdata.recording.files import file_names
from tacdata.recording.files import recover as recovery
from tacdata.recording.files.mcap_records import read_records
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.recover import recover
from tacdata.recording.files.writer import EpisodeWriter


@pytest.fixture
def press():
    return Press(camera=True)


def test_what_was_written_is_read_exactly(press, tmp_path):
    path = press.write(tmp_path / "episode-000000.mcap")
    recording = read_recording(path)
    episode = recording.episode
    assert path == tmp_path / "episode-000000.mcap"
    assert episode.complete
    assert episode.notes == ()
    np.testing.assert_array_equal(episode.taxels.counts, press.counts)
    np.testing.assert_array_equal(episode.taxels.counter, press.counter)
    np.testing.assert_array_equal(episode.taxels.arrival_ns, press.arrival)
    model = envelope_fit.fit(press.arrival, press.counter)
    np.testing.assert_array_equal(episode.taxels.sample_ns, model.sample_ns(press.counter))
    np.testing.assert_array_equal(episode.cnc.position, [s.position for s in press.statuses])
    np.testing.assert_array_equal(episode.cnc.arrival_ns, [s.arrival_ns for s in press.statuses])
    assert episode.cnc.state == ("Run",) * len(press.statuses)
    assert episode.press == press.header.press
    assert episode.sensor == SENSOR
    assert episode.rig == press.header.rig
    assert recording.plan == press.header.plan
    assert recording.counts["taxels"]["received"] == len(press.counter)
    (tags,) = episode.tags
    seen = np.arange(len(press.views)) % 3 > 0
    np.testing.assert_array_equal(tags.faces, np.where(seen, 2, 0))
    assert np.isnan(tags.position[~seen]).all()
    np.testing.assert_array_equal(tags.position[seen, 2], 0.4 + 1e-6 * np.flatnonzero(seen))
    np.testing.assert_array_equal(tags.quaternion[seen], np.tile([0.0, 0.6, 0.0, 0.8], (seen.sum(), 1)))


def test_nominal_tip_follows_the_true_path(press, tmp_path):
    episode = read_episode(press.write(tmp_path / "episode-000000.mcap"))
    times = np.arange(T0, press.end, 5_000_000)
    c, s = np.cos(np.radians(5.0)), np.sin(np.radians(5.0))
    dx, dy, dz = (press.position(times) - [10.0, 20.0, -30.0]).T
    truth = np.stack([c * dx + s * dy, -s * dx + c * dy, -dz], axis=-1)
    error = np.abs(episode.tip_at(times) - truth)
    loaded = truth[:, 2] > -0.3
    assert error[loaded].max() < 0.005  # 5 ms at 1 mm/s
    assert episode.tip[:, 2].max() == pytest.approx(0.8, abs=1e-9)
    assert (np.diff(episode.tip_ns) > 0).all()
    assert [p.name for p in episode.phases] == ["rest", "approach", "press", "hold", "release"]
    hold = episode.phases[3]
    assert (hold.end_ns - hold.start_ns) / 1e9 == pytest.approx(0.6, abs=0.02)
    np.testing.assert_allclose(episode.tip_at(np.array([hold.start_ns, hold.end_ns]))[:, 2], 0.8, atol=1e-6)


def test_other_programs_find_times_counters_schemas_and_attachments(press, tmp_path):
    path = press.write(tmp_path / "episode-000000.mcap")
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        names = {schema.name for schema in summary.schemas.values()}
        assert {"tacdata.Taxels", "tacdata.CncStatus", "foxglove.PoseInFrame", "foxglove.CompressedImage"} <= names
        assert {s.encoding for s in summary.schemas.values()} == {"protobuf"}
        first = next(reader.iter_messages(topics="/taxels"))[2]
        assert (first.log_time, first.publish_time) == (press.arrival[0], press.sample[0])
        assert first.sequence == press.counter[0]
        attached = {a.name for a in reader.iter_attachments()}
    assert {"rig.json", "plan.json", "sensor.json", "registration.json", "board.json", "controller.json"} <= attached


def test_a_recording_is_never_overwritten(press, tmp_path):
    path = press.write(tmp_path / "episode-000000.mcap")
    before = path.read_bytes()
    with pytest.raises(UsageError, match="exists"):
        Press().write(path)
    first = Press().write(tmp_path / "episode-000001.mcap", complete=False, reason="cable")
    second = Press().write(tmp_path / "episode-000001.mcap", complete=False, reason="cable")
    assert (first.name, second.name) == ("episode-000001.interrupted-0.mcap", "episode-000001.interrupted-1.mcap")
    assert path.read_bytes() == before
    assert list(file_names.finished(tmp_path)) == [0]
    assert len(file_names.unfinished(tmp_path)) == 2
    episode = read_episode(first)
    assert not episode.complete
    assert "cable" in episode.notes


@pytest.mark.parametrize("share", [0.4, 0.8, 0.999])
def test_a_truncated_file_is_read_as_far_as_it_goes(press, tmp_path, share):
    path = press.write(tmp_path / "episode-000000.mcap")
    whole = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: round(len(whole) * share)])
    episode = read_episode(cut)
    kept = len(episode.taxels.counter)
    assert not episode.complete
    assert any("breaks off" in note or "missing" in note for note in episode.notes)
    np.testing.assert_array_equal(episode.taxels.counts, press.counts[:kept])


def test_a_damaged_chunk_costs_that_chunk_only(press, tmp_path):
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(path, press.header, Clock(T0, 0, 1.0), ("side",))
    writer._file._chunk_seconds = 0.0  # a chunk per message
    press.feed(writer)
    writer.close(True)
    data = bytearray(path.read_bytes())
    chunks = [end for end in record_ends(data)[:-1] if data[end] == 6]
    inside = chunks[len(chunks) // 2] + 60
    data[inside : inside + 3] = b"\xff\x00\xff"
    path.write_bytes(data)
    episode = read_episode(path)
    assert not episode.complete
    assert any("damaged chunk" in note for note in episode.notes)
    total = len(episode.taxels.counter) + len(episode.cnc.arrival_ns)
    assert total >= len(press.counter) + len(press.statuses) - 2


def test_random_damage_gives_an_episode_or_a_clear_refusal(press, tmp_path):
    whole = press.write(tmp_path / "episode-000000.mcap").read_bytes()
    rng = np.random.default_rng(5)
    damaged, read = tmp_path / "damaged.mcap", 0
    for k in range(60):
        data = bytearray(whole)
        if k % 2:
            del data[int(rng.integers(len(data))) :]
        else:
            for place in rng.integers(len(data), size=3):
                data[place] = int(rng.integers(256))
        damaged.write_bytes(data)
        try:
            episode = read_episode(damaged)
        except FormatError:
            continue
        read += 1
        if k % 2:
            assert not episode.complete
        for row, counter in enumerate(episode.taxels.counter):
            np.testing.assert_array_equal(episode.taxels.counts[row], press.counts[counter - 500])
    assert read > 20


@pytest.mark.parametrize("content", [b"", b"not a recording at all" * 50, bytes(range(256)) * 40])
def test_foreign_bytes_are_refused(tmp_path, content):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(FormatError, match="no MCAP file"):
        read_episode(path)
    with pytest.raises(UsageError, match="no file"):
        read_episode(tmp_path / "none.mcap")


def test_an_mcap_of_another_program_is_refused(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "other.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        writer.finish()
    with pytest.raises(FormatError, match=r"press\.json"):
        read_episode(tmp_path / "other.mcap")


def test_recover_writes_what_every_reader_opens(press, tmp_path):
    path = press.write(tmp_path / "episode-000000.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-3000])
    found = recover(cut)
    target = found.path
    assert target == tmp_path / "cut.recovered.mcap"
    assert found.damage
    with target.open("rb") as stream:
        assert make_reader(stream).get_summary().statistics.message_count == found.messages
    before, after = read_records(cut), read_records(target)
    assert [(m.log_time, m.publish_time, m.sequence, m.data) for m in after.messages] == [
        (m.log_time, m.publish_time, m.sequence, m.data) for m in before.messages
    ]
    assert after.damage == []
    episode = read_episode(target)
    assert not episode.complete
    assert any("recovered" in note for note in episode.notes)
    with pytest.raises(UsageError, match="exists"):
        recover(cut)


WRITE_FOREVER = """
import sys, time
sys.path.insert(0, sys.argv[2])
import numpy as np
from pathlib import Path
from recording_examples import header
from tacdata.clock import Clock
from tacdata.devices.device import TaxelFrame
from tacdata.recording.files.writer import EpisodeWriter
clock = Clock.start()
writer = EpisodeWriter(Path(sys.argv[1]), header(), clock)
for k in range(100000):
    now = clock.now_ns()
    writer.taxels(TaxelFrame(now, k, np.full(24, float(k))), now)
    print(k, now, flush=True)
    time.sleep(0.01)
"""


def test_kill_9_costs_at_most_the_last_second(tmp_path):
    path = tmp_path / "episode-000000.mcap"
    here = str(Path(__file__).parents[1])  # the examples lie there
    child = subprocess.Popen([sys.executable, "-c", WRITE_FOREVER, str(path), here], stdout=subprocess.PIPE, text=True)
    lines = []
    begun = None
    while begun is None or time.monotonic() - begun < 2.5:
        lines.append(child.stdout.readline())
        begun = begun or time.monotonic()
    os.kill(child.pid, signal.SIGKILL)
    lines += child.stdout.read().splitlines()
    child.wait()
    child.stdout.close()
    sent = [tuple(map(int, line.split())) for line in lines if len(line.split()) == 2]
    episode = read_episode(file_names.partial(path))
    kept = len(episode.taxels.counter)
    assert kept > 50
    np.testing.assert_array_equal(episode.taxels.counts[:, 0], np.arange(kept))
    assert (sent[-1][1] - episode.taxels.arrival_ns[-1]) / 1e9 < 1.0
    assert not episode.complete


def test_header_of_the_examples_is_what_a_recorder_would_attach():
    assert set(header().attachments) >= {"press.json", "sensor.json", "rig.json", "plan.json", "controller.json"}


def record_ends(data):
    """Return where each record of an MCAP file ends [bytes]."""
    ends, at = [8], 8
    while at + 9 <= len(data) - 8:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        ends.append(at)
    return ends


def test_every_truncation_gives_the_beginning_of_the_recording_or_words(press, tmp_path):
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(path, press.header, Clock(T0, 0, 1.0), ("side",))
    writer._file._chunk_seconds = 0.005
    press.feed(writer)
    writer.close(True)
    data, cut = path.read_bytes(), tmp_path / "cut.mcap"
    whole = read_records(path)
    assert whole.damage == []
    ends = record_ends(data)
    places = {end + shift for end in ends for shift in (-1, 0, 1, 9)} | set(range(0, len(data), 211))
    before = 0
    for place in sorted(p for p in places if p < len(data)):
        cut.write_bytes(data[:place])
        try:
            records = read_records(cut)
        except FormatError:
            assert place < ends[2], "only a file without any content is refused"
            continue
        assert records.damage, place
        assert records.messages == whole.messages[: len(records.messages)]
        assert len(records.messages) >= before
        before = len(records.messages)
    assert before == len(whole.messages)


def test_a_file_cut_before_its_first_message_is_not_recovered(press, tmp_path):
    path = press.write(tmp_path / "episode-000000.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: record_ends(path.read_bytes())[4]])
    with pytest.raises(FormatError, match="before its first message"):
        recover(cut)
    assert not (tmp_path / "cut.recovered.mcap").exists()


def test_a_damaged_length_costs_its_record_only(press, tmp_path):
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(path, press.header, Clock(T0, 0, 1.0), ("side",))
    writer._file._chunk_seconds = 0.0
    press.feed(writer)
    writer.close(True)
    data = bytearray(path.read_bytes())
    whole = len(read_records(path).messages)
    chunk = next(end for end in record_ends(data)[60:] if data[end] == 6)
    data[chunk + 1 : chunk + 9] = b"\xff" * 8
    path.write_bytes(data)
    records = read_records(path)
    assert whole - 3 <= len(records.messages) < whole
    assert any("unreadable bytes" in damage for damage in records.damage)


def test_recover_saves_every_whole_chunk_behind_a_damaged_one(press, tmp_path):
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(path, press.header, Clock(T0, 0, 1.0), ("side",))
    writer._file._chunk_seconds = 0.0
    press.feed(writer)
    writer.close(True)
    data, whole = bytearray(path.read_bytes()), len(read_records(path).messages)
    chunks = [end for end in record_ends(data)[60:] if data[end] == 6]
    data[chunks[0] + 60] ^= 0xFF
    path.write_bytes(data)
    found = recover(path)
    assert whole - 3 <= found.messages < whole
    with found.path.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == found.messages


@pytest.mark.parametrize(("old", "new"), [(b"zstd", b"brot"), (b"zstd", b"lzma"), (b"zstd", b"ZSTD")])
def test_a_compression_that_is_not_known_is_no_reason_to_press_again(press, tmp_path, old, new):
    path = press.write(tmp_path / "episode-000000.mcap")
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(FormatError, match=f"a chunk of the compression '{new.decode()}' is left out") as refused:
        recover(path)
    assert "program that compressed it" in refused.value.remedy and "again with tacdata" not in refused.value.remedy
    notes = read_recording(path).episode.notes
    assert len([note for note in notes if "compression" in note]) == 1


@pytest.mark.parametrize(("number", "words"), [(errno.ENOTCONN, "a drive that answers"), (errno.ENOSPC, "room")])
def test_a_copy_that_cannot_be_written_names_the_true_reason(press, tmp_path, monkeypatch, number, words):
    path = press.write(tmp_path / "episode-000000.mcap")

    def refused(self, mode):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(DeviceError) as error:
        recover(path)
    assert words in error.value.allowed + error.value.remedy


def test_a_copy_that_does_not_read_back_is_no_success(press, tmp_path, monkeypatch):
    path = press.write(tmp_path / "episode-000000.mcap")
    plain = recovery._read_back

    def damaged(found):
        data = bytearray(found.path.read_bytes())
        data[len(data) // 3] ^= 0xFF
        found.path.write_bytes(data)
        plain(found)

    monkeypatch.setattr(recovery, "_read_back", damaged)
    with pytest.raises(DeviceError, match="does not read back"):
        recover(path)
    assert not (tmp_path / "episode-000000.recovered.mcap").exists()
