"""Recordings whose clocks all begin at zero: the rest between them is not known, and nothing is remembered over it."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from tacdata.discrepancy.data.recordings import course_of
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.importing.imported_session import import_session
from tacdata.revision.episodes import part

STEP, FINE = 0.1, 20
MAPPING = {
    "version": "1.3",
    "name": "tape",
    "files": {"pull": {"path": "pull_{trial}.csv", "time": {"column": "t", "unit": "s"}}},
    "sensor": {"name": "tape"},
    "taxels": {"file": "pull", "columns": ["F"], "unit": "N"},
    "position": {"file": "pull", "depth": {"column": "d", "unit": "mm"}},
}
TIMES, SHARES = (0.7, 4.0, 21.0), (0.16, 0.14, 0.2)


def tape(time: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Return the force of a tape that relaxes and goes slack: each element's strain stepped in time."""
    elastic = 1.3 * stretch / (1 + 0.03 * stretch)
    held, force = np.zeros(len(TIMES)), np.zeros(len(time))
    for k in range(1, len(time)):
        for share in (np.arange(FINE) + 0.5) / FINE:
            strain = elastic[k - 1] + (elastic[k] - elastic[k - 1]) * share
            held += (strain - held) * STEP / FINE / np.array(TIMES)
        force[k] = elastic[k] - np.dot(SHARES, held)
    return np.maximum(force, 0.0)


@pytest.fixture(scope="module")
def tapes(tmp_path_factory):
    """Twelve pulls to four lengths at three rates, each on a clock of its own."""
    folder, rng = tmp_path_factory.mktemp("tape"), np.random.default_rng(20)
    for k in range(12):
        length, rate = (8.0, 16.0, 24.0, 32.0)[k % 4], (1.0, 3.0, 8.0)[k // 4]
        time = np.arange(0, 2 * length / rate + 1, STEP)
        stretch = np.interp(time, [0.5, 0.5 + length / rate, 0.5 + 2 * length / rate], [0, length, 0])
        force = tape(time, stretch) + 0.05 * rng.normal(size=len(time))
        rows = [f"{t:.3f},{d:.4f},{f:.4f}" for t, d, f in zip(time, stretch, force, strict=True)]
        (folder / f"pull_{k:02d}.csv").write_text("\n".join(["t,d,F", *rows]))
    (folder / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    return import_session(folder, folder / "mapping.yaml", folder / "session").folder


def test_nothing_is_remembered_from_one_clock_to_the_next(tapes):
    course = course_of(tapes)
    assert course.restarts is not None and course.restarts.tolist() == [False, *[True] * 11]
    assert (course.step[course.first][1:] > 1e6).all() and np.ptp(course.time) < 1000
    assert any("11 presses have clocks of their own" in note for note in course.notes)


def test_a_clock_begins_with_the_next_press_where_its_first_is_left_out(tapes):
    course = part(course_of(tapes), np.array([0, 3, 4]))
    assert course.restarts is not None and course.restarts.tolist() == [False, True, True]


def test_clocks_of_their_own_do_not_order_presses(tmp_path):
    """Each begins whenever its logger woke up: the order of the files is that of the presses."""
    for k, begin in enumerate((0.3, 0.1, 0.2, 0.0)):
        time = np.arange(0, 4, STEP)
        stretch = np.interp(time, [0.5, 1.5, 2.5], [0, 8 + k, 0])
        rows = [f"{begin + t:.3f},{d:.4f},{d + 0.1:.4f}" for t, d in zip(time, stretch, strict=True)]
        (tmp_path / f"pull_{k:02d}.csv").write_text("\n".join(["t,d,F", *rows]))
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    course = course_of(import_session(tmp_path, tmp_path / "mapping.yaml", tmp_path / "session").folder)
    deepest = [course.tip[course.episode == e, 2].max() for e in range(4)]
    assert deepest == pytest.approx([8, 9, 10, 11], abs=0.5) and np.all(np.diff(course.time) > 0)


def test_a_tape_that_relaxes_and_goes_slack_has_memory_and_no_friction(tapes):
    answer = judge(course_of(tapes), read_spec(None)).document
    named = {e["family"] for e in answer["effects"] if e["status"] == "named"}
    assert answer["status"].startswith("named") and named == {"memory of the skin"}
