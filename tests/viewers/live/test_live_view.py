"""The live view: what is shown arrives in a Rerun file, and a viewer that hangs holds nothing up."""

import os
import signal
from multiprocessing import active_children

import numpy as np
import pytest
from rerun.chunk import RrdReader

from tacdata.errors import UsageError
from tacdata.viewers.live import window as room
from tacdata.viewers.live.window import live_view


def test_what_is_shown_is_in_the_file(tmp_path):
    path = tmp_path / "live.rrd"
    with live_view(str(path), 6, 4) as watch:
        watch("taxels", 1_760_000_000_000_000_000, np.arange(24.0))
        watch("cnc", 1_760_000_000_000_000_000, (1.0, 2.0, 3.0))
        watch("camera side", 1_760_000_000_000_000_000, np.zeros((48, 64), np.uint8))
    assert active_children() == []
    paths = {str(chunk.entity_path) for chunk in RrdReader(path).stream()}
    assert {"/taxels/change_counts", "/array", "/guide/z_mm", "/camera/side"} <= paths


def test_a_viewer_that_hangs_holds_nothing_up(tmp_path, monkeypatch):
    monkeypatch.setattr(room, "PATIENCE", 0.5)
    with live_view(str(tmp_path / "live.rrd"), 6, 4) as watch:
        (viewer,) = active_children()
        os.kill(viewer.pid, signal.SIGSTOP)
        for k in range(500):
            watch("camera side", k, np.zeros((480, 640), np.uint8))
    assert active_children() == []


@pytest.mark.parametrize(("where", "words"), [("somewhere", "ends in .rrd"), ("window", "display")])
def test_refusals_are_words(where, words, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(UsageError) as refused, live_view(where, 6, 4):
        pass
    assert words in str(refused.value)


def test_an_existing_file_is_left_alone(tmp_path):
    path = tmp_path / "live.rrd"
    path.write_bytes(b"precious")
    with pytest.raises(UsageError, match="exists"), live_view(str(path), 6, 4):
        pass
    assert path.read_bytes() == b"precious"
