"""What `check` finds on the depths of a session's presses is found by `health` and `discrepancy`, too."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "recording"))

from recording_examples import session_of

from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.run import run
from tacdata.health.advice import FIRST, MACHINE, REGISTER, advice
from tacdata.health.document import text
from tacdata.health.history import history
from tacdata.health.visit import read_visit
from tacdata.recording.check.report import check

COUNT = 16
FAULTS = {
    "drift": ([0.006 * k for k in range(COUNT)], 0.0, "first contact drifts by +6"),
    "height": ([-0.25] * COUNT, 0.0, "first contact is at depth -0."),
    "reports at rest": ([0.0] * COUNT, 0.04, "the guide stood 0.040 mm from the commanded position in the hold"),
}


@pytest.fixture(scope="module", params=FAULTS)
def faulty(request, tmp_path_factory):
    """A session with a fault of depth, and words of its finding."""
    shifts, off, words = FAULTS[request.param]
    return session_of(tmp_path_factory.mktemp("depths") / "session", shifts, off).folder, words


def test_check_and_health_say_the_same(faulty):
    folder, words = faulty
    assert any(words in finding.text for finding in check(folder).findings)
    found = history([read_visit(folder)])
    assert [words in a.why for a in advice(found) if a.do == MACHINE] == [True]
    assert f"CHECK THE MACHINE ({words}" in text(found)


def test_discrepancy_says_it_first(faulty, tmp_path):
    folder, words = faulty
    verdict = run([folder], read_spec(None), tmp_path / "verdict", until="gate").verdict
    assert verdict["remarks"][0].startswith(f"session: {words}")


def test_a_sound_session_is_advised_nothing(tmp_path):
    folder = session_of(tmp_path / "session", [0.0] * COUNT).folder
    assert [a.do for a in advice(history([read_visit(folder)]))] == [FIRST]
    remarks = run([folder], read_spec(None), tmp_path / "verdict", until="gate").verdict["remarks"]
    assert not any(words in remark for remark in remarks for _, _, words in FAULTS.values())


def test_a_spread_of_a_press_repeated_is_judged_at_the_first_visit(monday, monkeypatch):
    assert [a.do for a in advice(history([monday]))] == [FIRST]
    spread = monday.repeatability
    monkeypatch.setattr(type(monday), "repeatability", type(spread)(0.238, spread.freedom))
    (advised,) = advice(history([monday]))
    assert advised.do == REGISTER
    assert advised.why.startswith("spread of a press repeated: 23.8 % (")
