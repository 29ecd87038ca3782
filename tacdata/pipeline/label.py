"""Labels of a session by the finite-element model of the skin."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.label_farm.environment import cores
from tacdata.label_farm.environment import devices as devices_named
from tacdata.label_farm.growing_session import GrowingSession
from tacdata.label_farm.labelling import Labelling, LabellingSummary
from tacdata.label_farm.labels.dataset_flow import DatasetFlow
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.presses.model import ALONE, FACTORY
from tacdata.label_farm.presses.tolerance import Tolerance
from tacdata.label_farm.settings import FarmSettings
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.dask_pool import dask_engine
from tacdata.label_farm.workers.pool import Pool
from tacdata.labels import file_names
from tacdata.paths import StrPath
from tacdata.recording.files.reader import read_episode
from tacdata.recording.session import linked_session, read_session
from tacdata.sensor import Sensor, read_sensor

POLL = 0.2
"""Time between two looks for the first recording of a session [s]."""


def label(
    session: StrPath,
    *,
    sensor: Sensor | StrPath | None = None,
    store: StrPath | None = None,
    out: StrPath | None = None,
    workers: int | None = None,
    devices: Sequence[str] = (),
    redo: bool = False,
    follow: bool = False,
    load_step: float = 0.25,
    unload_step: float = 0.75,
    tolerance: float = 0.005,
    uncertainty: bool = True,
    into: StrPath | None = None,
    dask: str = "",
    alone: bool = False,
    factory: str = "",
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> LabellingSummary:
    """Compute the depth maps of every frame of a session; stopped and called again, it continues.

    Args:
        session: The session folder; the labels lie in its folder ``labels``.
        sensor: The sensor whose skin is solved, or its file; None takes each recording's own.
        store: Folder of solved presses, which may serve many sessions; None takes ``labels/store``.
        out: Folder for the labels of a session that may not be written; it gets links to the recordings.
        workers: Worker processes; None takes one a core or GPU.
        devices: Devices of the workers: "cpu", "cuda" for all GPUs, "cuda:0", ...
        redo: Replace labels of another model version, and retry failed presses.
        follow: Begin while the session is recorded; end with its plan.
        load_step: Largest depth step while loading [mm].
        unload_step: Depth step while unloading [mm].
        tolerance: Add states where a map between them would be off by more than this [mm] or 1 %; 0 adds none.
        uncertainty: Propagate the spreads that the sensor file states; costs two thirds more.
        into: Dataset that each label is appended to as soon as it is finished.
        dask: Address of a Dask scheduler to solve on, or "here".
        alone: Solve each press by itself, on CPUs alone: labels are the same to the last bit whatever is labelled with
            them; costs twice as much.
        factory: Builder of the model, "module:name"; for tests.
        progress: Called with the stage ("read", "look", "compile", "solve"), the number done and the number of all.

    Raises:
        UsageError: If the folder holds no recording, or labels of another model version (without ``redo``), or presses
            are to be solved alone on a GPU.
        SolveError: If the model cannot be built or the workers keep dying.
    """
    folder = Path(session)
    if follow:
        _wait_for_recording(folder)
    recorded = read_session(folder)
    if not recorded.episodes and not follow:
        raise UsageError(f"{folder} holds no finished recording", "at least one", "record: `tacdata record`")
    if out is not None:
        recorded = linked_session(recorded, Path(out))
        folder = recorded.folder
    workplaces = devices_named(devices)
    # Refused before anything is solved, since hours later it would be too late.
    if alone and set(workplaces) != {"cpu"}:
        raise UsageError(
            f"labels that are the same to the last bit, on {', '.join(workplaces)}",
            "device cpu: sums on a GPU have no fixed order",
            "leave --device out, or --alone",
        )
    limit = Tolerance(least=tolerance) if tolerance else None
    settings = FarmSettings(
        factory=factory or (ALONE if alone else FACTORY),
        ladder=Ladder(load_step=load_step, unload_step=unload_step, tolerance=limit),
        uncertainty=uncertainty,
        workers=workers or (cores() if workplaces == ("cpu",) else len(workplaces)),
        devices=workplaces,
        redo=redo,
        engine=dask_engine(dask) if dask else Pool,
    )
    skin = sensor if sensor is None or isinstance(sensor, Sensor) else read_sensor(sensor)
    labels = file_names.folder(folder)
    paths = {int(path.stem[-6:]): path for path in recorded.episodes}
    recordings = {number: partial(read_episode, path) for number, path in paths.items()}
    flow = DatasetFlow(Path(into), folder, recorded.episodes, skin) if into else None
    # Without a dataset, finished labels need no further step.
    deliver = flow.deliver if flow else lambda *_: None
    place = Store(Path(store) if store else file_names.store(labels))
    try:
        later = GrowingSession(folder, paths) if follow else None
        return Labelling(labels, place, settings, progress, deliver).run(recordings, skin, paths, later)
    finally:
        if flow:
            flow.say()


def _wait_for_recording(session: Path) -> None:
    """Wait until a recorder has made a folder with its first recording, or ends without one."""
    growing = GrowingSession(session)
    while not growing.new() and not growing.ended:
        time.sleep(POLL)
