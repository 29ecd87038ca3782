"""Throughput by the minute, and what workers take of their computers."""

import os
import socket

import numpy as np
import pytest
from farm_examples import press_episode

from tacdata.label_farm.service import failed_press
from tacdata.label_farm.service.gauges import Gauges
from tacdata.label_farm.workers.usage import Usage, local_process, usage_of

HERE = f"{socket.gethostname()}/{os.getpid()}"


class Now:
    def __init__(self):
        self.seconds = 600.0

    def __call__(self):
        return self.seconds


def test_presses_belong_to_the_minute_in_which_they_were_settled():
    now = Now()
    gauges = Gauges(now)
    gauges.count(100, 2)  # solved before this service began
    now.seconds += 30
    gauges.count(103, 2)
    now.seconds += 150
    gauges.count(104, 4)
    now.seconds += 1
    gauges.count(90, 4)  # a submission was cancelled
    gauges.count(92, 4)
    told = gauges.throughput()
    assert [(m["solved"], m["failed"]) for m in told] == [(3, 0), (0, 0), (0, 0), (3, 2)]
    assert told[0]["begin"] == "1970-01-01T00:10:00+00:00"
    assert gauges.throughput(2) == told[-2:]


def test_a_worker_s_share_of_a_processor_is_that_between_two_looks():
    now = Now()
    gauges = Gauges(now)
    gauges.tell("remote:far/7", Usage(100.0, 2_000_000))
    assert gauges.usage("remote:far/7") == {"processor": None, "processor_seconds": 100.0, "memory": 2_000_000}
    now.seconds += 4
    gauges.tell("remote:far/7", Usage(103.0, 3_000_000))
    assert gauges.usage("remote:far/7")["processor"] == pytest.approx(0.75)
    gauges.measure([HERE, "other-host/1"])
    assert gauges.usage("remote:far/7")["memory"] is None, "forgotten with its row"
    assert gauges.usage("other-host/1")["memory"] is None
    own = gauges.usage(HERE)
    assert own["memory"] > 10_000_000 and own["processor_seconds"] == pytest.approx(sum(os.times()[:2]), abs=1.0)


def test_names_of_workers_tell_their_process():
    assert local_process(HERE) == os.getpid() == local_process(HERE + "#3")
    assert local_process("remote:" + HERE) is None and local_process("elsewhere/12") is None
    assert usage_of(2**22 + 1) is None, "no such process"


def test_a_failed_press_is_drawn_with_its_reason(tmp_path, monkeypatch):
    import io

    from PIL import Image

    from tacdata.recording.files import reader

    episode = press_episode(tmp_path, 2, x=3.0, depth=1.0)
    monkeypatch.setattr(reader, "read_episode", lambda path: episode)
    drawn = Image.open(io.BytesIO(failed_press.failed_press(episode.path, "no equilibrium at state 3\n" + "x" * 2000)))
    pixels = np.asarray(drawn.convert("RGB")).astype(int)
    assert drawn.size == (990, 506)
    red = (abs(pixels - [0xC2, 0x41, 0x2D]).sum(axis=2) < 30).sum()
    assert red > 100, "the indenter's outline and the planned depth"
