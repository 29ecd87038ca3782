"""Files as strangers keep them, proposed and imported as they stand: right figures, or words that say why not."""

import json

import h5py
import numpy as np
import pytest
import yaml
from sources import NAMES, table

from tacdata.errors import TacdataError
from tacdata.importing.imported_session import import_session
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode

ROWS = table()


def lines(rows, mark=",", names=NAMES, places=4):
    """Return rows as text below their names."""
    return "\n".join([mark.join(names), *(mark.join(f"{value:.{places}f}" for value in row) for row in rows)]) + "\n"


def grouped(sign, decimal, mark):
    """Return rows whose channels are in fF, with a sign between thousands."""
    swap = str.maketrans({",": sign, ".": decimal})
    cells = [
        [f"{v:.4f}".translate(swap) for v in r[:2]] + [f"{v:,.1f}".translate(swap) for v in 1000 * r[2:]] for r in ROWS
    ]
    return "\n".join([mark.join(NAMES).replace("pF", "fF"), *(mark.join(row) for row in cells)]) + "\n"


def imported(folder, files):
    """Return the recordings of files that are imported by their proposal, and the proposal's questions."""
    source = folder / "files"
    source.mkdir()
    for name, text in files.items():
        (source / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return of(source)


def of(source):
    """Return the recordings of a source by its proposal, and the proposal's questions."""
    proposal = proposed_mapping(source, described(source)[0])
    place = source.parent / "mapping.yaml"
    place.write_text(yaml.safe_dump(proposal.document))
    made = import_session(source, place, source.parent / "session")
    return [read_episode(path) for path in read_session(made.folder).episodes], [*proposal.questions, *made.notes]


def are_right(episodes, count=2, scale=1.0):
    """Whether depth, rate and first channel of each recording are those of the table."""
    assert len(episodes) == count
    for episode in episodes:
        assert episode.press.depth == pytest.approx(1.2, rel=1e-3)
        assert np.median(np.diff(episode.taxels.sample_ns)) == 50_000_000
        depth = np.interp(episode.taxels.sample_ns, episode.tip_ns, episode.tip[:, 2])
        assert np.abs(episode.taxels.counts[:, 0] / scale - 10 - depth).max() < 0.05


@pytest.mark.parametrize(
    ("sign", "decimal", "mark"), ((".", ",", ";"), ("'", ".", ";"), ("\u202f", ",", ";"), (",", ".", "\t"))
)
def test_signs_between_thousands_are_read_where_the_decimal_sign_is_clear(tmp_path, sign, decimal, mark):
    episodes, _ = imported(tmp_path, {"run.csv": grouped(sign, decimal, mark)})
    are_right(episodes, scale=1000.0)


def test_whole_thousands_next_to_decimals_are_refused_as_unclear(tmp_path):
    text = grouped(".", ",", ";").replace(",0\n", "\n")
    text = "\n".join(
        ";".join([*row.split(";")[:2], *(c.partition(",")[0] for c in row.split(";")[2:])]) for row in text.split("\n")
    )
    with pytest.raises(TacdataError, match="does it separate thousands"):
        imported(tmp_path, {"run.csv": text})


@pytest.mark.parametrize(
    "text",
    (
        "\n".join(f"t_s:{a:.2f},depth_mm:{b:.4f},c0:{c:.4f},c1:{d:.4f}" for a, b, c, d in ROWS),
        "\n".join(f"t_s={a:.2f} depth_mm={b:.4f} c0={c:.4f} c1={d:.4f}" for a, b, c, d in ROWS),
        "t depth c0 c1\n" + "\n".join(" ".join(f"{v:+.5E}".replace("E", "D") for v in row) for row in ROWS),
        "# settings: " + "a0b1" * 75_000 + "\n" + lines(ROWS),
        json.dumps({"columns": list(NAMES), "index": list(range(len(ROWS))), "data": ROWS.tolist()}),
    ),
    ids=("labels", "keys", "fortran", "long line", "split by pandas"),
)
def test_forms_of_rows(tmp_path, text):
    name = "run.json" if text.startswith("{") else "run.txt"
    are_right(imported(tmp_path, {name: text})[0])


def test_files_in_different_units_are_read_each_in_its_own(tmp_path):
    inches = lines(ROWS / [1, 25.4, 1, 1], names=("t [s]", "depth [in]", *NAMES[2:]), places=7)
    are_right(imported(tmp_path, {"run_1.csv": lines(ROWS), "run_2.csv": inches})[0], 4)


def test_other_units_in_mid_file_are_refused(tmp_path):
    head = ("t,depth,c0,c1\ns,mm,pF,pF\n", "t,depth,c0,c1\ns,cm,pF,pF\n")
    parts = [lines(part, names=()).lstrip() for part in (ROWS[:120], ROWS[120:] / [1, 10, 1, 1])]
    with pytest.raises(TacdataError, match="other units"):
        imported(tmp_path, {"run.csv": head[0] + parts[0] + head[1] + parts[1]})


def test_trials_side_by_side_are_not_taken_for_channels(tmp_path):
    for number, names in enumerate(
        ((*NAMES, *(f"{name}.1" for name in NAMES)), [f"{n}_{k}" for k in (1, 2) for n in ("t", "depth", "c0", "c1")])
    ):
        (tmp_path / str(number)).mkdir()
        episodes, said = imported(tmp_path / str(number), {"run.csv": lines(np.hstack([ROWS, ROWS]), names=names)})
        assert {episode.taxels.counts.shape[1] for episode in episodes} == {2}
        assert any("only the first is read" in text for text in said)


def test_rows_that_were_never_filled_are_no_presses(tmp_path):
    filled = np.zeros((1000, 4))
    filled[: len(ROWS)] = ROWS
    (tmp_path / "files").mkdir()
    np.savez(tmp_path / "files" / "run.npz", t=filled[:, 0], depth=filled[:, 1], c=filled[:, 2:])
    episodes, said = of(tmp_path / "files")
    are_right(episodes)
    assert any("800 rows at its end hold zeros alone" in text for text in said)


def test_a_position_in_steps_is_no_length(tmp_path):
    with pytest.raises(TacdataError, match="unit 'steps'"):
        imported(tmp_path, {"run.csv": lines(ROWS * [1, 400, 1, 1], names=("t [s]", "z_steps", *NAMES[2:]))})


def test_a_rate_without_a_unit_is_in_hertz(tmp_path):
    text = '# {"sampling rate": 20, "device": "a"}\n' + lines(ROWS[:, 1:], names=NAMES[1:])
    are_right(imported(tmp_path, {"run.txt": text})[0])


def test_the_actions_of_a_policy_are_no_readings(tmp_path):
    (tmp_path / "files").mkdir()
    with h5py.File(tmp_path / "files" / "run.h5", "w") as file:
        for trial in (0, 1):
            rows = table(seed=trial)  # a copy would be left out
            for name, values in (("obs/t", rows[:, 0]), ("obs/depth", rows[:, 1]), ("obs/c", rows[:, 2:])):
                file[f"data/demo_{trial}/{name}"] = values
            file[f"data/demo_{trial}/actions"] = np.ones((len(rows), 4))
    are_right(of(tmp_path / "files")[0], 4)


def test_two_boards_in_one_file_stand_side_by_side(tmp_path):
    (tmp_path / "files").mkdir()
    with h5py.File(tmp_path / "files" / "run.h5", "w") as file:
        for name, columns in (("stage/depth", 1), ("left/c", slice(2, 4)), ("right/c", slice(2, 4))):
            file[name], file[f"{name.partition('/')[0]}/t"] = ROWS[:, columns], ROWS[:, 0]
    episodes, _ = of(tmp_path / "files")
    are_right(episodes)
    assert episodes[0].taxels.counts.shape[1] == 4
