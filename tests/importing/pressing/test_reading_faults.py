"""Readings against the depth: zeros that jump, channels that saturate, recordings that begin or end in a press."""

import numpy as np
import pytest
from sources import mapping, table, write

from tacdata.importing.imported_session import import_session
from tacdata.importing.plausibility.codes import without_codes
from tacdata.recording.check.report import check

CUT = {"trials": {"press_above": 0.3}}


def notes(folder, rows, **changes):
    made = import_session(folder, mapping(folder, write(folder, "npz", rows), **changes), folder / "session")
    return " ".join(made.notes), made


@pytest.mark.parametrize("change", (lambda c: c - 5.0, lambda c: 10 * c, lambda c: c + 0.3))
def test_a_zero_that_jumps_at_rest_is_told(tmp_path, change):
    rows = table(presses=3)
    rows[98:, 2] = change(rows[98:, 2])
    words, made = notes(tmp_path, rows, **CUT)
    assert "readings of 1 channel jump while nothing touches, first c0" in words
    assert "jump while nothing touches" in check(made.folder).text


@pytest.mark.parametrize(
    ("name", "limited"), [("above", lambda c: np.minimum(c, 10.9)), ("below", lambda c: np.maximum(-c, -10.9))]
)
def test_a_channel_that_saturates_is_told(tmp_path, name, limited):
    rows = table(presses=3)
    rows[:, 2] = limited(rows[:, 2])
    assert "1 channel saturates: c0 stays at" in notes(tmp_path, rows, **CUT)[0], name


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("a plain press", lambda c, d: c),
        ("a slow drift", lambda c, d: c + np.linspace(0, 5, len(c))),
        ("a quiet converter", lambda c, d: np.rint(10 * c)),
        ("a load cell cut at 0", lambda c, d: np.maximum(c - 10.4, 0.0)),
        ("a model without noise", lambda c, d: 10 + d),
        ("a snap on the way in", lambda c, d: c + 1.0 * (d > 0.4)),
    ],
)
def test_a_plausible_reading_raises_no_doubt(tmp_path, name, change):
    rows = table(presses=3)
    rows[:, 2] = change(rows[:, 2], rows[:, 1])
    words, _ = notes(tmp_path, rows, **CUT)
    assert "jump" not in words and "saturate" not in words and "differ" not in words, name


def test_an_offset_between_recordings_is_told(tmp_path):
    for number in (1, 2, 3):
        rows = table(presses=1, seed=number)
        rows[:, 2] -= 4 * (number > 1)
        np.savez(tmp_path / f"run_{number}.npz", t=rows[:, 0], depth=rows[:, 1], c0=rows[:, 2], c1=rows[:, 3])
    files = {"run": {"path": "run_{n}.npz", "time": {"column": "t", "unit": "s"}}}
    made = import_session(tmp_path, mapping(tmp_path, tmp_path / "x", files=files), tmp_path / "session")
    assert any("readings at rest differ by" in note and "between 1 and 2" in note for note in made.notes)


@pytest.mark.parametrize(("part", "words"), [(slice(50, None), "begins deep"), (slice(0, 50), "ends deep")])
def test_half_a_press_is_questioned(tmp_path, part, words):
    assert words in notes(tmp_path, table(presses=1)[part])[0]


def test_a_depth_beyond_any_skin_is_questioned(tmp_path):
    rows = table(presses=1)
    rows[:, 1] *= 500
    assert "600 mm deep: is its unit another?" in notes(tmp_path, rows)[0]


def test_a_cable_that_came_off_is_told():
    values = table(presses=3)[:, 2:3]
    values[130:160] = 0.0
    cleaned, words = without_codes(values, "taxels", rails=False)
    assert "30 numbers (0) stay far from all others" in words[0] and np.isfinite(cleaned).all()


@pytest.mark.parametrize("power", (10.0, 100.0, 1000.0))
def test_a_lost_decimal_sign_is_told(power):
    values = table(presses=3)[:, 2:3]
    kept = np.random.default_rng(0).random(len(values)) < 0.1
    values[~kept] *= power
    _, words = without_codes(values, "taxels", rails=False)
    assert any("was a decimal sign lost?" in text for text in words)
