"""Disks that fill up, clocks that jump, results that rot, batches with one deadly press: for real, not by a double."""

import os
import subprocess
import sys
import time

import pytest
from farm_examples import HERE, SENSOR, label_episodes, press_episode
from one_process import OneProcess

from tacdata.errors import TacdataError
from tacdata.label_farm.labels.request import request
from tacdata.label_farm.ledger.ledger import DONE, Ledger
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.store.store import STALE_SECONDS, Store


def episodes(folder, count, **changes):
    return [press_episode(folder, k, x=float(k), **changes) for k in range(count)]


def labels_in(folder):
    return sorted(int(p.stem[-6:]) for p in (folder / "labels").glob("episode-*.parquet"))


def test_one_deadly_press_costs_the_others_of_its_batch_nothing(tmp_path, label_by_workers, solves, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_BATCH", "8")
    monkeypatch.setenv("FAST_MODEL_KILLS", "3")
    summary = label_by_workers(episodes(tmp_path, 8), workers=1)
    assert sorted(summary.written) == [0, 1, 2, 4, 5, 6, 7]
    assert list(summary.failed) == [3] and "signal 9" in summary.failed[3]
    counted = [x for _, x in solves()]
    assert counted.count("3") == 4, "once in company, three times alone"
    assert all(counted.count(str(k)) == 1 for k in (0, 1, 2, 4, 5, 6, 7)), "what was finished before it stays"


def test_a_press_that_fails_does_not_stop_its_batch(tmp_path, label_by_workers, solves, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_BATCH", "8")
    monkeypatch.setenv("FAST_MODEL_FAILS", "2")
    summary = label_by_workers(episodes(tmp_path, 6), workers=1)
    assert sorted(summary.written) == [0, 1, 3, 4, 5] and "no equilibrium" in summary.failed[2]
    assert len({process for process, _ in solves()}) == 1 and len(solves()) == 6


def test_a_damaged_result_is_noticed_and_made_again(tmp_path, label_all, solves):
    label_all(episodes(tmp_path, 3))
    (path,) = [p for p in (tmp_path / "labels" / "store").rglob("*.npz") if b'"x": 1.0' in p.read_bytes()] or [
        next((tmp_path / "labels" / "store").rglob("*.npz"))
    ]
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x55
    path.write_bytes(data)
    for label in (tmp_path / "labels").glob("*.parquet"):
        label.unlink()
    summary = label_all(episodes(tmp_path, 3))
    assert sorted(summary.written) == [0, 1, 2] and summary.found == 2 and len(solves()) == 4
    assert list(path.parent.glob("*.damaged")), "the damaged one is kept aside"


def test_a_result_damaged_after_it_was_counted_is_made_again(tmp_path, label_all, solves):
    """The ledger says done, the store holds rubbish: only the store is believed."""
    episode = press_episode(tmp_path)
    summary = label_all([episode])
    store = Store(tmp_path / "labels" / "store")
    (path,) = store.folder.glob("??/*.npz")
    path.write_bytes(b"")
    (tmp_path / "labels" / "episode-000000.parquet").unlink()
    with Ledger(store.ledger_path) as ledger:
        assert ledger.counts()[DONE] == 1
    again = label_all([episode])
    assert summary.written == again.written == [0] and len(solves()) == 2


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 3 MB; needs the right to mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(disk)], capture_output=True)
    if mounted.returncode:
        pytest.skip("this user may not mount a file system")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


def test_a_full_disk_ends_in_words_and_the_next_run_goes_on(tmp_path, small_disk, solves, quick_version):
    filler = small_disk / "filler"
    filler.write_bytes(b"\0" * 2_400_000)
    presses = [press_episode(tmp_path, k, x=float(k)) for k in range(12)]
    with pytest.raises(TacdataError) as error:
        label_episodes(small_disk / "labels", presses)
    assert "make room" in error.value.remedy and "kept" in error.value.remedy
    results = len(list((small_disk / "labels" / "store").glob("??/*.npz")))
    failures = list(small_disk.rglob("*.failure.json"))
    assert not failures, "no press is to blame"
    filler.unlink()
    begun = len(solves())
    # Labels are large beside this disk: only the store stays on it.
    summary = label_episodes(small_disk / "labels", presses[:4])
    assert sorted([*summary.current, *summary.written]) == [0, 1, 2, 3] and summary.written and not summary.failed
    assert len(solves()) - begun <= 4 and results <= 12


def test_a_service_pauses_while_the_disk_is_full_and_goes_on_when_there_is_room(small_disk):
    from chaos import Service, all_finished, record

    record(small_disk, 1, 4)
    with Service(small_disk, workers=1, seconds=0.2) as service:
        service.client().get("/api/state")
        filler = small_disk / "filler"
        with pytest.raises(OSError), filler.open("wb") as stream:
            while True:
                stream.write(b"\0" * 4096)
                stream.flush()
        room = filler.stat().st_size - 60_000
        os.truncate(filler, room)
        service.client().post("/api/submissions", {"session": "session-0", "by": "ann"})
        said = service.wait(lambda state: state["paused"])
        assert "space" in said or "full" in said or "cannot be written" in said, said
        filler.unlink()
        state = service.wait(lambda state: all_finished(state) and state)
        assert (state["submissions"][0]["state"], state["submissions"][0]["failed"]) == ("done", 0)
        assert state["submissions"][0]["labelled"] == 4
        service.wait(lambda state: not state["paused"])


def test_a_wall_clock_that_jumps_changes_no_lease(tmp_path, monkeypatch):
    """Leases and roster know the monotonic clock alone."""
    job = request(press_episode(tmp_path), SENSOR, "a" * 64, Ladder()).job
    with Ledger(tmp_path / "ledger.sqlite", lease_seconds=30.0) as ledger:
        ledger.enqueue([job])
        assert ledger.claim("elsewhere/1", "a" * 64)
        for jump in (-1e6, 1e6):
            true = time.time
            monkeypatch.setattr(time, "time", lambda jump=jump, true=true: true() + jump)
            assert not ledger.claim("other/2", "a" * 64)
            monkeypatch.undo()
        assert ledger.finish(job.key, "elsewhere/1", 0.0)


def test_a_writer_whose_file_was_swept_after_a_clock_jump_writes_again(tmp_path, label_all, monkeypatch):
    """Another process that believes it to be hours later takes the unfinished file for a dead writer's."""
    from tacdata.label_farm.store import store as module

    label_all([press_episode(tmp_path)])
    store = Store(tmp_path / "labels" / "store")
    job = request(press_episode(tmp_path), SENSOR, "b" * 64, Ladder()).job
    true, swept = module.replacement, []

    def sweeping(path, beside, **how):
        if not swept:
            swept.append(path)
            entered = true(path, beside, **how)

            class Around:
                def __enter__(self):
                    stream = entered.__enter__()
                    for unfinished in (store.folder / "writing").iterdir():
                        os.utime(unfinished, (time.time() - 2 * STALE_SECONDS,) * 2)
                    Store(store.folder)
                    return stream

                def __exit__(self, *error):
                    return entered.__exit__(*error)

            return Around()
        return true(path, beside, **how)

    monkeypatch.setattr(module, "replacement", sweeping)
    from tacdata.label_farm.store.failure import Failure

    store.put_failure(job, Failure("solve", "a reason"))
    assert swept and store.failure(job.key).reason == "a reason"


def test_a_second_run_reads_no_recording_and_no_label(tmp_path, solves, quick_version):
    """By size and time of the files; what changed is read again."""
    presses = episodes(tmp_path, 4)
    reads = []

    def run(**settings):
        from tacdata.label_farm.labelling import FarmSettings, Labelling

        chosen = FarmSettings(factory="fast_model:FastModel", engine=OneProcess, **settings)
        labelling = Labelling(tmp_path / "labels", Store(tmp_path / "store"), chosen)
        recordings = {e.number: lambda e=e: reads.append(e.number) or e for e in presses}
        return labelling.run(recordings, None, {e.number: e.path for e in presses})

    assert sorted(run().written) == [0, 1, 2, 3] and reads == [0, 1, 2, 3]
    reads.clear()
    assert sorted(run().current) == [0, 1, 2, 3] and not reads
    presses[2].path.write_bytes(b"recorded again")
    (tmp_path / "labels" / "episode-000001.parquet").write_bytes(b"rotten")
    again = run()
    assert sorted(again.written) == [1, 2] and sorted(again.current) == [0, 3]
    assert reads == [2, 1] or reads == [1, 2] or sorted(set(reads)) == [1, 2]
    (tmp_path / "labels" / "index.sqlite").write_bytes(b"no database")
    reads.clear()
    assert sorted(run().current) == [0, 1, 2, 3] and sorted(reads) == [0, 1, 2, 3]
    assert len(solves()) == 4


def test_nothing_is_planned_twice_after_a_kill_in_mid_run(tmp_path, solves, monkeypatch):
    """The plan survives: the second run reads a recording once, when its label is written, not to plan it."""
    monkeypatch.setenv("FAST_MODEL_SECONDS", "0.3")
    script = (
        "import sys, os, threading\nfrom pathlib import Path\nfrom farm_examples import press_episode\n"
        "from tacdata.label_farm.labelling import FarmSettings, Labelling\nfrom label_farm.store.store import Store\n"
        "folder = Path(sys.argv[1])\npresses = [press_episode(folder, k, x=float(k)) for k in range(6)]\n"
        "stop = lambda n, r: os.kill(os.getpid(), 9)\n"
        "run = Labelling(folder / 'labels', Store(folder / 'store'),\n"
        "    FarmSettings(factory='fast_model:FastModel', workers=1), delivered=stop)\n"
        "run.run({e.number: (lambda e=e: e) for e in presses}, None, {e.number: e.path for e in presses})\n"
    )
    path = os.pathsep.join([str(HERE), str(HERE.parent.parent)])
    killed = subprocess.run([sys.executable, "-c", script, str(tmp_path)], env={**os.environ, "PYTHONPATH": path})
    assert killed.returncode == -9
    from tacdata.label_farm.labels.label_index import LabelIndex

    index = LabelIndex(tmp_path / "labels")
    assert index.open() and len(index.skins()) == 1
    found = index.find([f"episode-{k:06d}.mcap" for k in range(6)])
    assert len(found) == 6 and all(row.job for row in found.values())
    index.close()
