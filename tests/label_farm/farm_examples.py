"""Recorded presses, and a run with the fast model, for the farm's tests and benchmark."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tacdata.indenters.sphere import Sphere
from tacdata.label_farm.labelling import FarmSettings, Labelling
from tacdata.label_farm.store.store import Store
from tacdata.plans import Press
from tacdata.recording.episode import CncStream, Episode, TaxelStream
from tacdata.sensor import default_sensor

HERE = Path(__file__).parent
MILLISECOND = 1_000_000
SENSOR = default_sensor()


def press_episode(folder, number=0, x=0.0, depth=1.0, reached=None, frames=40, **changes):
    """A recording of one press: 1 s down from 0.5 mm above, 1 s hold, 1 s up; 40 frames by default."""
    path = folder / f"episode-{number:06d}.mcap"
    if not path.exists():
        path.write_bytes(f"recording {number} {x} {depth}".encode())
    start = 1_000_000_000_000
    tip_ns = start + np.array([0, 1000, 2000, 3000]) * MILLISECOND
    reached = depth if reached is None else reached
    tip = np.array([[x, 0.0, -0.5], [x, 0.0, reached], [x, 0.0, reached], [x, 0.0, -0.5]])
    times = start + np.linspace(0, 3000, frames).astype(np.int64) * MILLISECOND
    press = Press(Sphere(2.0), depth, x, speed=1.5, hold=1.0, index=number, indenter_name="ball")
    stream = TaxelStream(times, times, np.arange(frames), np.zeros((frames, SENSOR.taxels.count)))
    episode = Episode(
        path=path,
        press=press,
        sensor=SENSOR,
        rig={},
        taxels=stream,
        cnc=CncStream(tip_ns, tip_ns, tip, ("Run",) * 4),
        tags=(),
        phases=(),
        tip_ns=tip_ns,
        tip=tip,
        complete=True,
        notes=(),
    )
    return replace(episode, **changes)


def label_episodes(folder, episodes, progress=lambda *_: None, sensor=None, **settings):
    """Label episodes into a folder with the fast model; return the summary."""
    chosen = FarmSettings(**{"factory": "fast_model:FastModel", "workers": 2, "lease_seconds": 4.0, **settings})
    recordings = {episode.number: lambda episode=episode: episode for episode in episodes}
    return Labelling(folder, Store(folder / "store"), chosen, progress).run(recordings, sensor)
