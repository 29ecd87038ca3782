"""Writes the solved presses of a simulation as a dataset, an episode a press, in the order of their numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.dataset import DatasetWriter, frames
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.errors import UsageError
from tacdata.label_farm.labels.make_label import make_label
from tacdata.label_farm.labels.request import LabelRequest
from tacdata.label_farm.simulated.press_effects import readings_with
from tacdata.label_farm.simulated.readings import board_counts
from tacdata.label_farm.simulated.shard import read_about, read_shard, shard_files
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.specimen import differences
from tacdata.label_farm.simulated.swallowed_shape import swallowed_at
from tacdata.label_farm.simulated.timeline import timeline
from tacdata.labels import Label, PathSolution
from tacdata.recording.episode import Episode

_STREAM = 43
"""Separates the random numbers of readings from those of presses and specimens."""


def simulated_episode(simulation: Simulation, number: int, solution: PathSolution) -> tuple[Episode, Label]:
    """Return a solved press as a recording and its label.

    The recording's sensor is the design, the label is the specimen's: its skin's map, its board's readings.
    """
    press, specimen = simulation.press(number), simulation.specimen(number)
    rng = np.random.default_rng([simulation.seed, _STREAM, number])
    episode = timeline(press, simulation.sensor, rng)
    model = solution.provenance["parents"]["model"]
    times = episode.taxels.sample_ns
    request = LabelRequest(
        number,
        recording_key(simulation, number),
        specimen,
        model,
        times,
        episode.tip_at(times),
        int(episode.tip_ns[int(np.argmax(episode.tip[:, 2]))]),
        simulation.job(press, model),
    )
    label = make_label(request, solution)
    ideal = np.asarray(label.taxel_counts, dtype=float)
    effects = simulation.effects[number % len(simulation.specimens)]
    ideal = readings_with(effects, episode, label, specimen, ideal)
    limit = specimen.transduction.full_scale if specimen.transduction else None
    counts = board_counts(ideal, times, simulation.plan.noise, limit, rng)
    return replace(episode, taxels=replace(episode.taxels, counts=counts)), label


def recording_key(simulation: Simulation, number: int) -> str:
    """Return the substitute of a recording's hash (hex, 64 characters): it depends on the draw, not on its time."""
    return provenance.content_hash({"simulation": simulation.content_hash, "press": number})


def write_dataset(
    simulation: Simulation,
    presses: int,
    out: Path,
    extra: Sequence[str] = (),
    done: Callable[[int, str], None] = lambda number, left_out: None,
) -> tuple[int, int]:
    """Append solved presses that a dataset lacks; an interruption keeps finished ones.

    Args:
        simulation: The simulation.
        presses: How many presses are wanted in all. Those given up are left out, and those with skin above the
            shape (`swallowed_shape`).
        out: Folder of the dataset, made if missing.
        extra: Optional columns of the labels (`features.EXTRA`).
        done: Called with each press's number, and why a solved one is left out or "".

    Returns:
        Episodes and frames that the dataset has now.

    Raises:
        UsageError: If it holds other recordings.
    """
    begun = DatasetWriter.open if out.exists() else DatasetWriter.create
    writer = begun(out, simulation.sensor, extra, simulated=True)
    where = {n: path for path in shard_files(simulation.folder) for n in read_about(path).numbers if n < presses}
    _refuse_others(simulation, writer, where, out)
    # Successive presses are of different specimens, each in a file of its own.
    read = lru_cache(maxsize=len(simulation.specimens) + 1)(read_shard)
    for number in sorted(where):
        reason = ""
        if recording_key(simulation, number) not in writer.recordings:
            solution = read(where[number]).solutions.get(number)
            if solution is not None:
                reason = _append(writer, simulation, number, solution, extra)
        done(number, reason)
    return writer.info["total_episodes"], writer.info["total_frames"]


def _append(
    writer: DatasetWriter, simulation: Simulation, number: int, solution: PathSolution, extra: Sequence[str]
) -> str:
    """Append a press; return why it is left out, or ""."""
    job = simulation.job(simulation.press(number), solution.provenance["parents"]["model"])
    depth = swallowed_at(job, simulation.specimen(number), solution)
    if depth is not None:
        return f"the skin lies above the {job.indenter['shape']} from {depth:.2f} mm on"
    episode, label = simulated_episode(simulation, number, solution)
    record = _record(simulation, episode, label)
    task = f"press the simulated skin with {episode.press.indenter_name}"
    writer.append(frames.episode_columns(episode, label, extra), record, task)
    return ""


def _record(simulation: Simulation, episode: Episode, label: Label) -> EpisodeRecord:
    number, specimen = episode.number, simulation.specimen(episode.number)
    record = frames.episode_record(episode, label, recording_key(simulation, number), simulation.sensor)
    # The specimen's transduction is in `simulated`, once.
    parameters = record.label_provenance["parameters"]
    parameters = {**record.label_provenance, "parameters": {k: v for k, v in parameters.items() if k != "transduction"}}
    drawn = {
        "plan": simulation.plan.name,
        "seed": simulation.seed,
        "press": number,
        "simulation": simulation.content_hash,
        "specimen": differences(specimen, simulation.sensor),
        "effects": [
            {"effect": placed.effect.name, "values": {name: value.tolist() for name, value in placed.values.items()}}
            for placed in simulation.effects[number % len(simulation.specimens)]
        ],
    }
    return replace(record, specimen=specimen.name, label_provenance=parameters, simulated=drawn)


def _refuse_others(simulation: Simulation, writer: DatasetWriter, where: dict[int, Path], out: Path) -> None:
    keys = {recording_key(simulation, number) for number in where}
    if foreign := writer.recordings - keys:
        raise UsageError(
            f"{out} holds {len(foreign)} episodes that are not among these presses",
            "a new folder, or a dataset of the same plan, sensor and seed with fewer presses",
            "choose another --out",
        )
