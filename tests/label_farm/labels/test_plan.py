"""From recordings to jobs: the same configuration is the same job, and every step keeps its limit."""

from dataclasses import replace

import numpy as np
import pytest
from farm_examples import SENSOR, press_episode

from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.labels.request import request
from tacdata.label_farm.presses.fem import _request as pressed
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.plans import Press

MODEL = "0" * 64


def job_of(episode, model=MODEL, sensor=SENSOR):
    return request(episode, sensor, model, Ladder()).job


@pytest.mark.parametrize("deepest", [0.01, 0.05, 0.3, 1.0, 1.37, 2.9])
def test_a_ladder_meets_its_deepest_point_with_small_first_steps(deepest):
    ladder = Ladder(unload_step=0.4)
    depths = np.array(ladder.depths(deepest))
    peak = int(np.argmax(depths))
    load, unload = np.diff(depths[: peak + 1]), -np.diff(depths[peak:])
    assert depths.max() == deepest and depths[0] == depths[-1] == 0.0
    assert (load > 0).all() and (unload > 0).all()
    assert load.max() <= 0.25 + 1e-6 and load[0] <= 0.08 + 1e-6
    assert set(depths[peak:]) <= set(depths[: peak + 1]), "unloading starts from states of the way down"
    # States of the way down lie up to half a load step beside equal parts.
    assert unload.max() <= 0.4 + 0.25
    if peak > 1:
        assert len(unload) >= 2, "one state at the least says how far the way up differs"


@pytest.mark.parametrize("deepest", [0.05, 1.0, 2.9])
def test_the_way_up_has_the_steps_of_the_way_down_where_the_skin_sticks_or_where_that_is_asked(deepest):
    ladder = Ladder()
    for path in (ladder.depths(deepest, other_way_up=True), Ladder(unload_step=0.25).depths(deepest)):
        peak = int(np.argmax(path))
        assert path[peak:] == path[peak::-1]


def test_a_ladder_refuses_steps_that_lead_nowhere():
    for settings in ({"load_step": 0.0}, {"unload_step": 1e-9}, {"growth": 0.5}, {"first_step": float("nan")}):
        with pytest.raises(UsageError, match="depth steps"):
            Ladder(**settings)


def test_a_key_depends_on_all_that_decides_and_on_nothing_else(tmp_path):
    job = job_of(press_episode(tmp_path, 0))
    assert job_of(press_episode(tmp_path, 7)).key == job.key, "the recording does not count"
    assert Job.from_document(job.document) == job
    changed = [
        replace(job, sensor="1" * 64),
        replace(job, model="1" * 64),
        replace(job, x=0.1),
        replace(job, y=0.1),
        replace(job, yaw=0.1),
        replace(job, tilt_x=0.1),
        replace(job, tilt_y=0.1),
        replace(job, depths=(0.0, 0.5, 0.0)),
        replace(job, indenter={"shape": "sphere", "radius": 2.1}),
    ]
    assert len({job.key, *(other.key for other in changed)}) == 10


def test_a_leaning_indenter_leans_in_its_job_and_in_the_press_that_is_solved(tmp_path):
    episode = press_episode(tmp_path)
    press = replace(episode.press, yaw=20.0, tilt_x=4.0, tilt_y=-7.0)
    job = job_of(replace(episode, press=Press.from_document(press.document)))
    assert (job.yaw, job.tilt_x, job.tilt_y) == (20.0, 4.0, -7.0)
    assert Job.from_document(job.document) == job
    asked = pressed(job)
    assert (asked.yaw, asked.tilt_x, asked.tilt_y) == (20.0, 4.0, -7.0)


def test_an_upright_press_is_the_job_that_it_was_before_indenters_could_lean(tmp_path):
    job = job_of(press_episode(tmp_path))
    assert "tilt_x" not in job.document and "tilt_x" not in press_episode(tmp_path).press.document
    assert Job.from_document({**job.document, "version": "1.1"}).key == job.key


def test_the_recorded_depth_counts_and_small_scatter_does_not(tmp_path):
    planned = job_of(press_episode(tmp_path, 0, depth=1.0))
    assert job_of(press_episode(tmp_path, 0, depth=1.0, reached=0.997)).key == planned.key
    assert job_of(press_episode(tmp_path, 0, depth=1.0, reached=0.8)).deepest == 0.8
    assert job_of(press_episode(tmp_path, 0, depth=1.0, reached=0.801)).deepest == 0.81
    assert job_of(press_episode(tmp_path, 0, depth=1.0, reached=-0.1)) is None


def test_the_recorded_place_counts_and_small_scatter_does_not(tmp_path):
    episode = press_episode(tmp_path)
    near = replace(episode, tip=episode.tip + np.array([0.01, -0.01, 0.0]))
    far = replace(episode, tip=episode.tip + np.array([0.3, -0.2, 0.0]))
    assert job_of(near).key == job_of(episode).key
    assert (job_of(far).x, job_of(far).y) == (0.3, -0.2)


def test_travel_above_the_skin_may_go_anywhere(tmp_path):
    episode = press_episode(tmp_path)
    tip = episode.tip.copy()
    tip[0, :2], tip[0, 2] = (5.0, 5.0), -3.0
    step = np.array([[0.0, 0.0, -0.5]])
    joined = replace(
        episode,
        tip=np.concatenate([tip[:1], step, tip[1:]]),
        tip_ns=np.concatenate([episode.tip_ns[:1] - 10**9, episode.tip_ns]),
    )
    assert job_of(joined).key == job_of(episode).key


def test_two_presses_in_one_recording_are_refused(tmp_path):
    episode = press_episode(tmp_path)
    tip = episode.tip.copy()
    tip[:, 2] = [0.0, 0.9, 0.2, 1.0]
    with pytest.raises(FormatError, match=r"falls and rises again by 0\.70 mm"):
        job_of(replace(episode, tip=tip, press=replace(episode.press, depth=1.0)))


def test_a_recording_without_frames_is_refused(tmp_path):
    with pytest.raises(FormatError, match="0 taxel frames"):
        job_of(press_episode(tmp_path, frames=0))
