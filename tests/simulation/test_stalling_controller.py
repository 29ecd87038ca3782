"""A controller that loses an answer: the sync tap and the registration are tried once more, then end in words."""


import pytest
from simulated_rig import ORIGIN, World

from tacdata.devices.device import OwesAnswer
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.registration.guarded_probe import guarded_probe


def losing(world, times):
    """Lose every sixth answer from now on, so often."""
    left, answers = [times], [0]

    def change(data):
        if data.strip() == b"ok" and left[0]:
            answers[0] += 1
            if answers[0] % 6 == 0:
                left[0] -= 1
                return b""
        return data

    world.cnc_line.to_host.change = change


@pytest.mark.parametrize(("lost", "done"), [(1, True), (2, False)])
def test_the_sync_tap_is_tried_once_more(tmp_path, lost, done):
    world = World(5, tmp_path / "session", presses=1)
    world.schedule.extend(600.0)
    world.schedule.at(round(4e9), lambda: losing(world, lost))
    if done:
        assert len(world.record(sync_tap=True).done) == 1
    else:
        with pytest.raises(OwesAnswer, match="stands idle and still owes an answer") as error:
            world.record(sync_tap=True)
        assert "the indenter stands clear of the skin" in "".join(error.value.__notes__)
    world.end()
    assert sum("the sync tap is tried once more" in words for words in world.said) == 1
    assert world.position()[2] > ORIGIN[2]


@pytest.mark.parametrize(("lost", "done"), [(1, True), (2, False)])
def test_a_way_of_the_registration_is_tried_once_more(tmp_path, lost, done):
    world = World(6, tmp_path / "session")
    low, high = (ORIGIN[0], ORIGIN[1], ORIGIN[2] - 0.5), ORIGIN[2] + 5.0
    rig = world.rig()
    devices = RigDevices.of(rig)

    def work():
        with devices.opened(), guarded_probe(rig, devices, high, 5.0, say=world.said.append) as probe:
            probe.go(low, 2.0)
            losing(world, lost)
            for _ in range(6):
                probe.go((*low[:2], low[2] + 0.3), 2.0)
                probe.go(low, 2.0)
            return world.position()

    if done:
        assert world.computer.run(work) == pytest.approx(low, abs=0.01)
    else:
        with pytest.raises(OwesAnswer):
            world.computer.run(work)
    assert world.position()[2] == pytest.approx(high, abs=0.01)
    world.end()
    assert sum("tried once more" in words for words in world.said) == 1
