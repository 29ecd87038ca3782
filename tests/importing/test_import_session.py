import json
import sys
from datetime import UTC, datetime

import numpy as np
import pytest
import yaml
from foreign import T0, mapping, press_data, wide_csv

from tacdata import cli, provenance
from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.recording import read_session
from tacdata.recording.check.report import check
from tacdata.recording.files.mcap_records import read_records
from tacdata.recording.files.reader import read_episode


def imported(tmp_path, mapping_path, name="session"):
    made = import_session(tmp_path, mapping_path, tmp_path / name)
    return made, [read_episode(path) for path in read_session(made.folder).episodes]


def test_a_press_comes_back_with_its_own_units_rows_and_times(tmp_path):
    time, depth, force, signals = data = press_data()
    wide_csv(tmp_path / "wide.csv", data)
    made, (episode,) = imported(tmp_path, mapping(tmp_path))
    assert made.recordings == 1
    assert made.refused == ()
    np.testing.assert_allclose(episode.taxels.counts, signals, atol=1e-9)
    np.testing.assert_allclose(episode.taxels.sample_ns / 1e9, time, atol=1e-9)
    np.testing.assert_allclose(episode.tip_at(episode.taxels.sample_ns)[:, 2], depth, atol=1e-4)
    (stream,) = episode.measured
    assert (stream.name, stream.unit) == ("force", "N")
    np.testing.assert_allclose(stream.values[:, 0], force, atol=1e-5)
    assert episode.press.depth == pytest.approx(1.5, abs=1e-3)
    assert episode.press.speed == pytest.approx(1.333, rel=0.02)
    assert episode.press.hold == pytest.approx(1.0, abs=0.06)
    assert [p.name for p in episode.phases] == ["rest", "press", "hold", "release"]
    assert episode.press.indenter.document == {"shape": "sphere", "radius": 3.0}
    assert episode.complete
    assert (episode.taxels.counter == -1).all()


def test_semicolons_decimal_commas_and_latin_1_are_read_alike(tmp_path):
    data = press_data()
    wide_csv(tmp_path / "wide.csv", data)
    _, (plain,) = imported(tmp_path, mapping(tmp_path))
    wide_csv(tmp_path / "wide.csv", data, ";", ",", "Prüfstand 3;;;\nt [ms]{0}disp [µm]{0}Fz [g]{0}{1}")
    text = (tmp_path / "wide.csv").read_text()
    (tmp_path / "wide.csv").write_bytes(text.encode("latin-1"))
    made = import_session(tmp_path, tmp_path / "mapping.yaml", tmp_path / "german")
    german = read_episode(made.folder / "episode-000000.mcap")
    np.testing.assert_array_equal(plain.taxels.counts, german.taxels.counts)
    np.testing.assert_allclose(plain.tip, german.tip, atol=1e-12)
    assert any("Latin-1" in note for note in made.notes)


def test_missing_values_stay_missing_and_streams_keep_their_rates(tmp_path):
    time, depth, force, signals = press_data(channels=3)
    missing = np.arange(len(time)) % 2 == 1
    rows = ["t,force,c0,c1,c2"]
    for k, t in enumerate(time):
        c1 = "" if k % 5 == 0 else f"{signals[k, 1]:.4f}"
        rows.append(f"{T0 + t:.6f},{-1 if missing[k] else force[k]:.6f},{signals[k, 0]:.4f},{c1},{signals[k, 2]:.4f}")
    (tmp_path / "wide.csv").write_text("\n".join(rows))
    slow = slice(None, None, 7)
    stage = "\n".join(f"{T0 + t:.6f} {-d:.5f}" for t, d in zip(time[slow], depth[slow], strict=True))
    (tmp_path / "stage.txt").write_text(stage)
    path = mapping(
        tmp_path,
        files={
            "data": {"path": "wide.csv", "time": {"column": "t", "zero": "unix"}},
            "stage": {"path": "stage.txt", "header": False, "time": {"column": 0}},
        },
        taxels={"file": "data", "columns": ["c0", "c1", "c2"], "unit": "pF"},
        position={"file": "stage", "z": {"column": 1, "unit": "mm"}},
        contact={"x": 0.0, "y": 0.0, "z": 0.0, "known_from": "the program's zero"},
        measured={"force": {"file": "data", "columns": "force", "unit": "N", "missing": [-1]}},
    )
    _, (episode,) = imported(tmp_path, path)
    assert np.isnan(episode.taxels.counts[::5, 1]).all()
    assert np.isnan(episode.taxels.counts).sum() == len(time[::5])
    force_stream = episode.measured[0]
    assert len(force_stream.sample_ns) == (~missing).sum(), "a missing force has no row"
    np.testing.assert_allclose(force_stream.values[:, 0], force[~missing], atol=1e-6)
    assert len(episode.cnc.sample_ns) == len(time[slow])
    np.testing.assert_allclose((episode.taxels.sample_ns - episode.taxels.sample_ns[0]) / 1e9, time, atol=2e-6)
    assert abs(episode.taxels.sample_ns[0] / 1e9 - T0) < 1e-3
    assert not any(name.startswith("contact/") for name in episode.rig["imported"]["stand_ins"])


def test_provenance_and_stand_ins_are_in_every_file(tmp_path):
    wide_csv(tmp_path / "wide.csv", press_data())
    path = mapping(tmp_path, indenter=None)
    made, (episode,) = imported(tmp_path, path)
    record = json.loads(read_records(episode.path).attachments["import.json"].data)
    assert record["files"] == [
        {"path": "wide.csv", "sha256": provenance.file_hash(tmp_path / "wide.csv"), "rows": len(press_data()[0])}
    ]
    assert record["mapping_hash"] == provenance.content_hash(yaml.safe_load(path.read_text()))
    assert any(text.startswith("indenter") for text in record["stand_ins"])
    assert any(text.startswith("skin/thickness") for text in record["stand_ins"])
    report = check(made.folder)
    assert report.usable
    assert "indenter" in report.text


def test_every_trial_of_a_column_a_path_a_pause_and_a_press(tmp_path):
    presses = [press_data(seed, depth=1.0 + 0.2 * seed) for seed in range(3)]
    begin, rows = 0.0, ["trial,t,disp,Fz,cap0,cap1,cap2,cap3,cap4"]
    for number, (time, depth, force, signals) in enumerate(presses):
        for k, t in enumerate(time):
            values = [t + begin, depth[k], force[k], *signals[k]]
            rows.append(f"A{number}," + ",".join(f"{value:.5f}" for value in values))
        begin += time[-1] + 2.5
    (tmp_path / "wide.csv").write_text("\n".join(rows))
    units = {
        "position": {"file": "data", "depth": {"column": "disp", "unit": "mm"}},
        "measured": {"force": {"file": "data", "columns": "Fz", "unit": "N"}},
        "files": {"data": {"path": "wide.csv", "time": {"column": "t", "unit": "s"}}},
    }
    for trials in ({"column": "trial"}, {"gap": 1.0}, {"press_above": 0.5}):
        made = import_session(tmp_path, mapping(tmp_path, trials=trials, **units), tmp_path / "-".join(trials))
        episodes = [read_episode(p) for p in read_session(made.folder).episodes]
        assert [round(e.press.depth, 2) for e in episodes] == [1.0, 1.2, 1.4], trials
        assert sum(len(e.taxels.counts) for e in episodes) == len(rows) - 1
    (tmp_path / "runs").mkdir()
    for number, data in enumerate(presses):
        folder = tmp_path / "runs" / f"sphere_{2 + number}mms_rep{number}"
        folder.mkdir()
        wide_csv(folder / "wide.csv", data)
    files = {"data": {"path": "sphere_{speed}mms_{rep}/wide.csv", "time": {"column": "t"}}}
    path = mapping(tmp_path, files=files, press={"speed": {"part": "speed"}})
    made = import_session(tmp_path / "runs", path, tmp_path / "by-path")
    episodes = [read_episode(p) for p in read_session(made.folder).episodes]
    assert [e.press.speed for e in episodes] == [2.0, 3.0, 4.0]
    assert [e.number for e in episodes] == [0, 1, 2]


def test_a_long_table_becomes_wide_without_inventing_anything(tmp_path):
    time, depth, _, signals = press_data(channels=4)
    rows = ["time,channel,value,depth"]
    for k, t in enumerate(time):
        for c in range(4):
            if (k + c) % 11:
                rows.append(f"{t:.4f},c{c},{signals[k, c]:.4f},{depth[k]:.5f}")
    (tmp_path / "wide.csv").write_text("\n".join(rows))
    path = mapping(
        tmp_path,
        files={"data": {"path": "wide.csv", "time": {"column": "time", "unit": "s", "zero": "shared"}}},
        taxels={"file": "data", "long": {"channel": "channel", "value": "value"}, "unit": "pF"},
        position={"file": "data", "depth": {"column": "depth", "unit": "mm"}},
        measured=None,
    )
    _, (episode,) = imported(tmp_path, path)
    want = signals.copy()
    k, c = np.meshgrid(np.arange(len(time)), np.arange(4), indexing="ij")
    want[(k + c) % 11 == 0] = np.nan
    np.testing.assert_allclose(episode.taxels.counts, want, atol=1e-9)


def test_a_schedule_stands_in_for_a_position(tmp_path):
    time, _, _, signals = press_data(channels=5)
    both = np.concatenate([time, time + 8.0])
    np.savez(tmp_path / "data.npz", stamp=both, cap=np.concatenate([signals, signals]))
    path = mapping(
        tmp_path,
        files={"data": {"path": "data.npz", "time": {"column": "stamp", "unit": "s"}}},
        taxels={"file": "data", "columns": "cap", "unit": "pF"},
        position=None,
        measured=None,
        schedule={
            "presses": [
                {"start": 1.0, "depth": 1.5, "speed": 1.0, "hold": 1.0, "x": 0.5},
                {"start": 9.0, "depth": 1.2, "speed": 2.0, "hold": 0.5},
            ]
        },
    )
    _, episodes = imported(tmp_path, path)
    assert [e.press.depth for e in episodes] == [1.5, 1.2]
    assert [p.name for p in episodes[0].phases] == ["rest", "press", "hold", "release"]
    tip = episodes[0].tip_at(np.array([1_000_000_000, 1_750_000_000, 3_000_000_000, 4_750_000_000]))
    np.testing.assert_allclose(tip[:, 2], [0.0, 0.75, 1.5, 0.25], atol=1e-6)
    assert tip[0, 0] == pytest.approx(0.5)
    assert any("not measured" in note for note in episodes[0].notes)


def test_matlab_and_parquet_hold_the_same(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet
    from scipy.io import savemat

    time, depth, force, signals = press_data()
    names = {f"cap{k}": signals[:, k] for k in range(5)}
    table = pa.table({"t": 1000 * time, "disp": depth, "Fz": force, **names})
    parquet.write_table(table, tmp_path / "wide.parquet")
    elements = [{"t": 1000 * time, "disp": depth, "Fz": force, "speed": 1.0 + k, **names} for k in range(2)]
    savemat(tmp_path / "wide.mat", {"trial": elements})
    common = {
        "position": {"file": "data", "depth": {"column": "disp", "unit": "mm"}},
        "measured": {"force": {"file": "data", "columns": "Fz", "unit": "N"}},
    }
    clock = {"column": "t", "unit": "ms"}
    path = mapping(tmp_path, files={"data": {"path": "wide.parquet", "time": clock}}, **common)
    first = import_session(tmp_path, path, tmp_path / "a")
    path = mapping(
        tmp_path,
        files={"data": {"path": "wide.mat", "time": clock}},
        trials={"column": "element"},
        press={"speed": {"column": "speed", "file": "data"}},
        **common,
    )
    second = import_session(tmp_path, path, tmp_path / "b")
    assert (first.recordings, second.recordings) == (1, 2)
    episodes = [read_episode(p) for m in (first, second) for p in read_session(m.folder).episodes]
    for episode in episodes:
        np.testing.assert_allclose(episode.taxels.counts, signals, atol=1e-9)
    assert [e.press.speed for e in episodes[1:]] == [1.0, 2.0]


def refused(tmp_path, **changes):
    if not (tmp_path / "wide.csv").exists():
        wide_csv(tmp_path / "wide.csv", press_data())
    with pytest.raises(TacdataError) as caught:
        import_session(tmp_path, mapping(tmp_path, **changes), tmp_path / "session")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mapping.yaml", "wide.csv"], "nothing is left behind"
    return str(caught.value)


def test_what_does_not_fit_is_said_in_words(tmp_path):
    clock = {"column": "t"}
    assert "'kap0'" in refused(tmp_path, taxels={"file": "data", "columns": ["kap0"]})
    assert "furlong" in refused(tmp_path, position={"file": "data", "depth": {"column": "disp", "unit": "furlong"}})
    assert "neither a position nor" in refused(tmp_path, position=None)
    assert "no file fits nothing.csv" in refused(tmp_path, files={"data": {"path": "nothing.csv", "time": clock}})
    assert "no clock" in refused(tmp_path, files={"data": {"path": "wide.csv"}})
    unix = {"data": {"path": "wide.csv", "time": {"column": "t", "zero": "unix"}}}
    assert "no Unix time" in refused(tmp_path, files=unix)
    assert "the deepest is" in refused(tmp_path, trials={"press_above": 9.0})
    assert "columns times rows" in refused(tmp_path, sensor={"name": "five", "columns": 2, "rows": 2})
    assert "is not among the indenters" in refused(tmp_path, indenter={"shape": "thumb"})
    later = {"presses": [{"start": 500.0, "depth": 1.0, "speed": 1.0}]}
    assert "no press lies within" in refused(tmp_path, position=None, schedule=later)


def test_clocks_without_a_common_zero_or_time_are_refused(tmp_path):
    time, depth, _, _ = press_data()
    wide_csv(tmp_path / "wide.csv", press_data())
    stage = "t,d\n" + "\n".join(f"{T0 + t:.4f},{d:.4f}" for t, d in zip(time, depth, strict=True))
    (tmp_path / "stage.csv").write_text(stage)

    def attempt(clock):
        path = mapping(
            tmp_path,
            files={
                "data": {"path": "wide.csv", "time": {"column": "t"}},
                "stage": {"path": "stage.csv", "time": {"column": "t", **clock}},
            },
            position={"file": "stage", "depth": {"column": "d", "unit": "mm"}},
        )
        return imported(tmp_path, path)

    with pytest.raises(FormatError, match="common zero"):
        attempt({})
    with pytest.raises(FormatError, match="do not overlap"):
        attempt({"offset": -5.0})
    _, (episode,) = attempt({"offset": -T0})
    np.testing.assert_allclose(episode.tip_at(episode.taxels.sample_ns)[:, 2], depth, atol=1e-3)


def test_a_broken_trial_does_not_take_the_others_with_it(tmp_path, monkeypatch, capfd):
    for number in range(3):
        wide_csv(tmp_path / f"run{number}.csv", press_data(number))
    text = (tmp_path / "run1.csv").read_text().splitlines()
    for row in range(40, 60):
        text[row] = text[row].replace(text[row].split(",")[1], "OVERLOAD")
    (tmp_path / "run1.csv").write_text("\n".join(text))
    path = mapping(tmp_path, files={"data": {"path": "run{n}.csv", "time": {"column": "t"}}})
    out = tmp_path / "session"
    monkeypatch.setattr(sys, "argv", ["tacdata", "import", str(tmp_path), "--mapping", str(path), "--out", str(out)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    said = capfd.readouterr().out
    assert caught.value.code == 3
    assert "2 recordings" in said
    assert "OVERLOAD" in said
    assert "row 40" in said
    assert len(read_session(out).episodes) == 2
    with pytest.raises(UsageError, match="exists"):
        import_session(tmp_path, path, out)


def test_looking_first_proposes_a_mapping_that_works(tmp_path, monkeypatch, capfd):
    wide_csv(tmp_path / "wide.csv", press_data())

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["tacdata", "import", *map(str, arguments)])
        try:
            cli.main()
        except SystemExit as caught:
            assert not caught.code, capfd.readouterr().err
        return capfd.readouterr().out

    assert "cap4 (pF)" in run(tmp_path)
    proposal = tmp_path / "proposal.yaml"
    run(tmp_path, "--propose", proposal)
    found = yaml.safe_load(proposal.read_text())
    assert found["position"]["depth"] == {"column": "disp [um]"}
    assert found["taxels"]["columns"] == [f"cap{k} (pF)" for k in range(5)]
    assert found["measured"]["force"]["columns"] == ["Fz [g]"]
    run(tmp_path, "--mapping", proposal, "--out", tmp_path / "session")
    assert read_episode(tmp_path / "session" / "episode-000000.mcap").press.depth == pytest.approx(1.5, abs=1e-3)


def test_a_load_cell_alone_is_the_sensor_and_a_second_length_a_gauge(tmp_path):
    rows = [f"0,{0.1 * k:.1f},{0.01 * k},{0.012 * k},{0.1 * k}" for k in range(9)]
    lines = ["run,t_s,lvdt_mm,crosshead_mm,Fz_N", *rows]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    tables, _ = described(tmp_path)
    found = proposed_mapping(tmp_path, tables).document
    assert found["taxels"] == {"file": "log", "columns": ["Fz_N"], "unit": "N"}
    assert found["position"]["depth"]["column"] == "crosshead_mm", "what was commanded"
    assert found["measured"] == {"displacement": {"file": "log", "columns": ["lvdt_mm"], "unit": "mm"}}


def test_speeds_with_decimals_in_names_are_one_kind_of_file_and_a_single_axis_is_what_presses(tmp_path):
    for high, name in enumerate(("00_at-0.2mms", "01_at1mms", "02_at1.5mms")):
        lines = ["t_s,x_mm,P_kPa", *[f"{0.1 * k:.1f},{0.1 * min(k, 20 - k)},{k + high}" for k in range(21)]]
        (tmp_path / f"trial_{name}.csv").write_text("\n".join(lines))
    tables, _ = described(tmp_path)
    found = proposed_mapping(tmp_path, tables).document
    assert [file["path"] for file in found["files"].values()] == ["trial_{part0}_at{part1}mms.csv"]
    assert found["position"]["depth"] == {"column": "x_mm"}
    assert found["taxels"]["columns"] == ["P_kPa"]
    proposal = tmp_path / "mapping.yaml"
    proposal.write_text(yaml.safe_dump(found))
    assert import_session(tmp_path, proposal, tmp_path / "session").recordings == 3


@pytest.mark.parametrize(
    ("write", "zero"),
    [
        (lambda t: f"{1000 * (T0 + t):.1f}", T0),
        (lambda t: f"{round((T0 + t) * 1e9)}", T0),
        (lambda t: datetime.fromtimestamp(T0 + t, UTC).isoformat(), T0),
        (lambda t: f"23:59:{58.5 + t:06.3f}" if t < 1.5 else f"00:00:{t - 1.5:06.3f}", 86398.5),
        (lambda t: f"{t - 3.0:.4f}", 0.0),
    ],
    ids=["unix ms", "unix ns", "iso", "time of day", "negative"],
)
def test_clocks_of_every_kind_give_the_same_times(write, zero, tmp_path):
    time, depth, _, signals = press_data(channels=1)
    rows = ["stamp,d,c", *(f"{write(t)},{d:.5f},{c[0]:.4f}" for t, d, c in zip(time, depth, signals, strict=True))]
    (tmp_path / "wide.csv").write_text("\n".join(rows))
    path = mapping(
        tmp_path,
        files={"data": {"path": "wide.csv", "time": {"column": "stamp"}}},
        measured=None,
        taxels={"file": "data", "columns": "c"},
        position={"file": "data", "depth": {"column": "d", "unit": "mm"}},
    )
    _, (episode,) = imported(tmp_path, path)
    assert episode.taxels.sample_ns[0] / 1e9 == pytest.approx(zero, abs=1e-3)
    step = 1e-3 if zero == T0 else 1e-4
    np.testing.assert_allclose((episode.taxels.sample_ns - episode.taxels.sample_ns[0]) / 1e9, time, atol=step)


def days(path, begin, header="t,disp [mm],cap0 (pF)"):
    """Write a press at 20 Hz whose times are days from ``begin``."""
    rows = [f"{begin + 0.05 * k / 86_400:.11f},{0.01 * k:.3f},{20 + 0.02 * k:.4f}" for k in range(120)]
    path.write_text("\n".join([header, *rows]) + "\n")


@pytest.mark.parametrize(("begin", "unit"), [(740_311.375, "datenum"), (46_351.375, "excel")])
def test_times_in_days_are_refused_without_a_unit_and_dates_with_one(tmp_path, begin, unit):
    days(tmp_path / "wide.csv", begin)
    changes = {"taxels": {"file": "data", "columns": ["cap0"], "unit": "pF"}, "measured": None}
    assert f"unit: {unit}" in refused(tmp_path, **changes)
    for named in (unit, "d"):
        clock = {"column": "t", "unit": named}
        path = mapping(tmp_path, files={"data": {"path": "wide.csv", "time": clock}}, **changes)
        _, (episode,) = imported(tmp_path, path, f"session {named}")
        seconds = (episode.taxels.sample_ns - episode.taxels.sample_ns[0]) * 1e-9
        np.testing.assert_allclose(np.diff(seconds), 0.05, atol=2e-4)


@pytest.mark.parametrize(
    ("header", "step"),
    [("d", 0.05 / 86_400), ("days", 0.05 / 86_400), ("hours", 0.05 / 3600), ("msec", 50), ("10 ms", 5), ("s", 0.05)],
)
def test_a_unit_in_a_header_is_understood(tmp_path, header, step):
    rows = [f"{step * k:.12f},{0.01 * k:.3f},{20 + 0.02 * k:.4f}" for k in range(120)]
    (tmp_path / "wide.csv").write_text("\n".join([f"t [{header}],disp [mm],cap0 (pF)", *rows]) + "\n")
    path = mapping(tmp_path, taxels={"file": "data", "columns": ["cap0"], "unit": "pF"}, measured=None)
    _, (episode,) = imported(tmp_path, path)
    np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 50_000_000, atol=10_000)


def test_a_unit_of_time_that_is_not_known_is_refused_with_those_that_are(tmp_path):
    rows = [f"{k},{0.01 * k:.3f},{20 + 0.02 * k:.4f}" for k in range(120)]
    (tmp_path / "wide.csv").write_text("\n".join(["t [jiffies],disp [mm],cap0 (pF)", *rows]) + "\n")
    taxels = {"file": "data", "columns": ["cap0"], "unit": "pF"}
    assert "'jiffies'" in refused(tmp_path, taxels=taxels, measured=None)


@pytest.mark.parametrize("text", ["#DIV/0!", "#N/A", "#NV", "#NUM!"])
def test_a_spreadsheets_errors_are_missing_values_in_the_first_column_too(tmp_path, text):
    rows = [[20 + 0.02 * k, 0.01 * k, 0.05 * k] for k in range(120)]
    lines = [f"{text if k % 5 == 3 else a},{d:.3f},{t:.3f}" for k, (a, d, t) in enumerate(rows)]
    lines.insert(60, "# the operator coughed")
    (tmp_path / "wide.csv").write_text("\n".join(["cap0 (pF),disp [mm],t [s]", *lines]) + "\n")
    path = mapping(tmp_path, taxels={"file": "data", "columns": ["cap0"], "unit": "pF"}, measured=None)
    made, (episode,) = imported(tmp_path, path)
    assert len(episode.taxels.counts) == 120
    assert np.isnan(episode.taxels.counts).sum() == 24
    assert any("1 comment lines" in note for note in made.notes)


@pytest.mark.parametrize("kind", ["mat", "npz", "csv.gz", "parquet"])
def test_damaged_files_end_in_words_whatever_the_library_raises(tmp_path, kind):
    """One byte flipped, or the end cut off, at many places: read, or refused as a format error."""
    import gzip

    import pyarrow as pa
    from pyarrow import parquet
    from scipy.io import savemat

    rng = np.random.default_rng(0)
    columns = {"t": np.arange(400) * 0.02, "cap0": rng.normal(20, 1, 400)}
    whole = tmp_path / f"whole.{kind}"
    if kind == "mat":
        savemat(whole, columns, do_compression=True)
    elif kind == "npz":
        np.savez_compressed(whole, **columns)
    elif kind == "parquet":
        parquet.write_table(pa.table(columns), whole)
    else:
        lines = [",".join(columns), *(f"{a:.3f},{b:.6f}" for a, b in zip(*columns.values(), strict=True))]
        whole.write_bytes(gzip.compress("\n".join(lines).encode(), mtime=0))
    data, damaged = whole.read_bytes(), tmp_path / f"damaged.{kind}"
    outcomes = []
    for _ in range(120):
        broken = bytearray(data)
        at = int(rng.integers(len(data)))
        if rng.random() < 0.5:
            broken[at] ^= int(rng.integers(1, 256))
        else:
            broken = broken[:at]
        damaged.write_bytes(broken)
        try:
            outcomes.append(read_table(damaged).rows)
        except FormatError as error:
            assert "damaged" in str(error)
            outcomes.append("refused")
    assert outcomes.count("refused") > 30


def test_one_damaged_file_of_a_series_leaves_the_good_ones_in(tmp_path):
    for number in range(3):
        time, depth, _, signals = press_data(number)
        np.savez_compressed(tmp_path / f"run{number}.npz", t=time, disp=depth, cap=signals)
    data = bytearray((tmp_path / "run1.npz").read_bytes())
    data[len(data) // 2 : len(data) // 2 + 16] = b"\xff" * 16
    (tmp_path / "run1.npz").write_bytes(data)
    path = mapping(
        tmp_path,
        files={"data": {"path": "run{n}.npz", "time": {"column": "t", "unit": "s"}}},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
        measured=None,
    )
    made, episodes = imported(tmp_path, path)
    assert len(episodes) == 2
    assert "run1.npz" in " ".join(made.refused)


def array_mapping(tmp_path, path, **changes):
    changes = {"taxels": {"file": "data", "columns": "cap[0-4]", "unit": "pF"}, "measured": None, **changes}
    position = changes.pop("position", {"file": "data", "depth": {"column": "stage[1]", "unit": "mm"}})
    files = changes.pop("files", {"data": {"path": path, "time": {"column": "stage[0]", "unit": "s"}}})
    return mapping(tmp_path, files=files, position=position, **changes)


@pytest.mark.parametrize("kind", ["npz", "mat", "npy"])
def test_columns_inside_arrays_are_named_by_their_numbers(tmp_path, kind):
    from scipy.io import savemat

    time, depth, _, signals = press_data()
    stage = np.stack([time, depth], axis=1)
    if kind == "npz":
        np.savez(tmp_path / "a.npz", stage=stage, cap=signals)
    elif kind == "mat":
        savemat(tmp_path / "a.mat", {"stage": stage, "cap": signals})
    else:
        np.save(tmp_path / "a.npy", np.concatenate([stage, signals], axis=1))
    if kind == "npy":
        path = array_mapping(
            tmp_path,
            "a.npy",
            taxels={"file": "data", "columns": "2-6", "unit": "pF"},
            files={"data": {"path": "a.npy", "time": {"column": 0, "unit": "s"}}},
            position={"file": "data", "depth": {"column": "array[1]", "unit": "mm"}},
        )
    else:
        path = array_mapping(tmp_path, f"a.{kind}")
    _, (episode,) = imported(tmp_path, path)
    np.testing.assert_allclose(episode.taxels.counts, signals, atol=1e-9)
    assert episode.press.depth == pytest.approx(depth.max(), abs=1e-3)


def test_an_array_where_one_column_is_meant_is_refused_with_its_columns(tmp_path):
    time, depth, _, signals = press_data()
    np.savez(tmp_path / "a.npz", stage=np.stack([time, depth], axis=1), cap=signals)
    for column, words in (("stage", r"stage\[0\] to stage\[1\]"), ("stage[2]", "is not in a.npz")):
        with pytest.raises(FormatError, match=words):
            imported(tmp_path, array_mapping(tmp_path, "a.npz", position={"file": "data", "depth": {"column": column}}))


@pytest.mark.parametrize("axis", [0, 2])
def test_trials_along_an_axis_of_an_array_become_recordings(tmp_path, axis):
    runs = [press_data(seed) for seed in range(3)]
    time = runs[0][0]
    depth = np.stack([run[1] for run in runs])  # one value a trial and row
    signals = np.stack([run[3] for run in runs])
    np.savez(tmp_path / "a.npz", t=time, disp=depth, cap=np.moveaxis(signals, 0, axis))
    path = array_mapping(
        tmp_path,
        "a.npz",
        taxels={"file": "data", "columns": "cap", "unit": "pF"},
        trials={"column": "trial"},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
        files={"data": {"path": "a.npz", "trial_axis": axis, "time": {"column": "t", "unit": "s"}}},
    )
    made, episodes = imported(tmp_path, path)
    assert made.recordings == 3
    for episode, run in zip(episodes, runs, strict=True):
        np.testing.assert_allclose(episode.taxels.counts, run[3], atol=1e-9)


def test_rows_with_more_words_than_numbers_are_data(tmp_path):
    time, depth, _, signals = press_data(channels=1)
    lines = ["t,disp,lab,person,skin,batch,remark,cap0"]
    rows = zip(time, depth, signals[:, 0], strict=True)
    lines += [f"{a:.3f},{b:.4f},north,Ada,blue,B7,fine,{c:.4f}" for a, b, c in rows]
    (tmp_path / "wide.csv").write_text("\n".join(lines) + "\n")
    clock = {"column": "t", "unit": "s"}
    path = mapping(
        tmp_path,
        files={"data": {"path": "wide.csv", "time": clock}},
        measured=None,
        taxels={"file": "data", "columns": ["cap0"], "unit": "pF"},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
    )
    _, (episode,) = imported(tmp_path, path)
    assert len(episode.taxels.counts) == len(time)


def test_an_excel_sheet_is_read_like_a_text_file(tmp_path):
    from datetime import timedelta

    from openpyxl import Workbook

    time, depth, force, signals = press_data()
    book = Workbook()
    book.active.title = "cover"
    book.active.append(["made by hand"])
    sheet = book.create_sheet("run 1")
    sheet.append(["when", "disp [um]", "Fz (N)", *(f"cap{k} (pF)" for k in range(5))])
    begin = datetime(2026, 1, 31, 12)
    for t, d, f, row in zip(time, depth, force, signals, strict=True):
        sheet.append([begin + timedelta(seconds=float(t)), 1000 * d, f, *map(float, row)])
    book.create_sheet("notes").append(["none"])
    book.save(tmp_path / "wide.xlsx")
    path = mapping(tmp_path, files={"data": {"path": "wide.xlsx", "time": {"column": "when"}}})
    _, (episode,) = imported(tmp_path, path)
    np.testing.assert_allclose(episode.taxels.counts, signals, atol=1e-9)
    np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 20_000_000, atol=1e6)
    assert episode.press.depth == pytest.approx(depth.max(), abs=1e-3)
    assert episode.measured[0].unit == "N"
    files = {"data": {"path": "wide.xlsx", "table": "run 2", "time": {"column": "when"}}}
    with pytest.raises(FormatError, match="no sheet run 2"):
        imported(tmp_path, mapping(tmp_path, files=files), "again")


@pytest.mark.parametrize(
    ("layout", "columns"),
    [
        ("%d.%m.%Y;%H:%M:%S.%f", 2),
        ("%m/%d/%Y;%I:%M:%S.%f %p", 2),
        ("%Y%m%d;%H:%M:%S.%f", 2),
        ("%d-%b-%Y %H:%M:%S.%f", 1),
    ],
)
def test_dates_in_two_columns_and_of_any_land_are_read(tmp_path, layout, columns):
    from datetime import timedelta

    time, depth, _, signals = press_data(channels=1)
    begin = datetime(2026, 1, 31, 12, 59, 58)
    stamps = [(begin + timedelta(seconds=float(t))).strftime(layout) for t in time]
    names = "day;clock" if columns == 2 else "when"
    rows = zip(stamps, depth, signals[:, 0], strict=True)
    lines = [f"{names};disp;cap0", *(f"{s};{d:.4f};{c:.4f}" for s, d, c in rows)]
    (tmp_path / "wide.csv").write_text("\n".join(lines) + "\n")
    column = ["day", "clock"] if columns == 2 else "when"
    path = mapping(
        tmp_path,
        files={"data": {"path": "wide.csv", "time": {"column": column}}},
        measured=None,
        taxels={"file": "data", "columns": ["cap0"], "unit": "pF"},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
    )
    _, (episode,) = imported(tmp_path, path)
    first = begin.replace(tzinfo=UTC).timestamp()
    assert episode.taxels.sample_ns[0] * 1e-9 == pytest.approx(first, abs=1e-3)
    np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 20_000_000, atol=2000)


def test_days_and_months_that_could_change_places_are_asked_for(tmp_path):
    rows = [f"03/04/2026 12:00:{k / 20:09.6f},{0.01 * k:.3f},{20 + 0.02 * k:.4f}" for k in range(120)]
    (tmp_path / "wide.csv").write_text("\n".join(["t,disp [mm],cap0 (pF)", *rows]) + "\n")
    changes = {"taxels": {"file": "data", "columns": ["cap0"], "unit": "pF"}, "measured": None}
    said = refused(tmp_path, **changes)
    assert "%d/%m/%Y" in said and "%m/%d/%Y" in said and "give format" in said
    clock = {"column": "t", "format": "%d/%m/%Y %H:%M:%S.%f"}
    path = mapping(tmp_path, files={"data": {"path": "wide.csv", "time": clock}}, **changes)
    _, (episode,) = imported(tmp_path, path)
    assert datetime.fromtimestamp(episode.taxels.sample_ns[0] * 1e-9, UTC).month == 4


def test_place_and_height_of_contact_of_each_press_come_from_paths_and_columns(tmp_path):
    time, depth, _, signals = press_data(channels=1)
    for name, height in (("site_x1p5_y-2", 10.0), ("site_x-3_y0.5", 12.5)):
        lines = ["t,z,touch,cap0"]
        rows = zip(time, depth, signals[:, 0], strict=True)
        lines += [f"{a:.3f},{height - b:.4f},{height},{c:.4f}" for a, b, c in rows]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    path = mapping(
        tmp_path,
        files={"data": {"path": "site_{place}.csv", "time": {"column": "t", "unit": "s"}}},
        measured=None,
        taxels={"file": "data", "columns": ["cap0"], "unit": "pF"},
        position={"file": "data", "z": {"column": "z", "unit": "mm"}},
        contact={"x": 0.0, "y": 0.0, "z": {"column": "touch", "file": "data"}, "known_from": "first reading"},
        press={"x": {"part": "place", "pattern": "x([-0-9p.]+)"}, "y": {"part": "place", "pattern": "y([-0-9p.]+)"}},
    )
    _, episodes = imported(tmp_path, path)
    assert sorted((e.press.x, e.press.y) for e in episodes) == [(-3.0, 0.5), (1.5, -2.0)]
    assert [e.press.depth for e in episodes] == pytest.approx([depth.max()] * 2, abs=1e-3)
    changes = {"press": {"x": {"part": "place"}}}
    document = yaml.safe_load(path.read_text()) | changes
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(FormatError, match="holds 2 numbers"):
        imported(tmp_path, path, "again")


def test_a_schedule_may_go_up_at_another_speed(tmp_path):
    rows = [f"{0.02 * k:.3f},{20 + 0.01 * k:.4f}" for k in range(400)]
    (tmp_path / "wide.csv").write_text("\n".join(["t,cap0", *rows]) + "\n")
    press = {"start": 1.0, "depth": 1.0, "speed": 0.5, "release_speed": 2.0, "hold": 1.0}
    path = mapping(
        tmp_path,
        files={"data": {"path": "wide.csv", "time": {"column": "t", "unit": "s"}}},
        measured=None,
        taxels={"file": "data", "columns": ["cap0"], "unit": "pF"},
        position=None,
        schedule={"presses": [press]},
    )
    _, (episode,) = imported(tmp_path, path)
    spans = {phase.name: (phase.end_ns - phase.start_ns) * 1e-9 for phase in episode.phases}
    assert spans["press"] == pytest.approx(2.0) and spans["release"] == pytest.approx(0.5)


def test_umlauts_that_look_the_same_are_the_same(tmp_path):
    """A Mac writes an umlaut in a file's name as two characters, a mapping typed elsewhere as one."""
    time, depth, _, signals = press_data(channels=1)
    lines = ["t,Weg_u\u0308ber_Null,cap0"]
    lines += [f"{a:.3f},{b:.4f},{c:.4f}" for a, b, c in zip(time, depth, signals[:, 0], strict=True)]
    (tmp_path / "Pru\u0308fling_7.csv").write_text("\n".join(lines) + "\n")
    path = mapping(
        tmp_path,
        measured=None,
        files={"data": {"path": "Pr\u00fcfling_{n}.csv", "time": {"column": "t", "unit": "s"}}},
        taxels={"file": "data", "columns": ["cap0"], "unit": "pF"},
        position={"file": "data", "depth": {"column": "Weg_\u00fcber_Null", "unit": "mm"}},
    )
    _, (episode,) = imported(tmp_path, path)
    assert episode.press.depth == pytest.approx(depth.max(), abs=1e-3)


def test_recordings_joined_into_one_file_are_told_apart_in_words(tmp_path):
    """`cat a.mcap b.mcap`: nothing of the second would be read, and nobody told."""
    wide_csv(tmp_path / "wide.csv", press_data())
    made, _ = imported(tmp_path, mapping(tmp_path))
    (file,) = sorted(made.folder.glob("*.mcap"))
    joined = tmp_path / "joined.mcap"
    joined.write_bytes(2 * file.read_bytes())
    with pytest.raises(FormatError, match=f"another one begins at byte {file.stat().st_size}"):
        read_episode(joined)


def test_rows_of_a_clock_of_whole_seconds_are_spread(tmp_path):
    """Depth is looked up by time: rows of one time would all have the depth of one of them."""
    depth = np.concatenate([np.zeros(20), np.linspace(0, 2, 40), np.linspace(2, 0, 40), np.zeros(20)])
    rows = [f"12:00:{k // 10:02d},{z:.3f},{100 * z:.2f}" for k, z in enumerate(depth)]
    (tmp_path / "wide.csv").write_text("\n".join(["time,depth_mm,cap0", *rows]))
    entry = {"file": "data", "depth": {"column": "depth_mm"}}
    path = mapping(
        tmp_path, files={"data": {"path": "wide.csv", "time": {"column": "time"}}}, position=entry, measured=None
    )
    made = import_session(tmp_path, path, tmp_path / "session")
    [episode] = [read_episode(p) for p in read_session(made.folder).episodes]
    assert np.diff(episode.taxels.sample_ns) == pytest.approx(1e8, rel=1e-6)
    seen = episode.tip_at(episode.taxels.sample_ns)[:, 2]
    assert seen == pytest.approx(episode.taxels.counts[:, 0] / 100, abs=1e-3)
    assert any("spread evenly" in note for note in made.notes)
