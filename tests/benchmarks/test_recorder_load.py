"""Tests of the recorder's load benchmark: its devices in memory still have what the recorder reads."""

from benchmarks.recorder_load import run


def test_a_second_under_load_is_recorded_whole(tmp_path):
    figures = run(1.0, tmp_path)
    assert figures["frames_in_file"] > 500
    assert figures["frames_missing_in_file"] == 0
    assert figures["images_missing_in_file"] == 0
    assert figures["damage"] == []
