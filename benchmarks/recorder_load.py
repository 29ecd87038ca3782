"""The recorder's load: 24 channels at 1 kHz, 10 Hz status and two cameras of 640 x 480 at 30 Hz, nothing lost.

    python benchmarks/recorder_load.py --seconds 600

One process emulates the board (a pseudo-terminal at 1 kHz, from ready-made frames, so that the emulation costs
little) and the guide; the other runs the drivers, `RigStreams` and `EpisodeWriter` as `tacdata record` does. Images
come from a camera in memory: noise that does not compress well. Printed: lost samples, CPU, memory and its slope,
bytes on disk, and how far the writer lagged.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.capacitive_board import CapacitiveBoard
from tacdata.devices.device import Camera, CncStatus, ImageFrame
from tacdata.plans import Plan
from tacdata.recording.files.mcap_records import walk
from tacdata.recording.files.writer import EpisodeWriter, Header
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.live.rig_streams import RigStreams
from tacdata.sensor import default_sensor
from tacdata.wire import Encoder, default_format
from tacdata.wire.frames.frame_format import from_document

RATE, STATUS_RATE, IMAGE_RATE = 1000, 10.0, 30.0
SIZE = (480, 640)
CAMERAS = ("left", "right")
BAUD = 921600


def emulate_board(path_pipe, seconds: float) -> None:
    """Stream frames at 1 kHz by absolute time, in millisecond packets; runs in a process of its own."""
    from tacdata.virtual_rig.port import VirtualPort

    port = VirtualPort(BAUD)
    encoder = Encoder(from_document({**default_format().document, "rate": RATE}, "board"))
    rng = np.random.default_rng(0)
    frames = [encoder.encode(9000 + rng.integers(-15, 16, 24), counter) for counter in range(65536)]
    path_pipe.send(port.path)
    while not port.connected:
        time.sleep(0.001)
    begun, sent = time.monotonic(), 0
    while time.monotonic() - begun < seconds + 5.0:
        due = int((time.monotonic() - begun) * RATE)
        if due > sent:
            port.write(b"".join(frames[k % 65536] for k in range(sent, due)))
            sent = due
        time.sleep(0.0008)
    path_pipe.send(sent)
    port.close()


class Guide:
    """Motion controller in memory: status reports at 10 Hz, none of them damaged."""

    damaged_reports = 0

    damaged_reports = 0

    def __init__(self, clock: Clock) -> None:
        self.clock, self._next = clock, clock.now_ns()

    def statuses(self) -> list[CncStatus]:
        """Return the reports that are due."""
        found, now = [], self.clock.now_ns()
        while self._next <= now:
            found.append(CncStatus(self._next, self._next + 8_000_000, "Run", np.zeros(3), 0.0))
            self._next += round(1e9 / STATUS_RATE)
        return found


class Eye(Camera):
    """A camera in memory with a queue of its own, as a driver's thread would fill it."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        rng = np.random.default_rng(1)
        scene = np.kron(rng.integers(0, 255, (SIZE[0] // 16, SIZE[1] // 16, 3)), np.ones((16, 16, 1)))
        self._images = [np.clip(scene + rng.normal(0, 8, (*SIZE, 3)), 0, 255).astype(np.uint8) for _ in range(6)]
        self.given, self._begun = 0, clock.now_ns()

    def describe(self) -> dict:
        """Nothing to say."""
        return {}

    def open(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def read(self, timeout: float) -> list[ImageFrame]:
        """Return the images that are due, waiting for the next one."""
        due = self._begun + round(self.given / IMAGE_RATE * 1e9)
        time.sleep(min(max((due - self.clock.now_ns()) / 1e9, 0.0), timeout))
        found, now = [], self.clock.now_ns()
        while self._begun + round(self.given / IMAGE_RATE * 1e9) <= now:
            found.append(ImageFrame(now, self.given, self._images[self.given % 6]))
            self.given += 1
        return found


def header() -> Header:
    """Return the header of a recording."""
    plan = Plan.from_document(
        {
            "version": "1.0",
            "name": "load",
            "indenters": {"ball": {"shape": "sphere", "radius": 3.0}},
            "motion": {"clearance": 3, "travel_speed": 20, "approach_speed": 5, "press_speed": 1, "hold": 1, "rest": 1},
            "presses": [{"indenter": "ball", "x": 0, "y": 0, "depth": 0.5}],
        },
        "load",
    )
    rig = {"registration": {"origin": [0, 0, 0], "yaw": 0}, "cameras": {name: {} for name in CAMERAS}}
    return Header(plan.presses[0], default_sensor(), rig, plan.document or {}, {}, {})


def resident_mb() -> float:
    """Return this process's memory [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def run(seconds: float, folder: Path) -> dict:
    """Record for ``seconds`` and return the figures."""
    mine, theirs = multiprocessing.Pipe()
    emulator = multiprocessing.get_context("spawn").Process(target=emulate_board, args=(theirs, seconds))
    emulator.start()
    clock = Clock.start()
    layout = {**default_format().document, "rate": RATE}
    board = CapacitiveBoard(clock, mine.recv(), BAUD, layout)
    eyes = {name: Eye(clock) for name in CAMERAS}
    memory, waiting, stopped = [], [], threading.Event()
    devices = RigDevices(Guide(clock), board, eyes)

    def watch() -> None:
        while not stopped.wait(1.0):
            memory.append(resident_mb())
            waiting.append(writer.waiting / 1e6)

    with board, RigStreams(devices, {}, lambda: None) as streams:
        time.sleep(1.0)
        writer = EpisodeWriter(folder / "load.mcap", header(), clock, CAMERAS)
        watcher = threading.Thread(target=watch)
        streams.record_into(writer)
        begun, cpu = time.monotonic(), time.process_time()
        watcher.start()
        while time.monotonic() - begun < seconds:
            time.sleep(0.5)
            if streams.fault:
                raise SystemExit(f"fault: {streams.fault}")
        took, spent = time.monotonic() - begun, time.process_time() - cpu
        given = sum(eye.given for eye in eyes.values())
        streams.catch_up()
        stopped.set()
        watcher.join()
        counts, models = streams.counts["taxels"], streams.clock_models
        streams.record_into(None)
        path = writer.close(True, "", models, {"taxels": counts})
    emulator.terminate()
    return {
        "seconds": round(took, 1),
        "cpu_percent_of_one_core": round(100 * spent / took, 1),
        **_file(path),
        "frames_lost_by_counter": counts.lost,
        "frames_corrupt": counts.corrupt,
        "images_given": given,
        "memory_mb": {"first": round(memory[0]), "last": round(memory[-1]), "slope_mb_per_min": _slope(memory)},
        "most_waiting_for_disk_mb": round(max(waiting), 2),
        "jitter_ms": round(models["taxels"].jitter_ns / 1e6, 2),
        "peak_memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3),
        "load_average": round(os.getloadavg()[0], 2),
    }


def _slope(memory: list[float]) -> float | None:
    """Return by how much memory grows in the second half [MB/min]: buffers fill at first."""
    half = np.array(memory[len(memory) // 2 :])
    return None if len(half) < 5 else round(float(np.polyfit(np.arange(len(half)), half, 1)[0]) * 60, 3)


def _file(path: Path) -> dict:
    damage: list[str] = []
    topics: dict[int, str] = {}
    found: dict[str, list[int]] = {}
    for record in walk(path, damage):
        kind = type(record).__name__
        if kind == "Channel":
            topics[record.id] = record.topic
        elif kind == "Message":
            found.setdefault(topics[record.channel_id], []).append(record.sequence)
    taxels = np.array(found["/taxels"])
    images = {name: np.array(found[f"/camera/{name}/image"]) for name in CAMERAS}
    return {
        "file_mb": round(path.stat().st_size / 1e6, 1),
        "frames_in_file": len(taxels),
        "frames_missing_in_file": int((np.diff(taxels) - 1).sum()),
        "statuses_in_file": len(found["/cnc/status"]),
        "images_in_file": sum(map(len, images.values())),
        "images_missing_in_file": int(sum((np.diff(i) - 1).sum() for i in images.values())),
        "damage": damage,
    }


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0, help="length of the recording [s]")
    parser.add_argument("--folder", type=Path, help="where to write (kept); default: a temporary folder")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        result = run(options.seconds, folder)
    print(json.dumps(result, indent=1))
    lost = result["frames_lost_by_counter"] + result["frames_missing_in_file"] + result["images_missing_in_file"]
    sys.exit(1 if lost or result["damage"] else 0)


if __name__ == "__main__":
    main()
