"""What `tacdata check` says of recordings that were imported: in their own unit, by their own times."""

import importlib
import re
from types import SimpleNamespace

import numpy as np
import pytest
from foreign import mapping, press_data, wide_csv
from matplotlib.figure import Figure

from tacdata import documents
from tacdata.importing.imported_session import import_session
from tacdata.recording.check.report import check
from tacdata.viewers.pictures.check import _responses, draw


def several(presses, begin=2.0, seed=0, spread=0.05):
    """Return times, depths, forces and channels [pF] of presses one after another, with stamps that vary."""
    rng = np.random.default_rng(seed)
    at, path = [0.0, begin] if begin else [0.0], [-0.5, -0.5] if begin else [1.0]
    for _ in range(presses):
        at += (at[-1] + np.cumsum([1.5, 1.5])).tolist()
        path += [1.0, -0.5]
    time = np.cumsum(0.02 * (1 + spread * rng.normal(size=int(at[-1] / 0.02))))
    depth = np.interp(time, at, path)
    signals = 20 + 3 * np.maximum(depth, 0)[:, None] * rng.uniform(0.3, 1, 5)
    return time, depth, np.maximum(depth, 0), np.round(signals + rng.normal(0, 0.01, signals.shape), 4)


def told(tmp_path, data):
    wide_csv(tmp_path / "wide.csv", data)
    return check(import_session(tmp_path, mapping(tmp_path), tmp_path / "session").folder)


def test_times_that_vary_and_noise_are_told_of_in_the_sources_own_terms(tmp_path):
    report = told(tmp_path, several(4))
    [words] = re.findall(r"varies by .* ms \(([0-9.]+) %\)", report.text)
    assert 4 < float(words) < 6
    [noise] = re.findall(r"idle noise ([0-9.]+) pF", report.text)
    assert 0.008 < float(noise) < 0.012
    assert "counts" not in report.text and "jitter" not in report.text and "arrival" not in report.text
    documents.check(report.document, "check", "check")
    draw(report, tmp_path / "check.png")
    assert (tmp_path / "check.png").stat().st_size > 10_000


def test_a_rest_before_several_presses_is_an_idle_stretch(tmp_path):
    report = told(tmp_path, several(4))
    assert "no idle stretch" not in report.text and "no rest" not in report.text
    idle = report.document["episodes"][0]["taxels"]["idle_reading"]
    np.testing.assert_allclose(idle, 20, atol=0.01)


def test_between_presses_is_one_where_they_begin_in_contact(tmp_path):
    idle = told(tmp_path, several(4, begin=0.0)).document["episodes"][0]["taxels"]["idle_reading"]
    np.testing.assert_allclose(idle, 20, atol=0.01)


def test_one_press_is_judged_by_its_rest_as_before(tmp_path):
    report = told(tmp_path, press_data())
    assert "no idle stretch" not in report.text and "(0 %)" in report.text


def test_channels_and_recordings_are_counted_in_whole_numbers():
    axes = Figure().subplots()
    entries = [SimpleNamespace(document={"taxels": {"response": [1.0, 2.0, 3.0]}})] * 2
    _responses(axes, SimpleNamespace(episodes=entries), "counts")
    for axis, low, high in ((axes.xaxis, -0.5, 2.5), (axes.yaxis, -0.5, 1.5)):
        shown = [tick for tick in axis.get_ticklocs() if low <= tick <= high]
        assert len(shown) >= 2 and all(tick == round(tick) for tick in shown)


def test_a_depth_that_rests_at_zero_has_a_rest(tmp_path):
    """Depths of other labs begin at touch: without contact they are 0, not above it."""
    time, depth, force, signals = several(4)
    assert "readings answer contact" not in told(tmp_path, (time, np.maximum(depth, 0), force, signals)).text
    flat = np.round(20 + np.random.default_rng(1).normal(0, 0.01, signals.shape), 4)
    (tmp_path / "flat").mkdir()
    assert "no channel answers" in told(tmp_path / "flat", (time, np.maximum(depth, 0), force, flat)).text


@pytest.mark.parametrize(("offset", "doubted"), ((-5.0, True), (0.0, False)))
def test_a_path_above_the_skin_whose_readings_answer_is_doubted(tmp_path, offset, doubted):
    time, depth, force, signals = several(1)
    report = told(tmp_path, (time, depth + offset, force, signals))
    assert ("above the skin, and the readings follow it" in report.text) is doubted


def test_a_path_above_the_skin_without_an_answer_is_a_rest(tmp_path):
    time, depth, force, signals = several(1)
    report = told(tmp_path, (time, depth - 5, force, np.random.default_rng(1).normal(20, 0.01, signals.shape).round(4)))
    assert "the readings follow it" not in report.text


def test_an_unknown_skin_is_not_to_be_labelled_next(tmp_path, capsys):
    told(tmp_path, several(2))
    session = tmp_path / "session"
    importlib.import_module("tacdata.commands.check").run(session)
    shown = capsys.readouterr().out
    assert "give sensor: FILE there, and import again" in shown
    assert "next: tacdata label" not in shown
