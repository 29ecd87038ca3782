"""Sessions as they come: mixed, damaged, unlabelled, of another plan; what is said, and that nothing is lost."""

import shutil

import numpy as np
import pytest
from unit_examples import SEED, Fault, label, record, some

from tacdata import documents
from tacdata.errors import UsageError
from tacdata.health.document import document, not_assessed, remarks, text
from tacdata.health.history import history
from tacdata.health.visit import read_visit


@pytest.fixture
def copied(folder, tmp_path):
    """Copies of both sessions, to be changed."""
    for name in ("monday", "tuesday"):
        shutil.copytree(folder / name, tmp_path / name)
    return tmp_path


def changed_sensor(folder, **changes):
    """Change the sensor of a session's document."""
    path = folder / "session.json"
    session = documents.read(path, "session")
    documents.write(path, {**session, "sensor": {**session["sensor"], **changes}}, "session")


def test_the_document_keeps_to_its_schema_and_names_where_it_comes_from(monday, tuesday):
    found = document(history([monday, tuesday]))
    documents.check(found, "health", "test")
    assert [visit["session"] for visit in found["visits"]] == ["monday", "tuesday"]
    assert set(found["provenance"]["parents"]) == {"recordings of monday", "recordings of tuesday", "code"}
    assert found["provenance"]["parameters"]["own"] == 0.05
    assert len(found["visits"][1]["gain_of_first"]["channels"]) == 24


def test_visits_of_two_units_are_refused_with_the_commands_for_each(copied):
    changed_sensor(copied / "tuesday", name="other_unit")
    visits = [read_visit(copied / name) for name in ("monday", "tuesday")]
    with pytest.raises(UsageError, match=r"sessions of 2 units: tacprint .*: monday; other_unit .*: tuesday") as told:
        history(visits)
    assert f"tacdata health {copied / 'tuesday'}" in str(told.value)
    assert "if it is one unit, import its visits with one mapping" in str(told.value)


def test_a_session_twice_is_refused(monday):
    with pytest.raises(UsageError, match="monday given twice"):
        history([monday, monday])


def test_a_damaged_recording_is_left_out_and_the_rest_is_used(copied):
    (copied / "tuesday" / "episode-000004.mcap").write_bytes(b"nothing")
    (copied / "tuesday" / "episode-000007.mcap").rename(copied / "tuesday" / "episode-000007.partial.mcap")
    tuesday = documents.read(copied / "tuesday" / "session.json", "session")
    tuesday["episodes"] = [e for e in tuesday["episodes"] if e["number"] != 7]
    documents.write(copied / "tuesday" / "session.json", tuesday, "session")
    found = history([read_visit(copied / "monday"), read_visit(copied / "tuesday")])
    assert len(found.last.responses) == 9 and len(found.comparisons[1][0].pairs) == 9
    said = "\n".join(remarks(found))
    assert "tuesday: episode-000004.mcap is left out" in said and "it was interrupted" in said
    assert found.comparisons[1][0].gains is not None


def test_a_session_without_a_press_says_what_to_record(copied):
    for path in (copied / "monday").glob("*.mcap"):
        path.write_bytes(b"nothing")
    with pytest.raises(UsageError, match="no recording shows the state of the unit") as told:
        read_visit(copied / "monday")
    assert "tacdata plan health" in str(told.value)


def test_channels_that_no_press_touches_are_named(tmp_path):
    visits = [read_visit(record(tmp_path / f"part-{k}", SEED, k, plan=some([1, 2, 3, 7, 8]))) for k in range(2)]
    (said,) = not_assessed(history(visits))
    assert "gain of channels 18, 20, 21, 22: no press near" in said


def test_visits_of_different_plans_need_labels(tmp_path, monday):
    other = record(tmp_path / "other", SEED, 1, plan=some(range(7), depth=0.7))
    found = history([monday, read_visit(other)])
    assert any("share 0 presses" in words for words in not_assessed(found))
    assert "label the sessions" in text(found)


def test_labels_tell_gains_beside_the_model(copied, monday):
    """Predictions of half the measured answers: the unit's gain is two."""

    def half(counts):
        return 500.0 + 0.5 * (counts - np.median(counts[:20], axis=0))

    found = history([read_visit(label(copied / "monday", half))])
    assert found.model[0].common.value == pytest.approx(2.0, rel=0.02)
    assert np.ptp([gain.value for gain in found.model[0].channels.values()]) < 0.1
    assert "labels of monday" in document(found)["provenance"]["parents"]
    assert "200" in text(found)
    (remark,) = remarks(found)
    assert remark.startswith("monday: it responds 2 times as strongly as its labels predict: the sensor file")


def test_predictions_of_about_the_measured_size_are_not_remarked_on(copied):
    found = history([read_visit(label(copied / "monday", lambda counts: 0.8 * counts))])
    assert found.model[0].common.value == pytest.approx(1.25, rel=0.02)
    assert remarks(found) == []


def test_labelled_visits_of_different_plans_are_compared(tmp_path):
    weaker = np.where(np.arange(24) == 9, 0.7, 1.0)

    def model(counts):
        return counts - np.median(counts[:20], axis=0)

    def seen(counts):  # a model of the healthy unit predicts what it would have read
        return model(counts) / weaker

    ill = Fault(counts=lambda counts, _: np.round(9000 + weaker * (counts - np.median(counts[:20], axis=0))))
    label(record(tmp_path / "one", SEED, 0), model)
    label(record(tmp_path / "two", SEED, 1, ill, some(range(7), depth=0.7)), seen)
    found = history([read_visit(tmp_path / "one"), read_visit(tmp_path / "two")])
    gains = found.comparisons[1][0].gains
    assert gains.own[9].value == pytest.approx(0.7, abs=0.03)
    assert [change.channel for _, change in found.changed if change.quantity == "gain"] == [9]


def test_half_labelled_sessions_say_so(copied):
    label(copied / "monday", lambda counts: counts)
    (copied / "monday" / "labels" / "episode-000003.parquet").unlink()
    found = history([read_visit(copied / "monday")])
    assert found.model == (None,)
    assert any("episode-000003.mcap has no label" in words for words in remarks(found))


def test_labels_without_readings_say_so(copied):
    label(copied / "monday")
    assert "no transduction" in read_visit(copied / "monday").label_remark


def test_a_sensor_file_that_changed_is_a_remark(copied):
    skin = documents.read(copied / "monday" / "session.json", "session")["sensor"]["skin"]
    changed_sensor(copied / "tuesday", skin={**skin, "thickness": 3.2})
    found = history([read_visit(copied / name) for name in ("monday", "tuesday")])
    assert any("sensor file changed" in words for words in remarks(found))
