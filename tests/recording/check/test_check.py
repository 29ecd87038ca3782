import json
from dataclasses import replace

import numpy as np
import pytest
from recording_examples import SENSOR, T0, Press, header, plan, plan_document, rig_document
from typer.testing import CliRunner

from tacdata import documents
from tacdata.cli import application
from tacdata.clock import Clock
from tacdata.devices.device import CncStatus
from tacdata.errors import UsageError
from tacdata.recording.check.report import check
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.session import create_session, refresh


def one(press, tmp_path, **options):
    return check(press.write(tmp_path / f"episode-{press.number:06d}.mcap", **options))


def texts(report):
    return [(f.severity, f.stream, f.text) for f in report.findings]


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_found_in_a_clean_recording(tmp_path, seed):
    report = one(Press(seed=seed, camera=True), tmp_path)
    assert texts(report) == []
    assert report.usable
    values = report.document["episodes"][0]
    assert values["taxels"]["rate"] == pytest.approx(30.0, abs=0.05)
    assert np.median(values["taxels"]["idle_noise"]) == pytest.approx(5.0, rel=0.2)
    assert values["cnc"]["depth_uncertainty"] < 0.015
    assert values["cameras"]["side"]["seen"] == pytest.approx(2 / 3, abs=0.02)
    documents.check(report.document, "check", "report")


def test_dropped_frames_are_counted_and_a_long_gap_is_unusable(tmp_path):
    press = Press()
    press.drop(40, 41)
    report = one(press, tmp_path)
    assert report.document["episodes"][0]["taxels"]["lost"] == 1
    assert [(s, c) for s, c, _ in texts(report)] == [("warning", "taxels")]
    assert report.usable
    gap = Press(number=1)
    gap.drop(60, 75)
    report = one(gap, tmp_path)
    assert report.document["episodes"][0]["taxels"]["longest_gap"] == pytest.approx(16 * 1000 / 30, rel=1e-3)
    assert not report.usable


def test_a_gap_that_the_counter_hides_is_seen(tmp_path):
    press = Press()
    press.sample[90:] += 400_000_000
    press.arrival[90:] += 400_000_000
    press.counter[:] = -1
    report = one(press, tmp_path)
    assert not report.usable
    assert any("gap of 4" in text for _, _, text in texts(report))
    assert any("no counter" in text for _, _, text in texts(report))


def test_a_stuck_channel_is_named(tmp_path):
    whole, later = Press(), Press(number=1)
    whole.counts[:, 7] = 9003
    later.counts[80:, 3] = later.counts[5, 3]
    for press, channel in ((whole, 7), (later, 3)):
        report = one(press, tmp_path)
        assert report.document["episodes"][0]["taxels"]["stuck"] == [channel]
        assert report.document["episodes"][0]["taxels"]["saturated"] == []
        assert not report.usable


def test_a_saturated_channel_is_named(tmp_path):
    press = Press()
    strongest = int(np.argmax(press.counts.max(axis=0) - press.counts[0]))
    press.counts[:, strongest] = np.minimum(press.counts[:, strongest], 9500)
    values = one(press, tmp_path).document["episodes"][0]["taxels"]
    assert values["saturated"] == [strongest]
    assert values["stuck"] == []


def test_a_noisy_channel_and_a_wrong_rate_are_told(tmp_path):
    press = Press(rate=27.0)
    press.counts[:, 11] += np.round(press.rng.normal(0, 60, len(press.counts)))
    found = texts(one(press, tmp_path))
    assert any("channel 11 is over 5 times" in text for _, _, text in found)
    assert any("27.00 Hz, nominal 30 Hz" in text for _, _, text in found)


def test_a_guide_that_did_not_arrive_is_found(tmp_path):
    press = Press()
    hold = next(c for c in press.commands if c.phase == "hold")
    press.statuses = [
        CncStatus(s.sent_ns, s.arrival_ns, s.state, s.position + np.array([0, 0, 0.2]), s.feed)
        if hold.sent_ns < s.sent_ns < hold.acknowledged_ns
        else s
        for s in press.statuses
    ]
    report = one(press, tmp_path)
    assert report.document["episodes"][0]["cnc"]["hold_error"] == pytest.approx(0.2, abs=0.002)
    assert not report.usable


def test_an_alarm_and_silence_of_the_controller_are_found(tmp_path):
    press = Press()
    last = press.statuses[-1]
    press.statuses[-1] = CncStatus(last.sent_ns, last.arrival_ns, "Alarm:1", last.position, 0.0)
    del press.statuses[10:26]
    found = texts(one(press, tmp_path))
    assert ("unusable", "cnc", "the controller was in state Alarm:1") in found
    assert any("no status report for 2125 ms" in text for _, _, text in found)


def test_missing_tags_and_images_are_told(tmp_path):
    blind = Press(camera=True)
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(path, blind.header, Clock(T0, 0, 1.0), ("side",))
    views, blind.views = blind.views, []
    blind.feed(writer)
    for time, k in views:
        writer.image("side", time, time, k, b"jpeg")
        writer.cube("side", time, time, k, None)
    writer.close(True)
    found = texts(check(path))
    assert ("warning", "camera side", "no tag in view in any image") in found
    dark = Press(number=1, camera=True)
    dark.views = []
    assert ("warning", "camera side", "no image") in texts(one(dark, tmp_path))


def test_missing_registration_and_broken_off_recordings_are_told(tmp_path):
    press = Press()
    del press.header.rig["registration"]["method"]
    report = one(press, tmp_path, complete=False, reason="the cable was pulled")
    assert ("unusable", "recording", "the cable was pulled") in texts(report)
    assert any(stream == "registration" for _, stream, _ in texts(report))


@pytest.fixture
def session(tmp_path):
    made = create_session(tmp_path / "session", plan(3), SENSOR, rig_document())
    for number in range(3):
        Press(number).write(made.folder / f"episode-{number:06d}.mcap")
    return refresh(made)


def test_a_session_is_checked_as_a_whole(session):
    report = check(session.folder)
    assert texts(report) == []
    assert len(report.episodes) == 3
    (session.folder / "episode-000002.mcap").write_bytes(b"x" * 100)
    report = check(session.folder)
    assert not report.usable
    assert len(report.episodes) == 2
    assert "no MCAP file" in report.text


def test_recover_ends_as_mcap_recover_does(tmp_path):
    whole = Press().write(tmp_path / "whole.mcap")
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-30])
    (tmp_path / "nothing.mcap").write_bytes(whole.read_bytes()[:100])
    ends = {path.stem: CliRunner().invoke(application(), ["recover", str(path)]) for path in sorted(tmp_path.iterdir())}
    assert {name: result.exit_code for name, result in ends.items()} == {"whole": 0, "cut": 3, "nothing": 1}
    assert "messages and" in ends["cut"].output


def test_swapped_and_silent_channels_are_found(tmp_path):
    rng = np.random.default_rng(8)
    document = plan_document(1)
    sites = np.round(rng.uniform([-4.7, -3.7], [4.7, 3.7], (30, 2)), 2).tolist()
    document["presses"] = [{"indenter": "ball", "x": x, "y": y, "depth": 0.8} for x, y in sites]
    from tacdata.plans import Plan

    many = Plan.from_document(document, "many")

    def record(folder, change):
        made = create_session(folder, many, SENSOR, rig_document())
        for number in range(30):
            press = Press(0, seed=number, of=replace(header(0), press=many.presses[number]))
            press.counts = change(press.counts)
            press.write(folder / f"episode-{number:06d}.mcap")
        return check(refresh(made).folder)

    assert texts(record(tmp_path / "clean", lambda c: c)) == []

    def swap(counts):
        counts[:, [2, 21]] = counts[:, [21, 2]]
        return counts

    found = texts(record(tmp_path / "swapped", swap))
    assert [(s, t.split(":")[0]) for s, _, t in found] == [
        ("unusable", "channel 2 answers like taxel 21"),
        ("unusable", "channel 21 answers like taxel 2"),
    ]

    def mute(counts):
        counts[:, 9] = np.round(9000 + rng.normal(0, 5, len(counts)))
        return counts

    assert ("unusable", "taxels", "channel 9 did not answer to presses close by") in texts(
        record(tmp_path / "mute", mute)
    )


def test_the_verb_says_usable_or_not_by_its_exit_status(session):
    run = CliRunner()
    result = run.invoke(application(), ["check", str(session.folder)])
    assert result.exit_code == 0, result.output
    assert "usable" in result.output
    assert (session.folder / "check.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((session.folder / "check.json").read_text())["usable"] is True
    bad = Press(2)
    bad.counts[:, 4] = 1.0
    path = bad.write(session.folder.parent / "episode-000002.mcap")
    result = run.invoke(application(), ["check", str(path)])
    assert result.exit_code == 1
    assert "channel 4 stopped changing" in result.output
    with pytest.raises(UsageError):
        check(session.folder / "nothing")
