"""The simulated world keeps its promises, and the recorder keeps its own in it: some seeds of many."""

import numpy as np
import pytest
from schedule import SECOND, Hung, Schedule
from simulated_host import SimulatedHost
from simulated_rig import World
from simulated_run import play

from tacdata.errors import DeviceError
from tacdata.recording.files.reader import read_recording

CLAIM_NS = 15_000_000
"""Greatest median uncertainty of a report against the nominal path [ns]: 8 ms of a line's round trip, 7 ms of half a
query's."""


@pytest.fixture
def host():
    return SimulatedHost(Schedule(0, 100.0))


def test_time_passes_only_while_everybody_waits(host):
    woke = []

    def sleeper():
        for _ in range(3):
            host.sleep(1.0)
            woke.append(round(host.schedule.now, 2))

    def main():
        thread = host.thread(sleeper, "sleeper")
        thread.start()
        thread.join()
        return host.schedule.now

    assert host.run(main) == pytest.approx(3.0, abs=0.01)
    assert woke == [1.0, 2.0, 3.0]


def test_a_lock_lets_one_in(host):
    host.preempt, inside, most = 0.5, [], []
    lock = host.lock()

    def work():
        for _ in range(20):
            with lock:
                inside.append(1)
                most.append(len(inside))
                host.sleep(0.01)
                inside.pop()

    def main():
        threads = [host.thread(work, f"worker {k}") for k in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    host.run(main)
    assert max(most) == 1 and len(most) == 60


def test_who_waits_for_each_other_is_found(host):
    first, second = host.event(), host.event()

    def other():
        second.wait()
        first.set()

    def main():
        host.thread(other, "other").start()
        first.wait()

    with pytest.raises(Hung, match="other"):
        host.run(main)


def test_a_stalled_computer_wakes_late(host):
    host.stalls.append((SECOND // 2, 5 * SECOND))

    def main():
        host.sleep(1.0)
        return host.schedule.now

    assert 5.0 <= host.run(main) < 5.01


def test_a_killed_process_does_nothing_more(host):
    done = []

    def main():
        for _ in range(100):
            host.sleep(0.1)
            done.append(host.schedule.now)

    host.schedule.at(SECOND, host.kill)
    host.run(main)
    assert len(done) == 9


def test_a_seed_plays_the_same_each_time(tmp_path):
    paths = []
    for k in range(2):
        world = World(7, tmp_path / str(k) / "session")
        world.computer.preempt = 0.2
        assert len(world.record().done) == 2
        world.end()
        paths.append(world.path)
    assert paths[0] == paths[1]


@pytest.mark.parametrize("seed", range(8))
def test_what_must_hold_of_every_run_holds(seed):
    names, found, _ = play(seed)
    assert not found, f"{names}: {found}"


@pytest.mark.parametrize(
    ("seed", "kinds"),
    [
        (221, ()),  # the door opened during the lift: "stopped at" the place where the lift had begun
        (2, ("interrupted",)),  # the same after a second Ctrl-C during the lift
        (3, ("interrupted",)),  # ... that had ended at the top: "not lifted"
        (5381, ()),  # half a line was left in the controller's buffer: --resume was refused
        (5766, ()),  # the same, with echoes of lines
        (5968, ()),  # the same after a hold from outside, on a busy computer
        (547, ()),  # one more Ctrl-C while a lock was taken back: an error about the lock hid it
        (10586, ()),  # one more Ctrl-C while the signal handlers were put back: the last words were lost
        (13703, ()),  # the same while they were being written, with the tip in the skin
        (13745, ()),  # killed between the end of a file and its name: a whole recording was taken for a broken one
        (15940, ()),  # a brown-out at the very end: the judge had not seen it yet
        (18322, ()),  # an alarm that hears no line before a reset: 30 s in silence at opening
        (1339, ()),  # a lift that was interrupted moved on after the end: "it stands somewhere on it"
        (1593, ()),  # a board pulled out while its reader did not run: no fault of the recorder
        (5582, ()),  # a board that freezes twice shows another reading once: no fault of the recorder
        (2347, ()),  # told that the zero was lost, the person did not find it: no fault of the recorder
        (11549, ()),  # 2.8 mm below the envelope by a line in inches, and the way back up: no fault of the recorder
        (13215, ()),  # a door that opened after the controller fell mute: no fault of the recorder
        (2594, ()),  # a board pulled out in a lift: the way of the registration was tried again all the same
    ],
)
def test_seeds_that_once_failed(seed, kinds):
    names, found, _ = play(seed, kinds)
    assert not found, f"{names}: {found}"


def test_a_computer_that_is_not_late_claims_a_narrow_path(tmp_path):
    """The claim follows the round trips of queries and lines; only here nothing else delays them."""
    world = World(3, tmp_path / "session")
    session = world.record()
    world.end()
    for path in session.episodes:
        recording = read_recording(path)
        stream, moves = recording.episode.cnc, recording.moves
        half_ns = np.median(stream.arrival_ns - stream.sample_ns)
        starts_ns = [move.uncertainty_ns + move.contradiction_ns for move in moves]
        assert np.median(starts_ns) + half_ns < CLAIM_NS


def test_a_disk_without_room_for_the_head_of_a_recording_leaves_no_file_that_nobody_can_read(tmp_path):
    world = World(34, tmp_path / "session")
    world.computer.disk.room = 500
    with pytest.raises(DeviceError, match="cannot be begun"):
        world.record()
    world.end()
    assert not list(world.folder.glob("*.mcap"))
