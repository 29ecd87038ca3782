"""Summary of a demonstration or of targets, as Markdown."""

import numpy as np

from tacdata.demonstrations.compensation import contact_depth
from tacdata.demonstrations.demonstration import GUESS, Demonstration, FingerTrack
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.replay.targets import FingertipTargets


def of_demonstration(
    title: str, demonstration: Demonstration | None, recorded: DemoRecording | None, remarks: tuple[str, ...] = ()
) -> str:
    """Return a summary of the demonstration, finger by finger, and its missing parts."""
    lines = [f"# {title}", ""]
    if recorded is not None:
        begin, end = recorded.span_ns
        state = "" if recorded.complete else "; **interrupted or salvaged**"
        lines.append(f"- **Task** {recorded.task}, {(end - begin) / 1e9:.1f} s, rig {recorded.rig.name}{state}")
        lines.append(
            f"- **Boards** {', '.join(recorded.taxels) or 'none'}; **cameras** {', '.join(recorded.rig.cameras)}"
        )
    elif demonstration is not None:
        lines.append(f"- **Task** {demonstration.task}, {demonstration.seconds[-1]:.1f} s")
    absent = []
    if demonstration is None:
        absent.append("no tracks, so the fingers have no place in space: run `tacdata track`")
    else:
        lines += _tracks(demonstration)
        if demonstration.network is None:
            absent.append("no predicted depth: run `tacdata track --network RUN`")
    if recorded is None:
        absent.append("no recording next to the tracks, so no cameras and no boards")
    if absent:
        lines += ["", "Not shown: " + "; ".join(absent) + "."]
    notes = (*remarks, *(recorded.notes if recorded else ()), *(demonstration.remarks if demonstration else ()))
    return "\n".join([*lines, *(["", *(f"- {note}" for note in dict.fromkeys(notes))] if notes else [])])


def _tracks(demo: Demonstration) -> list[str]:
    lines = [f"- **Frame** {demo.frame}, grid of {demo.rate:g} Hz"]
    for name, track in demo.tracks.items():
        felt = ""
        if track.depth is not None:
            depth = contact_depth(track.depth)
            felt = f", predicted depth to {np.nanmax(depth, initial=0.0):.2f} mm"
        lines.append(
            f"- **{name}** {track.sightings} sightings, {track.outliers} left out, {_bridged(track, demo.rate)}{felt}"
        )
    if demo.network:
        lines.append(f"- **Depth** is an estimate by {demo.network['network']}, checkpoint {demo.network['hash'][:12]}")
    return lines


def _bridged(track: FingerTrack, rate: float) -> str:
    """Return how much of a path is bridged, and how much of that is a guess."""
    spread = np.sqrt(np.max(np.diagonal(track.covariance[:, 3:, 3:], axis1=1, axis2=2), axis=1))
    guess = track.gap & (spread > GUESS)
    words = f"{track.gap.mean():.0%} bridged"
    if not guess.any():
        return words
    return (
        f"{words}, **of which {guess.sum() / rate:.1f} s are a guess** (known to {1000 * spread[guess].max():.0f} mm)"
    )


def of_targets(title: str, targets: FingertipTargets, count: int, joints: dict[str, np.ndarray] | None) -> str:
    """Return a summary of a robot's targets."""
    seconds = (targets.time_ns[-1] - targets.time_ns[0]) / 1e9
    shift = 1000 * np.linalg.norm(targets.position - targets.seen, axis=-1)
    lines = [
        f"# {title}",
        "",
        f"- **Targets** {targets.kind}, {len(targets.time_ns)} in {seconds:.1f} s, frame {targets.frame}",
        f"- **Demonstration** {targets.recording}, task {targets.task}",
    ]
    for k, name in enumerate(targets.fingers):
        gain = f", gain {1000 * targets.gains[name]:g} mm/mm" if name in targets.gains else ""
        lines.append(
            f"- **{name}** moved by up to {shift[:, k].max():.1f} mm{gain}, {targets.gap[:, k].mean():.0%} bridged"
        )
    if joints:
        lost = np.isnan(np.column_stack(list(joints.values()))).any(axis=1).sum()
        lines.append(f"- **Joints** {len(joints)}; {lost} of {len(targets.time_ns)} targets are not reached (gaps)")
    if count:
        lines += ["", f"{count} more in the folder: --episode 0 to {count}."]
    return "\n".join([*lines, *(["", *(f"- {note}" for note in targets.remarks)] if targets.remarks else [])])
