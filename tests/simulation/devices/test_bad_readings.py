"""A board whose readings cannot be right: told within two seconds, then what the plan says."""

import numpy as np
import pytest
from simulated_rig import CLEARANCE, ORIGIN, World

from tacdata.errors import DeviceError
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.reading_health import BadReadings

FAULT = 8.0
"""When the board goes wrong [s]; the first press is under way."""


def freeze(world):
    last = []
    world.board.inject_readings(lambda counts: last.append(counts) or last[0])


def saturate(world):
    world.board.inject_readings(lambda counts: np.full_like(counts, 65535.0))


def played(folder, fault, answer=None, **entries):
    world = World(3, folder / "session", **entries)
    world.schedule.at(round(FAULT * 1e9), lambda: fault(world))

    def asked(question):
        world.mend_board()
        world.board_line.to_host.renew()
        return answer

    world.answer = asked
    return world


@pytest.mark.parametrize(
    ("fault", "words"), [(freeze, "the board repeats one frame"), (saturate, "65535 counts, their limit")]
)
def test_a_plan_that_says_nothing_stops_within_two_seconds(tmp_path, fault, words):
    world = played(tmp_path, fault)
    with pytest.raises(BadReadings, match=words):
        world.record()
    world.end()
    times = np.array([row[0] for row in world.path])
    heights = np.array([row[3] for row in world.path])
    later = heights[times > FAULT + 2.0]
    assert heights.min() < ORIGIN[2] and np.all(np.diff(later) >= 0), "it only goes up"
    assert heights[-1] == pytest.approx(ORIGIN[2] + CLEARANCE, abs=0.01)


def test_a_plan_may_go_on_and_the_file_says_so(tmp_path):
    world = played(tmp_path, freeze, on_bad_readings="go on")
    session = world.record()
    world.end()
    assert len(session.done) == 2 and not world.asked
    assert [words for words in world.said if "WARNING: no channel has changed" in words]
    notes = read_recording(session.episodes[0]).log
    assert any("the board repeats one frame" in note for note in notes)


def test_a_plan_may_pause_until_a_person_has_put_it_right(tmp_path):
    world = played(tmp_path, freeze, answer=True, on_bad_readings="pause")
    session = world.record()
    world.end()
    assert len(session.done) == 2
    assert len(world.asked) == 1 and "Put the board right" in world.asked[0]
    assert "PAUSED: taxels: no channel has changed" in world.said[0]
    assert [path.name for path in session.unfinished] == ["episode-000000.interrupted-0.mcap"]


def test_a_pause_that_nobody_ends_is_a_stop(tmp_path):
    world = played(tmp_path, freeze, answer=False, on_bad_readings="pause")
    with pytest.raises(BadReadings) as error:
        world.record()
    world.end()
    assert "the indenter was lifted off the skin" in "".join(error.value.__notes__)


def test_a_silent_board_stops_it_within_two_seconds(tmp_path):
    world = played(tmp_path, lambda world: setattr(world.board_line.to_host, "held_until", round(60e9)))
    with pytest.raises(DeviceError, match=r"taxel board: nothing received for 1.8 s"):
        world.record()
    world.end()
    places = np.array([row[:4] for row in world.path])
    assert np.all(np.diff(places[places[:, 0] > FAULT + 2.2, 3]) >= 0)
