"""Numbers that stand for no value, in the guises of instruments, loggers and boards: missing and counted."""

import numpy as np
import pytest
from sources import mapping, table, write

from tacdata.errors import FormatError
from tacdata.importing.imported_session import import_session
from tacdata.importing.plausibility.codes import without_codes
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode

CUT = {"trials": {"press_above": 0.3}}


def imported(folder, path, **changes):
    made = import_session(folder, mapping(folder, path, **changes), folder / "session")
    return made, [read_episode(file) for file in read_session(made.folder).episodes]


@pytest.mark.parametrize(
    "code", (-32768, 32767, 65535, 2147483647, -999, -9999.0, 99.99, 999.99, 9999999, -99999, 6999.0, 0.0)
)
@pytest.mark.parametrize("side", (1.0, -1.0))
def test_a_code_among_readings_is_missing_and_counted(tmp_path, code, side):
    rows = table()
    rows[:, 2:] *= side
    rows[[30, 33, 90, 150], 2] = code
    made, (episode,) = imported(tmp_path, write(tmp_path, "npz", rows))
    assert np.flatnonzero(np.isnan(episode.taxels.counts[:, 0])).tolist() == [30, 33, 90, 150]
    assert np.isfinite(episode.taxels.counts[:, 1]).all()
    assert any(note.startswith("taxels: 4 numbers") for note in made.notes)


def test_two_codes_on_both_sides_are_found():
    values = table()[:, 2:3]
    values[[10, 13, 16], 0], values[[60, 61, 62, 63], 0] = 6999.0, -9999.0
    cleaned, words = without_codes(values, "taxels", rails=False)
    assert np.isnan(cleaned).sum() == 7 and "7 numbers (-9999, 6999)" in words[0]


def test_codes_are_kept_where_the_mapping_trusts_the_channels(tmp_path):
    rows = table()
    rows[[30, 31, 32], 2] = -32768
    taxels = {"file": "run", "columns": ["c0", "c1"], "unit": "pF", "trusted": True}
    _, (episode,) = imported(tmp_path, write(tmp_path, "npz", rows), taxels=taxels)
    assert episode.taxels.counts[:, 0].min() == -32768


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("a switch of 0 and 5 V", lambda d: np.where(d > 0.6, 5.0, 0.0)),
        ("a step from a tared zero", lambda d: np.where(d > 0.3, 8.0 + 1e-3 * np.arange(len(d)) % 1, 0.0)),
        ("a press of few rows, far above the noise", lambda d: np.where(d > 1.19, 500.0 + d, 1e-3 * d)),
        ("counts up to a rail that they do not pass", lambda d: np.rint(250 * d / 1.2)),
    ],
)
def test_a_signal_is_no_code(name, column):
    depth = table()[:, 1] + np.random.default_rng(0).normal(0, 1e-3, len(table()))
    cleaned, words = without_codes(column(depth)[:, None], name, rails=False)
    assert not words and np.isfinite(cleaned).all()


@pytest.mark.parametrize(("code", "unit", "scale"), [(-9999.0, "um", 1000.0), (-32768, "mm", 1.0), (9999, "mm", -1.0)])
def test_codes_of_a_position_are_missing_whatever_its_unit_and_sign(tmp_path, code, unit, scale):
    rows = table(presses=3)
    rows[:, 1] *= scale
    rows[[30, 31, 140, 141, 250], 1] = code
    depth = {"column": "depth", "unit": unit, **({"scale": -1.0} if scale < 0 else {})}
    made, episodes = imported(tmp_path, write(tmp_path, "npz", rows), position={"file": "run", "depth": depth}, **CUT)
    assert [round(e.press.depth, 3) for e in episodes] == [1.2, 1.2, 1.2]
    assert any(note.startswith("position: 5 numbers") for note in made.notes)


def test_a_proposal_takes_no_code_for_a_depth(tmp_path):
    rows = table(presses=3)
    rows[[30, 31, 140, 141, 250], 1] = -999.0
    path = write(tmp_path, "csv", rows)
    found = proposed_mapping(path, described(path)[0]).document
    assert found["position"]["depth"] == {"column": "depth [mm]"} and found["trials"] == {"press_above": 0.12}


def test_numbers_to_base_16_are_read_and_their_largest_is_none(tmp_path):
    rows = table()
    lines = [",".join(("t [s]", "depth [mm]", "c0", "c1"))]
    lines += [f"{t:.4f},{d:.5f},0x{int(1000 * a):04X},0x{int(1000 * b):04x}" for t, d, a, b in rows.tolist()]
    for row in (40, 41, 42, 90):
        lines[row + 1] = ",".join([*lines[row + 1].split(",")[:2], "0xFFFF", "0x2710"])
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    taxels = {"file": "run", "columns": ["c0", "c1"]}
    _, (episode,) = imported(tmp_path, tmp_path / "run.csv", taxels=taxels)
    assert np.flatnonzero(np.isnan(episode.taxels.counts[:, 0])).tolist() == [40, 41, 42, 90]
    known = np.isfinite(episode.taxels.counts[:, 0])
    np.testing.assert_allclose(episode.taxels.counts[known, 0], np.floor(1000 * rows[known, 2]))


def test_a_clock_is_no_channel_and_text_is_named_as_such(tmp_path):
    rows = table()
    lines = ["t [s];depth [mm];c0 [fF];c1 [fF]"]
    lines += [f"{t:.3f};{d:.4f};R{a:06.2f};R{b:06.2f}".replace(".", ",") for t, d, a, b in rows.tolist()]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    proposal = proposed_mapping(path, described(path)[0])
    assert proposal.document["taxels"]["columns"] == ["c0 [fF]", "c1 [fF]"]
    assert "no column is a channel: c0 [fF] and c1 [fF] hold text" in proposal.questions
    write(tmp_path, "npz", rows)
    with pytest.raises(FormatError, match=r"t of run\.npz is the time, and among the channels"):
        imported(tmp_path, tmp_path / "run.npz", taxels={"file": "run", "columns": [0, 2]})


@pytest.mark.parametrize("rows", [(40,), (40, 140), (40, 41, 140)])
def test_spikes_of_different_size_are_told_and_kept(tmp_path, rows):
    columns = table(presses=4)
    columns[list(rows), 2] += 600 + 50 * np.arange(len(rows))
    made, (episode,) = imported(tmp_path, write(tmp_path, "npz", columns))
    np.testing.assert_allclose(episode.taxels.counts, columns[:, 2:])
    assert any(note.startswith(f"taxels: {len(rows)} numbers") and "count as measured" in note for note in made.notes)


@pytest.mark.parametrize("scale", (1.0, 1e-12, -40.0))
def test_short_taps_and_rare_presses_are_no_spikes(scale):
    depth = np.zeros(3000)
    depth[1000:1012] = depth[2000:2012] = 1.2
    reading = scale * (depth + np.random.default_rng(0).normal(0, 1e-3, len(depth)))
    cleaned, words = without_codes(reading[:, None], "taxels", rails=False)
    assert not words and np.isfinite(cleaned).all()
