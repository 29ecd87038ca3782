"""The skin must begin at depth zero, in the first presses and in all of a session."""

import numpy as np
import pytest
from recording_examples import pressed, session_of

from tacdata.errors import DeviceError
from tacdata.recording.check.figures import figures
from tacdata.recording.check.first_contact import FirstContact, drift_words, first_contact, height_words
from tacdata.recording.check.report import check
from tacdata.recording.check.session import depth_findings
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.pressed_depth import require_contact


@pytest.mark.parametrize("shift", [-1.0, -0.3, 0.0, 0.1, 0.3])
def test_the_depth_of_first_contact_is_known_within_its_uncertainty(tmp_path, shift):
    contact = first_contact(figures(read_recording(pressed(tmp_path / "episode-000000.mcap", shift=shift))))
    # Above the standoff the way down is five times as fast, with a reading each 0.17 mm.
    assert contact.uncertainty < (0.06 if shift >= 0 else 0.25)
    assert abs(contact.depth - shift) < 2 * contact.uncertainty


def test_a_registration_that_is_a_millimetre_too_low_is_noticed_at_the_first_press(tmp_path):
    with pytest.raises(DeviceError, match=r"first contact was at depth -1\.[01]\d \+- 0\.2\d mm, not at 0"):
        require_contact(pressed(tmp_path / "episode-000000.mcap", shift=-1.0))


def test_a_press_in_air_is_noticed_at_the_first_press(tmp_path):
    with pytest.raises(DeviceError, match=r"no channel answers to a press of 0\.8 mm over a taxel"):
        require_contact(pressed(tmp_path / "episode-000000.mcap", shift=2.0))


def test_a_true_press_is_taken(tmp_path):
    require_contact(pressed(tmp_path / "episode-000000.mcap"))


@pytest.mark.parametrize(("shift", "severity"), [(-0.25, "WARNING"), (-1.0, "UNUSABLE"), (0.0, None)])
def test_check_states_where_the_skin_begins(tmp_path, shift, severity):
    session_of(tmp_path / "session", [shift] * 3)
    report = check(tmp_path / "session")
    lines = [line for line in report.text.splitlines() if "first contact is at depth" in line]
    assert bool(lines) == bool(severity)
    assert not severity or lines[0].split()[0] == severity
    assert not lines or "presses go deeper" in lines[0]


def test_a_drift_of_a_few_micrometres_a_press_is_stated():
    rng = np.random.default_rng(1)
    rows = [(k, FirstContact(0.0025 * k + rng.normal(0, 0.01), 0.01)) for k in range(200)]
    assert "first contact drifts by +2.5 um a press, +0.50 mm over 200 presses" in drift_words(rows)
    steady = [(k, FirstContact(rng.normal(0, 0.02), 0.02)) for k in range(200)]
    assert drift_words(steady) == ""
    assert height_words([c for _, c in steady]) is None


@pytest.mark.parametrize(("off", "severity"), [(0.0, None), (0.04, "warning"), (0.08, "unusable")])
def test_reports_at_rest_that_state_another_depth_are_stated(tmp_path, off, severity):
    report = check(pressed(tmp_path / "episode-000000.mcap", off=off))
    found = [f for f in report.findings if "from the commanded position in the hold" in f.text]
    assert [f.severity for f in found] == ([severity] if severity else [])
    assert not found or f"stood {off:.3f} mm" in found[0].text


@pytest.mark.parametrize(("off", "words"), [(0.0, None), (0.04, "stood 0.040 mm from the commanded position")])
def test_the_findings_on_depths_count_the_presses_that_reports_contradict(tmp_path, off, words):
    session = session_of(tmp_path / "session", [0.0] * 3, off)
    found = depth_findings([figures(read_recording(path)) for path in session.episodes])
    assert [words in f.text and f.text.endswith("in 3 of 3 presses") for f in found] == ([True] if words else [])
