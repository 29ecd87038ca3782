"""The data card: content, origin and gaps of a dataset, as Markdown."""

import itertools
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.dataset import label_states
from tacdata.dataset.format import features
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.dataset.reader import Dataset
from tacdata.plans import Press

COLUMNS, ROWS = 3, 3
"""Parts of the taxel array's box in which presses are counted, along x and y."""
DEPTH_BORDERS = (0.3, 0.6, 0.9, 1.2)
"""Borders of the depths by which presses are counted [mm]."""
PICTURE = "coverage.png"
HUB = "README.md"
"""Name of the card in a dataset's folder, where the hub looks for it."""
HUB_HEAD = """---
task_categories: [robotics]
tags: [LeRobot, tactile, tacdata]
configs: [{config_name: default, data_files: data/*/*.parquet}]
---
"""
"""Head of a card for the hub: its search, and its viewer of the data files."""


@dataclass(frozen=True)
class Coverage:
    """Presses by place and depth."""

    counts: np.ndarray
    """Presses [1], shape (COLUMNS, ROWS, len(DEPTH_BORDERS) + 1); places beyond the box count in its nearest part."""

    @property
    def empty(self) -> int:
        """Number of cells without a press."""
        return int((self.counts == 0).sum())


def coverage(presses: list[Press], dataset: Dataset) -> Coverage:
    """Count presses with contact by part of the taxel array and depth."""
    taxels = dataset.sensor.taxels
    half = np.array([taxels.pitch_x * taxels.columns, taxels.pitch_y * taxels.rows]) / 2
    counts = np.zeros((COLUMNS, ROWS, len(DEPTH_BORDERS) + 1), int)
    for press in presses:
        if press.depth > 0:
            place = (np.array([press.x, press.y]) / half + 1) / 2 * (COLUMNS, ROWS)
            i, j = np.clip(place.astype(int), 0, (COLUMNS - 1, ROWS - 1))
            counts[i, j, int(np.digitize(press.depth, DEPTH_BORDERS))] += 1
    return Coverage(counts)


def card(dataset: Dataset) -> str:
    """Return the data card of a dataset of one sensor.

    Raises:
        FormatError: If it is of several sensors.
    """
    records = [e.record for e in dataset.episodes if e.record]
    presses = [record.configuration for record in records]
    seconds = len(dataset) / dataset.sensor.taxels.rate
    lines = [
        f"# Data card: {dataset.root.name}",
        "",
        f"{len(dataset.episodes)} episodes, {len(dataset)} frames, {seconds / 60:.1f} min at "
        f"{dataset.sensor.taxels.rate:g} Hz; LeRobot v3.0; content `{dataset.content_hash[:12]}`.",
        "",
        *_simulated(dataset, records),
        *_sensor(dataset, records),
        *_presses(presses),
        *_coverage(presses, dataset),
        *_labels(records),
        *_gaps(dataset, records),
        *_columns(dataset),
    ]
    return "\n".join(lines) + "\n"


def document(dataset: Dataset) -> dict[str, Any]:
    """Return the content of the data card as data: lengths [mm], times [s], counts [1].

    Raises:
        FormatError: If the dataset is of several sensors.
    """
    records = [e.record for e in dataset.episodes if e.record]
    presses = [record.configuration for record in records]
    sensor = dataset.sensor
    losses, outside = _invalid(dataset)
    names = sorted({press.indenter_name for press in presses})
    return {
        "dataset": dataset.root.name,
        "content": dataset.content_hash,
        "episodes": len(dataset.episodes),
        "simulated_episodes": dataset.simulated,
        "frames": len(dataset),
        "seconds": len(dataset) / sensor.taxels.rate,
        "rate_hz": sensor.taxels.rate,
        "sensor": {"name": sensor.name, "hash": sensor.content_hash, "columns": sensor.taxels.columns}
        | {"rows": sensor.taxels.rows, "map": list(sensor.map.shape), "pixel_pitch_mm": sensor.map.pixel_pitch},
        "specimens": dict(Counter(record.specimen or "not named" for record in records)),
        "rigs": dict(Counter(record.rig for record in records)),
        "indenters": [
            {
                "name": name,
                "presses": len(group),
                "shape": group[0].indenter.document,
                "depths_mm": [min(p.depth for p in group), max(p.depth for p in group)],
                "speeds_mm_s": [min(p.speed for p in group), max(p.speed for p in group)],
            }
            for name, group in ((name, [p for p in presses if p.indenter_name == name]) for name in names)
        ],
        "coverage": {"depth_borders_mm": DEPTH_BORDERS, "counts": coverage(presses, dataset).counts},
        "labels": [record.label_provenance for record in records],
        "frames_after_a_loss": losses,
        "frames_outside_the_path": outside,
        "incomplete_recordings": [record.recording_file for record in records if not record.complete],
        "notes": dict(Counter(note for record in records for note in record.notes)),
        "columns": {
            key: {"shape": values.shape[1:], "unit": dataset.units[key]} for key, values in dataset.columns.items()
        },
    }


def _simulated(dataset: Dataset, records: list[EpisodeRecord]) -> list[str]:
    """Begin with the note that it is simulated, and from which ranges."""
    drawn = Counter(f"plan {r.simulated['plan']}, seed {r.simulated['seed']}" for r in records if r.simulated)
    if not drawn:
        return []
    all_simulated = dataset.simulated == len(dataset.episodes)
    share = (
        "Nobody recorded"
        if all_simulated
        else f"{dataset.simulated} of {len(dataset.episodes)} episodes, not recorded, of"
    )
    return [
        f"**Simulated.** {share} this dataset: the skin model solved drawn presses, the sensor file's transduction "
        "read them.",
        "",
        f"- drawn from {_counted(drawn)}",
        *_laid_over(records),
        "",
    ]


def _laid_over(records: list[EpisodeRecord]) -> list[str]:
    """Name the effects that are laid over simulated readings."""
    counts = Counter(effect["effect"] for r in records if r.simulated for effect in r.simulated.get("effects", []))
    return [f"- laid over their readings: {_counted(counts)}"] if counts else []


def _sensor(dataset: Dataset, records: list[EpisodeRecord]) -> list[str]:
    sensor = dataset.sensor
    kinds = {r.virtual for r in records if r.simulated is None}
    rig = "virtual rigs" if kinds == {True} else "real rigs" if kinds == {False} else "real and virtual rigs"
    specimens = Counter(r.specimen or "not named" for r in records)
    origin = f"recorded on {rig if kinds else 'rigs that nobody named'}" if dataset.simulated < len(records) else "rig"
    return [
        "## Sensor and rig",
        "",
        f"- {sensor.name} `{sensor.content_hash[:12]}`: {sensor.taxels.columns} x {sensor.taxels.rows} taxels, skin "
        f"{sensor.skin.size_x:g} x {sensor.skin.size_y:g} x {sensor.skin.thickness:g} mm, map "
        f"{sensor.map.pixels_x} x {sensor.map.pixels_y} pixels of {sensor.map.pixel_pitch:g} mm",
        f"- specimens: {_counted(specimens)}",
        f"- {origin}: {_counted(Counter(r.rig for r in records))}",
        "",
    ]


def _presses(presses: list[Press]) -> list[str]:
    heads = "| Indenter | Shape and sizes (mm, deg) | Presses | Depths (mm) | Speeds (mm/s) |"
    lines = ["## Indenters", "", heads, "| --- | --- | ---: | ---: | ---: |"]
    for name in sorted({p.indenter_name for p in presses}):
        group = [p for p in presses if p.indenter_name == name]
        words = ", ".join([group[0].indenter.shape, *_sizes([p.indenter.document for p in group])])
        depths, speeds = _range([p.depth for p in group]), _range([p.speed for p in group])
        lines.append(f"| {name} | {words} | {len(group)} | {depths} | {speeds} |")
    purposes = Counter(p.purpose for p in presses if p.purpose)
    return [*lines, "", *([f"Purposes: {_counted(purposes)}.", ""] if purposes else [])]


def _sizes(shapes: list[dict[str, Any]]) -> list[str]:
    """Return name and range of every size of some solids of one shape; those of a pair's solids behind theirs."""
    words = []
    for name, value in shapes[0].items():
        if isinstance(value, dict):
            inner = ", ".join(_sizes([shape[name] for shape in shapes]))
            words.append(f"{name}: {value['shape']} ({inner})")
        elif name != "shape" and isinstance(value, int | float):
            words.append(f"{name} {_range([shape[name] for shape in shapes])}")
    return words


def _coverage(presses: list[Press], dataset: Dataset) -> list[str]:
    if not presses:
        return []
    table = coverage(presses, dataset)
    borders = ["0", *(f"{b:g}" for b in DEPTH_BORDERS)]
    bands = [f"{a} to {b} mm" for a, b in itertools.pairwise(borders)] + [f"deeper than {borders[-1]} mm"]
    lines = ["## Coverage of positions x depths", "", "| Part of the array | " + " | ".join(bands) + " |"]
    lines.append("| --- |" + " ---: |" * len(bands))
    names_x, names_y = ("-x", "middle", "+x"), ("-y", "middle", "+y")
    for i in range(COLUMNS):
        for j in range(ROWS):
            cells = " | ".join(map(str, table.counts[i, j].tolist()))
            lines.append(f"| {names_x[i]}, {names_y[j]} | {cells} |")
    return [*lines, "", f"{table.empty} of {table.counts.size} cells have no press. Picture: {PICTURE}.", ""]


def _labels(records: list[EpisodeRecord]) -> list[str]:
    if not records:
        return []
    stamps = [r.label_provenance for r in records]
    models = Counter(str(m.get("parents", {}).get("model", ""))[:12] or "not named" for m in stamps)
    codes = Counter(str(m.get("code_version", "")) or "not named" for m in stamps)
    makers = Counter(str(m.get("made_by", "")) or "not named" for m in stamps)
    return [
        "## Labels",
        "",
        f"- made by {_counted(makers)}, code {_counted(codes)}",
        f"- skin model (content hash): {_counted(models)}",
        "- simulated by finite elements from the prescribed contact; nobody measured the skin's shape",
        "",
    ]


def _gaps(dataset: Dataset, records: list[EpisodeRecord]) -> list[str]:
    losses, outside = _invalid(dataset)
    lines = [
        f"- {losses} of {len(dataset)} frames follow a lost frame",
        f"- {outside} of {len(dataset)} frames are outside the commanded path (before its start or after its end)",
    ]
    broken = [r.recording_file for r in records if not r.complete]
    if broken:
        lines.append(f"- {len(broken)} recordings were broken off, the first is {broken[0]}")
    lost = len(dataset.episodes) - len(records)
    if lost:
        lines.append(f"- {lost} episodes lost their record in an edit: indenter, press and label's origin are unknown")
    states = Counter(s.state for s in label_states.states(dataset.root) if s.state != "complete")
    if states:
        lines.append(f"- labels of sessions that flow in here: {_counted(states)}")
    notes = Counter(note for r in records for note in r.notes)
    lines += [f"- {count} episodes: {note}" for note, count in notes.most_common(10)]
    return ["## Known gaps", "", *lines, ""]


def _invalid(dataset: Dataset) -> tuple[int, int]:
    """Return the number of frames after a loss and of frames outside the commanded path.

    The path of a press is one interval of time, so invalid frames outside of it are the first or last of their episode.
    """
    valid, losses, outside = np.asarray(dataset[features.VALID]), 0, 0
    for episode in dataset.episodes:
        rows = np.flatnonzero(valid[episode.start : episode.stop])
        length = episode.stop - episode.start
        inside = int(rows[-1] - rows[0] + 1) if len(rows) else 0
        losses, outside = losses + inside - len(rows), outside + length - inside
    return losses, outside


def _columns(dataset: Dataset) -> list[str]:
    heads = "| Column | Shape | Unit in the files | Unit by read_dataset |"
    lines = ["## Columns", "", heads, "| --- | --- | --- | --- |"]
    described = features.lerobot_features(dataset.sensor)
    stored = {key: entry.get("info", {}).get("unit") for key, entry in described.items()}
    for key, values in dataset.columns.items():
        shape = " x ".join(map(str, values.shape[1:])) or "1"
        ours = dataset.units[key]
        lines.append(f"| {key} | {shape} | {stored.get(key) or ours} | {ours} |")
    return lines


def _range(values: list[float]) -> str:
    return f"{min(values):g}" if min(values) == max(values) else f"{min(values):g} to {max(values):g}"


def _counted(counts: Counter[str]) -> str:
    return ", ".join(f"{name} ({count})" for name, count in sorted(counts.items())) or "none"
