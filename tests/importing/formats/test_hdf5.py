"""HDF5 and TDMS: what is one table, what is asked about, and what attributes state."""

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from sources import table

from tacdata.errors import FormatError
from tacdata.importing.formats import hdf5
from tacdata.importing.formats.hdf5 import tables_of
from tacdata.importing.formats.source_format import read_table, tables_in
from tacdata.importing.mapping import ReadOptions

ROWS = table()
START = np.datetime64("2025-11-29T12:00:00")


@pytest.mark.parametrize(
    ("rows", "tables"),
    (
        ({"t": 9, "board/c0": 9, "board/c1": 9}, {"": 3}),
        ({"t": 9, "c0": 9, "gain": 24}, {"t": 2, "gain": 1}),
        ({"data/demo_0/t": 9, "data/demo_0/obs/c": 9, "data/demo_1/t": 9, "data/demo_1/obs/c": 9},
         {"data/demo_0": 2, "data/demo_1": 2}),
        ({"stage/t": 5, "stage/z": 5, "board/t": 9, "board/c": 9}, {"stage": 2, "board": 2}),
        ({"t": 9, "left/c": 9, "right/c": 9}, {"": 3}),
        ({"d_0/t": 9, "d_0/z": 9, "d_0/k": 24, "d_1/t": 8, "d_1/z": 8}, {"d_0": 2, "d_0/k": 1, "d_1": 2}),
        ({"t": 9, "trial_1/z": 9, "trial_2/z": 9}, {"trial_1": 1, "trial_2": 1, "": 1}),
        ({"soft/t": 9, "soft/z": 9, "hard/t": 8, "hard/z": 8}, {"soft": 2, "hard": 2}),
    ),
)  # fmt: skip
def test_arrays_of_one_group_and_length_are_a_table(rows, tables):
    assert {name: len(members) for name, members in tables_of(rows).items()} == tables


def test_arrays_that_differ_by_a_number_are_trials():
    assert list(tables_of({"run1": 9, "run2": 8, "run3": 9}, ["run1", "run2", "run3"])) == ["run1", "run2", "run3"]


def test_one_of_several_tables_is_named_and_none_is_guessed(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, rows in (("stage", ROWS[::4]), ("board", ROWS)):
            file[f"{name}/t"], file[f"{name}/values"] = rows[:, 0], rows[:, 1:]
    assert tables_in(tmp_path / "run.h5") == ("board", "stage")
    with pytest.raises(FormatError, match="2 tables, and none is named") as error:
        read_table(tmp_path / "run.h5")
    assert error.value.allowed == "board, stage"
    assert read_table(tmp_path / "run.h5", ReadOptions(table="stage")).columns["values"].shape == (len(ROWS) // 4, 3)


def test_an_index_without_an_end_is_refused(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["c"] = ROWS

    def circle(_):
        while True:
            pass

    monkeypatch.setattr(hdf5, "_datasets", circle)
    monkeypatch.setattr(hdf5, "LONGEST", 1)
    with pytest.raises(FormatError, match="its index is damaged"):
        read_table(tmp_path / "run.h5")


def test_attributes_give_units_scales_fills_and_a_rate(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.attrs["sampling_rate"] = 20.0
        counts = np.round(ROWS[:, 1] * 1000).astype("i2")
        counts[7] = -1
        file["depth"], file["c0"] = counts, ROWS[:, 2]
        for name, value in (("Units", "mm"), ("scale_factor", 0.001), ("_FillValue", np.int16(-1))):
            file["depth"].attrs[name] = value
    found = read_table(tmp_path / "run.h5")
    assert found.units == {"depth": "mm"} and found.rate == 20.0
    assert np.isnan(found.columns["depth"][7])
    assert np.nanmax(found.columns["depth"]) == pytest.approx(1.2)


def test_parts_that_were_never_written_have_no_value_and_are_told(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, column in (("t", 0), ("depth", 1)):
            file.create_dataset(name, (1000,), "f8", chunks=(60,))[:100] = ROWS[:100, column]
        file.create_dataset("images", (1000, 100, 100), "u1", chunks=(1, 100, 100))
    found = read_table(tmp_path / "run.h5")
    assert np.isfinite(found.columns["depth"]).sum() == 120
    told = " ".join(found.notes)
    assert "depth (15 of 17 parts were never written)" in told and "images (100 x 100 values a row)" in told


def test_matlab_7_3_has_its_axes_in_reverse_order(tmp_path):
    with h5py.File(tmp_path / "run.mat", "w", userblock_size=512) as file:
        for name, values in (("t", ROWS[:, :1].T), ("caps", ROWS[:, 2:].T)):
            file[name] = values
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    head = bytearray((tmp_path / "run.mat").read_bytes())
    head[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    (tmp_path / "run.mat").write_bytes(bytes(head))
    found = read_table(tmp_path / "run.mat")
    assert found.columns["caps"].shape == (len(ROWS), 2) and found.columns["t"].tolist() == ROWS[:, 0].tolist()


def test_waveforms_of_labview_have_their_units_start_and_steps(tmp_path):
    step = {"wf_increment": 0.05, "wf_start_offset": 0.0, "wf_start_time": START}
    with TdmsWriter(tmp_path / "run.tdms") as file:
        channels = [ChannelObject("Board", f"c{k}", ROWS[:, 2 + k], {**step, "unit_string": "pF"}) for k in (0, 1)]
        file.write_segment([*channels, ChannelObject("Stage", "z", ROWS[::4, 1], {**step, "wf_increment": 0.2})])
    assert tables_in(tmp_path / "run.tdms") == ("Board/c0", "Stage/z")
    board, stage = (read_table(tmp_path / "run.tdms", ReadOptions(table=name)) for name in ("Board/c0", "Stage/z"))
    assert board.units == {"c0": "pF", "c1": "pF", "time": "ns"} and board.rows == len(ROWS)
    assert np.diff(stage.columns["time"]).tolist() == [200_000_000] * (len(ROWS) // 4 - 1)
    assert stage.columns["time"][0] == board.columns["time"][0] == START.astype("datetime64[ns]").astype(np.int64)


def test_a_file_of_labview_that_was_cut_lacks_values_and_says_so(tmp_path):
    with TdmsWriter(tmp_path / "run.tdms") as file:
        file.write_segment([ChannelObject("Run", name, ROWS[:, k]) for k, name in enumerate(("t", "depth", "c0"))])
    whole = (tmp_path / "run.tdms").read_bytes()
    (tmp_path / "run.tdms").write_bytes(whole[: -50 * 8])
    found = read_table(tmp_path / "run.tdms")
    assert found.columns["t"].tolist() == ROWS[:, 0].tolist()
    assert np.isnan(found.columns["c0"]).sum() == 50 and np.isnan(found.columns["c0"][-50:]).all()
    assert "run.tdms: it was cut while it was written; 50 values are missing" in found.notes
