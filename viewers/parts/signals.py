"""Curves of an episode: taxels, tip, cube, clock, force."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tacdata.labels import Label
from tacdata.recording.episode import PHASES, Episode, Phase, TagStream
from tacdata.rig import registration_for
from tacdata.sensor import Sensor
from tacdata.viewers.parts.label import ShownLabel
from tacdata.viewers.scene import thinning
from tacdata.viewers.scene.color_scale import ColorScale, scale_of
from tacdata.viewers.scene.scene import Curves, Span, TaxelArray

FRAMES_WITHOUT_REST = 10
"""Frames that stand in for the rest phase where none is marked."""


def signal_change(counts: np.ndarray, resting: np.ndarray) -> np.ndarray:
    """Return readings minus each taxel's median at rest [counts], shape (n, taxels).

    Args:
        counts: Raw readings [counts], shape (n, taxels).
        resting: Which frames lie in the rest phase, shape (n,), bool; if none does, the first few are taken.
    """
    # The median: a touch during the rest would shift a mean.
    reference = counts[resting] if resting.any() else counts[:FRAMES_WITHOUT_REST]
    if not np.isnan(reference).any():
        return counts - np.median(reference, axis=0)
    # Imported readings may be missing; a channel without any has no rest.
    read = np.isfinite(reference)
    middle = [
        np.median(column[mask]) if mask.any() else np.nan for column, mask in zip(reference.T, read.T, strict=True)
    ]
    return counts - np.array(middle)


def taxel_labels(sensor: Sensor) -> tuple[str, ...]:
    """Return each taxel's name with its place, for example "7 (1, 1)" for column 1, row 1."""
    columns = sensor.taxels.columns
    return tuple(f"{k} ({k % columns}, {k // columns})" for k in range(sensor.taxels.count))


def taxel_array(
    sensor: Sensor, time_ns: np.ndarray, change: np.ndarray, name: str = "", unit: str = "counts"
) -> TaxelArray:
    """Return the array coloured by the signal change, at most `thinning.ARRAYS` times.

    Args:
        sensor: Gives the taxels' places.
        time_ns: Times [ns], shape (n,).
        change: Signal change [unit], shape (n, taxels).
        name: Finger that wears it, if there are several.
        unit: Of the readings.
    """
    rows = thinning.strongest(np.nan_to_num(np.abs(change)).max(axis=1, initial=0.0), thinning.ARRAYS)
    plane = sensor.taxels.centers
    return TaxelArray(
        centers=np.column_stack([plane, np.zeros(len(plane))]),
        radius=sensor.skin.protrusion_radius or 0.25 * min(sensor.taxels.pitch_x, sensor.taxels.pitch_y),
        columns=sensor.taxels.columns,
        rows=sensor.taxels.rows,
        time_ns=time_ns[rows],
        values=change[rows],
        scale=_signal_scale(change, unit),
        name=name,
    )


def _signal_scale(change: np.ndarray, unit: str) -> ColorScale:
    # A board whose readings fall under pressure, or fall as much as they rise, needs the scale with a middle.
    finite = change[np.isfinite(change)]
    falls = -finite.min(initial=0.0) > 0.2 * finite.max(initial=0.0)
    return scale_of(change, unit, signed=bool(falls))


def tip_curves(source: str, time_ns: np.ndarray, tip: np.ndarray) -> Curves:
    """Return x, y, depth [mm], shape (n, 3), as curves; ``source`` is "nominal" or "reported"."""
    return Curves(f"tip/{source}", "mm", tuple(f"{q}, {source}" for q in ("x", "y", "depth")), time_ns, tip)


def episode_curves(episode: Episode, unit: str = "counts") -> tuple[Curves, ...]:
    """Return every curve that the recording alone gives; ``unit`` is that of its readings."""
    taxels = episode.taxels
    resting = episode.phase_at(taxels.sample_ns) == PHASES.index("rest")
    labels = taxel_labels(episode.sensor)
    curves = [
        Curves("taxels/change", unit, labels, taxels.sample_ns, signal_change(taxels.counts, resting)),
        Curves("taxels/raw", unit, labels, taxels.sample_ns, taxels.counts),
        delays("taxels", taxels.sample_ns, taxels.arrival_ns),
    ]
    if len(episode.cnc.sample_ns):
        curves.append(delays("guide", episode.cnc.sample_ns, episode.cnc.arrival_ns))
    if len(episode.cnc.sample_ns) and "registration" in episode.rig:
        reported = registration_for(episode.rig, episode.press.indenter_name).to_sensor(episode.cnc.position)
        curves.append(tip_curves("reported", episode.cnc.sample_ns, reported))
    for tags in episode.tags:
        curves += tag_curves(tags)
    curves += [Curves(f"measured/{m.name}", m.unit, m.names, m.sample_ns, m.values) for m in episode.measured]
    return tuple(curves)


def delays(stream: str, sample_ns: np.ndarray, arrival_ns: np.ndarray) -> Curves:
    """Return by how much later than it was sampled each value came [ms]: the residual of a stream's clock model."""
    return Curves(f"clock/{stream}", "ms", (stream,), sample_ns, (arrival_ns - sample_ns)[:, None] / 1e6)


def tag_curves(tags: TagStream) -> list[Curves]:
    """Return the cube's position and the quality of its detection; nothing if there was no image."""
    if not len(tags.sample_ns):
        return []
    visible = np.isfinite(tags.position).all(axis=1)
    # Where no face was seen the error is that of nothing.
    quality = np.where(visible, tags.reprojection, np.nan)
    name = f"tags/{tags.camera}"
    return [
        Curves(f"{name}/position", "mm", ("x", "y", "z"), tags.sample_ns, 1000 * tags.position),
        Curves(f"{name}/reprojection", "px", ("root mean square",), tags.sample_ns, quality[:, None]),
        Curves(f"{name}/faces", "faces", ("seen",), tags.sample_ns, tags.faces[:, None].astype(float)),
    ]


def label_curves(label: Label | ShownLabel) -> tuple[Curves, ...]:
    """Return the simulated force on the indenter."""
    return (Curves("force", "N", ("x", "y", "z"), label.time_ns, label.force),)


def spans(phases: Sequence[Phase]) -> tuple[Span, ...]:
    """Return the marked phases in the order of time."""
    return tuple(Span(p.name, p.start_ns, p.end_ns) for p in sorted(phases, key=lambda p: p.start_ns))


def thinned(curves: Curves) -> Curves:
    """Return curves of about `thinning.CURVES` rows that keep every peak of the widest curve of each stretch."""
    if len(curves.time_ns) <= thinning.CURVES:
        return curves
    rows = thinning.extremes(np.asarray(curves.values, dtype=float), thinning.CURVES)
    doubtful = curves.doubtful[rows] if len(curves.doubtful) else curves.doubtful
    return replace(curves, time_ns=curves.time_ns[rows], values=curves.values[rows], doubtful=doubtful)
