"""The picture of `tacdata check`: channels, timing of the stream, places of the presses."""

from pathlib import Path
from textwrap import wrap

import numpy as np

from tacdata.recording.check.imported import is_imported
from tacdata.recording.check.report import Report
from tacdata.recording.episode import Episode


def draw(report: Report, path: Path) -> None:
    """Write one page as PNG; an older one is replaced.

    Args:
        report: A report with at least one recording.
        path: The picture's file.
    """
    import matplotlib

    matplotlib.use("agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 8), layout="constrained")
    axes = figure.subplots(2, 3)
    episodes = [entry.recording.episode for entry in report.episodes]
    deepest = max(episodes, key=lambda episode: episode.press.depth)
    unit = report.episodes[0].document["taxels"]["unit"]
    _signals(axes[0, 0], deepest, unit)
    _responses(axes[0, 1], report, unit)
    _sites(axes[0, 2], episodes)
    _noise(axes[1, 0], report, unit)
    _lag(axes[1, 1], report)
    _words(axes[1, 2], report)
    figure.savefig(path, dpi=110)


def _signals(axes, episode: Episode, unit: str) -> None:
    if len(episode.taxels.sample_ns):
        time = (episode.taxels.sample_ns - episode.taxels.sample_ns[0]) / 1e9
        axes.plot(time, episode.taxels.counts - np.median(episode.taxels.counts[:5], axis=0), linewidth=0.7)
        for phase in episode.phases:
            begin = (phase.start_ns - episode.taxels.sample_ns[0]) / 1e9
            axes.axvline(begin, color="0.7", linewidth=0.6)
            axes.text(begin, 1.0, phase.name, transform=axes.get_xaxis_transform(), fontsize=7, rotation=30)
    axes.set(xlabel="time [s]", ylabel=f"change [{unit}]")
    axes.text(0.98, 0.02, episode.path.name, transform=axes.transAxes, fontsize=7, ha="right")


def _responses(axes, report: Report, unit: str) -> None:
    from matplotlib.ticker import MaxNLocator

    table = np.array([_numbers(entry.document["taxels"]["response"]) for entry in report.episodes])
    image = axes.imshow(table, aspect="auto", interpolation="nearest", cmap="viridis")
    axes.figure.colorbar(image, ax=axes, label=f"rest to hold [{unit}]")
    axes.set(xlabel="channel", ylabel="recording", title="answer of each channel")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(integer=True))  # a channel and a half is none


def _sites(axes, episodes: list[Episode]) -> None:
    sensor = episodes[0].sensor
    axes.plot(*sensor.taxels.centers.T, "s", color="0.8", markersize=9)
    sites = np.array([(e.press.x, e.press.y, e.press.depth) for e in episodes])
    points = axes.scatter(sites[:, 0], sites[:, 1], c=sites[:, 2], cmap="viridis", s=22, zorder=3)
    axes.figure.colorbar(points, ax=axes, label="depth [mm]")
    half_x, half_y = sensor.skin.size_x / 2, sensor.skin.size_y / 2
    axes.set(xlim=(-half_x, half_x), ylim=(-half_y, half_y), aspect="equal")
    axes.set(xlabel="x [mm]", ylabel="y [mm]", title="presses and taxels")


def _noise(axes, report: Report, unit: str) -> None:
    table = np.array([_numbers(entry.document["taxels"]["idle_noise"]) for entry in report.episodes])
    measured = ~np.isnan(table).all(axis=0)
    channels = np.arange(table.shape[1])[measured]
    bad = {k for entry in report.episodes for key in ("stuck", "saturated") for k in entry.document["taxels"][key]}
    colors = ["tab:red" if k in bad else "tab:blue" for k in channels]
    axes.bar(channels, np.nanmedian(table[:, measured], axis=0), color=colors)
    axes.set(xlabel="channel (red: stuck or at a limit)", ylabel=f"[{unit}]", title="noise without contact")


def _lag(axes, report: Report) -> None:
    lag = np.concatenate([entry.lag for entry in report.episodes])
    if is_imported(report.episodes[0].recording.episode):  # a source has one time: that of its reading
        steps = [np.diff(entry.recording.episode.taxels.sample_ns) / 1e6 for entry in report.episodes]
        spans = np.concatenate(steps)
        axes.hist(spans, bins=60, color="tab:blue")
        axes.set(xlabel="between two readings [ms]", ylabel="rows", title="times of the taxel stream")
        axes.set_yscale("log" if len(spans) else "linear")
        return
    if len(lag):
        axes.hist(lag, bins=60, color="tab:blue")
        axes.set_yscale("log")
        axes.axvline(float(np.mean(lag)), color="tab:red", linewidth=1.0, label=f"mean {np.mean(lag):.1f} ms")
        axes.legend(fontsize=7)
    axes.set(xlabel="arrival after sample [ms]", ylabel="frames", title="delay of the taxel stream")


def _words(axes, report: Report) -> None:
    axes.axis("off")
    lines = report.text.encode("utf-8", "replace").decode().splitlines()  # a path may hold bytes that are no text
    excerpt = lines if len(lines) <= 24 else [*lines[:23], f"... {len(lines) - 23} more, see check.json"]
    wrapped = [part for line in excerpt for part in wrap(line, 70, subsequent_indent="    ") or [""]]
    axes.text(0.0, 1.0, "\n".join(wrapped), va="top", fontsize=7, transform=axes.transAxes)


def _numbers(values: list[float | None]) -> list[float]:
    return [np.nan if value is None else value for value in values]
