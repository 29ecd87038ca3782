"""Forms of GRBL's lines, as its interface documentation and real firmware write them."""

import numpy as np
import pytest

from tacdata.wire.grbl.codes import ALARMS, ERRORS, alarm_in_words, error_in_words
from tacdata.wire.grbl.lines import ALARM, MESSAGE, RESPONSE, SETTING, WELCOME, parse_status


def test_every_code_has_words():
    assert set(ERRORS) >= {*range(1, 18), *range(20, 39)}, "Grbl 1.1"
    assert set(ERRORS) >= {18, 19, *range(39, 59), 79}, "grblHAL"
    assert set(ALARMS) == set(range(1, 19))
    assert "neither Grbl 1.1 nor grblHAL" in error_in_words(222)
    assert alarm_in_words(2).startswith("ALARM:2 (the target lies beyond the soft limits")
    assert "homed before" in alarm_in_words(11)


@pytest.mark.parametrize("line", ["ok", "error:22"])
def test_responses(line):
    assert RESPONSE.match(line)


@pytest.mark.parametrize("line", ["ok ", "okay", ">G54G20:ok", "[MSG:ok]", "error:", "ALARM:1", "<Idle>"])
def test_what_is_no_response(line):
    assert not RESPONSE.match(line)


@pytest.mark.parametrize(
    "line", ["Grbl 1.1h ['$' for help]", "GrblHAL 1.1f ['$' or '$HELP' for help]", "\ufffdGrbl 0.9j ['$' for help]"]
)
def test_welcomes(line):
    assert WELCOME.search(line)


@pytest.mark.parametrize("line", ["[VER:1.1h.20190825:]", "[FIRMWARE:grblHAL]", "[MSG:Caution: Unlocked]"])
def test_what_is_no_welcome(line):
    assert not WELCOME.search(line)


def test_settings_and_messages():
    found = SETTING.match("$110=500.000 (x max rate, mm/min)")
    assert found
    assert found.groups() == ("$110", "500.000")
    said = MESSAGE.match("[OPT:VL,15,128]")
    assert said
    assert said.groups() == ("OPT", "VL,15,128")
    for line, tag in (("[NVS STORAGE:*EEPROM 2K]", "NVS STORAGE"), ("[G59.1:0.000,0.000,0.000]", "G59.1")):
        spaced = MESSAGE.match(line)
        assert spaced
        assert spaced[1] == tag
    alarm = ALARM.match("ALARM:9")
    assert alarm
    assert alarm[1] == "9"


@pytest.mark.parametrize(
    ("line", "state", "position", "work", "feed"),
    [
        ("<Idle|MPos:0.000,-1.500,2.250|FS:0,0>", "Idle", (0, -1.5, 2.25), False, 0),
        ("<Hold:0|WPos:1,2,3|Bf:15,128|FS:120,0|WCO:10,20,30>", "Hold:0", (1, 2, 3), True, 120),
        ("<Run|MPos:1,2,3|F:500|Pn:XYZ|Ov:100,100,100|A:SFM>", "Run", (1, 2, 3), False, 500),
        ("<Idle|MPos:1,2,3,4|Bf:100,1023|FS:0,0,0|Pn:>", "Idle", (1, 2, 3), False, 0),
    ],
)
def test_status_reports(line, state, position, work, feed):
    report = parse_status(line)
    assert report is not None
    assert (report.state, report.is_work, report.feed) == (state, work, feed)
    np.testing.assert_allclose(report.position, position)
    if "WCO" in line:
        np.testing.assert_allclose(report.offset, [10, 20, 30])


def test_overrides_and_inputs_of_a_report():
    report = parse_status("<Door:1|MPos:1,2,3|FS:0,0|Pn:ZD|Ov:50,100,100|A:S|Xy:new field>")
    assert report is not None
    assert (report.state, report.feed_override, report.pins) == ("Door:1", 50, "ZD")
    bare = parse_status("<Idle|MPos:1,2,3>")
    assert bare is not None
    assert (bare.feed_override, bare.pins, np.isnan(bare.feed)) == (None, "", True)


@pytest.mark.parametrize(("field", "homed"), [("", None), ("|H:0", False), ("|H:1,7", True), ("|H:", None)])
def test_whether_a_report_states_that_it_was_homed(field, homed):
    report = parse_status(f"<Idle|MPos:1,2,3{field}>")
    assert report is not None and report.homed is homed


@pytest.mark.parametrize(
    "line",
    [
        "<Idle|MPos:0.000,-1.5",
        "<Idle|MPos:0.0.0,1,2|FS:0,0>",
        "<Idle|MPos:1,2|FS:0,0>",
        "<|MPos:1,2,3>",
        "<Idle>",
        "<Idle|FS:0,0>",
        "<Id\ufffdle|MPos:1,2,3>",
        "<Idle|MPos:1,2,3|WCO:1,2>",
    ],
)
def test_damaged_reports_are_none(line):
    assert parse_status(line) is None
