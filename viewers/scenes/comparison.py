"""The scene of a comparison: two sides of the same frames and their difference."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.sensor import Sensor
from tacdata.viewers.parts import maps as depth_maps
from tacdata.viewers.parts import signals, skin_surface
from tacdata.viewers.parts.maps import DEPTH_FLOOR, ERROR_FLOOR
from tacdata.viewers.scene import thinning
from tacdata.viewers.scene.color_scale import ColorScale, scale_of
from tacdata.viewers.scene.scene import Curves, DepthMaps, Scene, Span, TaxelArray


@dataclass(frozen=True)
class Side:
    """Maps of one label version or network."""

    name: str
    """Its name, in a word or two."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64, ascending."""
    depth: np.ndarray
    """Depth [mm], shape (n, pixels_x, pixels_y), float32."""


def maps_comparison(
    title: str, sensor: Sensor, sides: Sequence[Side], truth: Side | None = None, phases: tuple[Span, ...] = ()
) -> Scene:
    """Return two sides and their difference, second minus first, at the frames that both hold.

    Args:
        title: Heading.
        sensor: Gives the pixel grid.
        sides: The first and the second.
        truth: Reference of both, if there is one: then each side's error is shown too.
        phases: Marked phases.
    """
    first, second = sides
    # Label versions may have different frames; only common ones can be subtracted.
    time, ours, theirs = np.intersect1d(first.time_ns, second.time_ns, return_indices=True)
    all_sides = (*((truth,) if truth else ()), first, second)
    high = np.array([float(side.depth.max(initial=0.0)) for side in all_sides])
    scale = scale_of(high, "mm", floor=DEPTH_FLOOR)
    x, y = sensor.map.x, sensor.map.y
    range_words = f"0 to {scale.high:g} mm"
    layers = [DepthMaps(s.name, x, y, s.time_ns, s.depth, scale, f"{s.name}: depth, {range_words}") for s in all_sides]
    pairs = [(f"{second.name} − {first.name}", second.depth[theirs], first.depth[ours], time)]
    if truth is not None:
        for side in sides:
            common, at, truth_rows = np.intersect1d(side.time_ns, truth.time_ns, return_indices=True)
            pairs.append((f"{side.name} − {truth.name}", side.depth[at], truth.depth[truth_rows], common))
    differences = [(name, (a - b).astype(np.float32), t) for name, a, b, t in pairs if len(t)]
    # All differences on one scale, so that a small one looks small.
    largest = np.array([float(np.abs(d).max(initial=0.0)) for _, d, _ in differences])
    signed = scale_of(largest, "mm", signed=True, floor=ERROR_FLOOR)
    layers += [DepthMaps(n, x, y, t, d, signed, f"{n}, ±{signed.high:g} mm") for n, d, t in differences]
    curves = [_course(all_sides), *(_of_difference(name, d, t) for name, d, t in differences)]
    drawn = depth_maps.thinned(tuple(layers))
    return Scene(
        title,
        _words(title, all_sides, differences),
        first.time_ns,
        np.arange(len(first.time_ns)),
        footprint=skin_surface.footprint(sensor),
        curves=tuple(map(signals.thinned, curves)),
        maps=drawn,
        arrays=(_taxels(sensor),),
        surfaces=skin_surface.faces(sensor, drawn[: len(all_sides)]),
        phases=phases,
        kind="comparison",
    )


def readings_comparison(
    title: str,
    shape: tuple[int, int],
    time_ns: np.ndarray,
    measured: np.ndarray,
    predictions: Mapping[str, np.ndarray],
    unit: str,
) -> Scene:
    """Return measurements, predictions of models, and residuals.

    Args:
        title: Heading.
        shape: Columns and rows of the array; (channels, 1) where they are not on a grid.
        time_ns: Times [ns], shape (n,).
        measured: Readings [unit], shape (n, channels).
        predictions: Model -> its prediction [unit], shape (n, channels).
        unit: Of the readings.
    """
    columns, rows = shape
    labels = tuple(f"{k} ({k % columns}, {k // columns})" for k in range(columns * rows))
    # Since the first frame: idle readings of channels differ by more than presses change them.
    start = measured[:1]
    residuals = {name: measured - values for name, values in predictions.items()}
    curves, arrays = [], []
    high = scale_of(np.concatenate([measured - start, *(v - start for v in predictions.values())]), unit, signed=True)
    signed = scale_of(np.concatenate(list(residuals.values())), unit, signed=True)
    for name, values in {"measured": measured, **predictions}.items():
        curves.append(Curves(f"readings/{name}", unit, labels, time_ns, values - start))
        arrays.append(_heat(name, shape, time_ns, values - start, high))
    for name, values in residuals.items():
        curves.append(Curves(f"left/{name}", unit, labels, time_ns, values))
        arrays.append(_heat(f"measured − {name}", shape, time_ns, values, signed))
    errors = {name: np.sqrt(np.mean(np.square(values), axis=1)) for name, values in residuals.items()}
    error_table = np.column_stack(list(errors.values()))
    curves.insert(0, Curves("root mean square left", unit, tuple(errors), time_ns, error_table))
    lines = [f"# {title}", "", "Readings since the first frame, measured and predicted by a model.", ""]
    for name, values in residuals.items():
        worst = int(np.argmax(np.square(values).mean(axis=0)))
        lines.append(
            f"- **{name}** leaves {np.sqrt(np.mean(np.square(values))):.3g} {unit} (root mean square), "
            f"most in channel {worst}: {np.sqrt(np.mean(np.square(values[:, worst]))):.3g} {unit}"
        )
    return Scene(
        title,
        "\n".join(lines),
        time_ns,
        np.arange(len(time_ns)),
        curves=tuple(map(signals.thinned, curves)),
        arrays=tuple(arrays),
        kind="comparison",
    )


def _heat(name: str, shape: tuple[int, int], time_ns: np.ndarray, values: np.ndarray, scale: ColorScale) -> TaxelArray:
    rows = thinning.strongest(np.abs(values).max(axis=1), thinning.ARRAYS)
    columns, lines = shape
    flat = np.stack(np.meshgrid(np.arange(columns), np.arange(lines), [0.0]), axis=-1).reshape(-1, 3)
    return TaxelArray(flat, 0.3, columns, lines, time_ns[rows], values[rows], scale, name)


def _taxels(sensor: Sensor) -> TaxelArray:
    """Return the array's places without a signal, for the marks on maps."""
    return signals.taxel_array(sensor, np.zeros(0, np.int64), np.zeros((0, sensor.taxels.count)))


def _course(sides: Sequence[Side]) -> Curves:
    time = np.unique(np.concatenate([side.time_ns for side in sides]))
    values = np.full((len(time), len(sides)), np.nan)
    for k, side in enumerate(sides):
        values[np.searchsorted(time, side.time_ns), k] = side.depth.reshape(len(side.depth), -1).max(axis=1)
    return Curves("largest depth", "mm", tuple(side.name for side in sides), time, values)


def _of_difference(name: str, difference: np.ndarray, time: np.ndarray) -> Curves:
    flat = difference.reshape(len(difference), -1).astype(float)
    values = np.column_stack([np.sqrt(np.square(flat).mean(axis=1)), np.abs(flat).max(axis=1)])
    return Curves(f"difference/{name}", "mm", ("root mean square", "largest"), time, values)


def _words(title: str, sides: Sequence[Side], differences: Sequence[tuple[str, np.ndarray, np.ndarray]]) -> str:
    lines = [f"# {title}", ""]
    for side in sides:
        lines.append(f"- **{side.name}** {len(side.time_ns)} frames, to {side.depth.max(initial=0.0):.2f} mm")
    for name, difference, time in differences:
        square = np.square(difference.astype(float)).mean(axis=(1, 2))
        worst, largest = int(np.argmax(square)), np.abs(difference).max()
        lines.append(
            f"- **{name}** root mean square {np.sqrt(square.mean()):.4f} mm, largest {largest:.3f} mm, "
            f"worst frame {worst} at {(time[worst] - time[0]) / 1e9:.2f} s"
        )
    if not differences:
        lines.append("- they share no frame, so there is no difference to show")
    return "\n".join(lines)
