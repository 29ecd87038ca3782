"""Whether fingertip paths stay honest when images come late: truth within 3 standard deviations, or refused.

A hand grasps or wipes for `--seconds`, seen by two cameras at 20 Hz. Exposures, latencies, lost images and the work of
the host are simulated, so the result is the same at any load of the computer. Every second seed has a busy host of one
of `KINDS`. Of each kind, one half has cameras that stamp their images, the other has none.

The cameras' places are off by their stated spread, the same for a whole recording. So by chance alone about one
recording in a hundred has many frames outside.

    python benchmarks/late_images.py [--seeds N] [--first N] [--seconds S] [--kind KIND] [--faults] [--alone]
        [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from hand_paths import START, rig_of
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.paths.tracking import track
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.errors import TacdataError
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.clocks.image_clock import image_clock
from tacdata.recording.clocks.running_clock import StreamClock
from tacdata.recording.episode import TagStream, TaxelStream
from tacdata.replay.targets import check_guesses, targets_of
from tacdata.virtual_rig.demo import DELAY, FINGERS, RATE
from tacdata.virtual_rig.world.hand import draw_hand

KINDS = ("late", "late to the end", "late from the start", "bursts", "slow", "lost", "always late")
"""How images come on a busy host: 0.2 s late for ten seconds, in the middle, to the end, or from before the start; late
now and then; a camera that skips images for lack of time; lost images; 0.2 s late all the time.
"""
FAULTS = (
    *("step", "small step", "frozen", "reordered", "dropped", "batches", "drift", "stall", "half rate", "units"),
    "rate",
)
"""Faults of a camera and its stamps: its clock set by up to 1.5 s or by less than a period; an image repeated under
fresh stamps; neighbours exchanged; no images for a second; stamps of a whole batch; stamps 0.1 % slow; images held
back and then all at once, at the beginning or the end; half the rate after a second of silence; stamps in
microseconds; a rig file with no rate or another one.
"""
BEFORE = 5.0
"""Time for which the camera is open before the recording [s]."""
ACCUSING = ("was moved", "change places", "of the other hand", "contradict", "glued on")
"""Words of a remark that accuses a camera or a tag."""


def exposed(kind, seconds, rng):
    """Return exposures, arrivals and stamps of one camera [s after the beginning of the recording], shape (n,) each."""
    if kind in FAULTS:
        return faulty(kind, seconds, rng)
    times, arrivals = busy(kind, seconds, rng)
    return times, arrivals, times


def busy(kind, seconds, rng):
    """Return exposures and arrivals of a camera on a busy host, or an idle one."""
    begun = -BEFORE + rng.uniform(0, 1 / RATE)
    times = np.arange(begun, seconds, 1 / RATE)
    late = DELAY + rng.uniform(0, 0.01, len(times))
    begin = rng.uniform(1.0, max(seconds - 11.0, 1.1))
    size = rng.uniform(0.15, 0.3)
    kept = np.ones(len(times), bool)
    if kind == "late":
        late[(times > begin) & (times < begin + 10.0)] += size
    elif kind == "late to the end":
        late[times > seconds - 10.0] += size
    elif kind == "late from the start":
        late[times < 10.0] += size
    elif kind == "always late":
        late += size
    elif kind == "bursts":
        for moment in rng.uniform(0, seconds, 8):
            rows = (times > moment) & (times < moment + rng.uniform(0.2, 2.0))
            late[rows] += rng.uniform(0.02, 0.4)
    elif kind == "lost":
        kept = rng.random(len(times)) > rng.uniform(0.01, 0.1)
    elif kind == "slow":
        return slow(times[0], seconds, begin, rng)
    arrivals = np.maximum.accumulate(times + late)
    return times[kept], arrivals[kept] + 0.0005 * np.arange(len(times))[kept] / len(times)


def faulty(kind, seconds, rng):
    """Return exposures, arrivals and stamps of a camera with a fault, on an idle host."""
    times, arrivals = busy("", seconds, rng)
    stamps, count = times.copy(), len(times)
    begin, length = rng.uniform(2.0, seconds - 4.0), rng.uniform(0.5, 1.3)
    after, inside = times > begin, (times > begin) & (times < begin + length)
    kept = np.ones(count, bool)
    if kind == "step":
        stamps[after] += rng.choice([-1, 1]) * rng.uniform(0.06, 1.5)
    elif kind == "small step":
        stamps[after] += rng.choice([-1, 1]) * rng.uniform(0.015, 0.045)
    elif kind == "frozen":
        times[inside] = times[after][0]
    elif kind == "reordered":
        for k in np.flatnonzero(rng.random(count - 1) < 0.05):
            times[[k, k + 1]], stamps[[k, k + 1]] = times[[k + 1, k]], stamps[[k + 1, k]]
            arrivals[k] = arrivals[k + 1] - 0.0002
    elif kind == "dropped":
        kept = ~inside
    elif kind == "batches":
        last = np.minimum((np.arange(count) // (size := int(rng.integers(2, 6))) + 1) * size, count) - 1
        arrivals = arrivals[last] + 0.0005 * (np.arange(count) - last + size)
        stamps = times[last] + 0.0002 * (np.arange(count) - last + size)
    elif kind == "drift":
        stamps *= 1 + rng.choice([-1, 1]) * 0.001
    elif kind == "stall":
        held = times < length if rng.random() < 0.5 else times > seconds - length - 0.3
        release = arrivals[held][-1] if held[0] else seconds - 0.3
        arrivals = np.where(held, np.maximum(arrivals, release), arrivals)
        arrivals = np.maximum.accumulate(arrivals) + 0.0005 * np.arange(count) / count
    elif kind == "half rate":
        kept = ~(after & (times < begin + 1.0)) & ~((times >= begin + 1.0) & (np.arange(count) % 2 == 0))
    elif kind == "units":
        stamps *= 0.001
    return times[kept], arrivals[kept], stamps[kept]


def slow(first, seconds, begin, rng):
    """Return exposures and arrivals of a camera that skips exposures when its work takes longer than a period."""
    times, arrivals, now, number = [], [], first, 0
    while now < seconds:
        exposure = first + number / RATE
        busy = begin < now < begin + 10.0
        ready = now + rng.lognormal(np.log(0.2 if busy else 0.01), 0.4)
        now = max(ready, exposure + DELAY + rng.uniform(0, 0.01))
        times.append(exposure)
        arrivals.append(now)
        number += max(1, int((now - exposure) * RATE))
    return np.array(times), np.array(arrivals)


def streams(hand, camera, eye, made, stamped, seconds, rng, rate=RATE):
    """Return one camera's view of all fingers, with the times that the reader of a recording would give."""
    times, arrivals, marks = made
    arrival = START + np.rint(arrivals * 1e9).astype(np.int64)
    device = np.rint(marks * 1e9).astype(np.int64) + 7_000_000_000_000 if stamped else np.full(len(times), -1)
    clock = StreamClock("device_ns" if stamped else "order")
    clock.set_latency(StreamLatency(int(DELAY * 1e9), 2_000_000))
    number = np.arange(len(times))
    for k in number:
        clock.take(int(arrival[k]), int(device[k] if stamped else k))
    rows = (arrivals >= 0) & (arrivals < seconds)
    own = image_clock(arrival[rows], number[rows], device[rows], clock.model(), rate)
    stamps, sigma = own.sample_times(arrival[rows], number[rows]), own.uncertainties(number[rows])
    return [
        seen_by(hand, finger, camera, eye, times[rows], stamps, sigma, rng) for finger in FINGERS["fingers"]
    ], np.abs((stamps - START) * 1e-9 - times[rows]) / sigma


def seen_by(hand, finger, camera, eye, times, stamps, sigma, rng):
    """Return a finger's poses at true times, under the times that they are given."""
    world, count = np.linalg.inv(eye), len(times)
    poses = np.array([world @ hand.tip(finger, t) for t in times])
    # One image, repeated, has one pose.
    copied = np.maximum.accumulate(np.where(np.diff(times, prepend=-np.inf) != 0, np.arange(count), 0))
    across = rng.uniform(0.00005, 0.0002, count)
    spreads = np.stack([np.radians(0.25) * np.ones(count)] * 3 + [across, across, 6 * across], axis=1)
    noise = rng.normal(0, spreads)
    covariance = np.zeros((count, 6, 6))
    covariance[:, range(6), range(6)] = spreads**2
    turns = Rotation.from_rotvec(noise[:, :3]) * Rotation.from_matrix(poses[:, :3, :3])
    kept, first = (rng.random(count) < 0.9)[copied], FINGERS["fingers"][finger]["cube"]["ids"]["+x"]
    stream = TagStream(
        camera,
        stamps,
        (poses[:, :3, 3] + noise[:, 3:])[copied],
        turns.as_quat()[copied],
        np.full(count, 0.1),
        np.full(count, 2),
        covariance,
        np.zeros(count, bool),
        ((first, first + 1),) * count,
        finger,
        sigma,
    )
    arrays = {k: v[kept] for k, v in vars(stream).items() if isinstance(v, np.ndarray)}
    return replace(stream, **arrays, ids=((first, first + 1),) * int(kept.sum()))


def felt(hand, finger, seconds, rng):
    """Return a board's readings at 30 Hz, on the host's clock."""
    times = np.arange(int(seconds * 30)) / 30
    depth = np.array([hand.press(finger, t)[2] for t in times])
    counts = 9000 + 1500 * depth[:, None] * np.linspace(0.5, 1.0, 24) + rng.normal(0, 4, (len(times), 24))
    stamps = START + np.rint(times * 1e9).astype(np.int64)
    return TaxelStream(stamps, stamps, np.arange(len(times)), np.round(counts))


def judged(seed, kind, seconds, folder, alone=False):
    """Record, track and judge one hand, seen by two cameras or one alone; return its figures."""
    rng = np.random.default_rng([seed, 29])
    hand = draw_hand(seed, ("grasp", "wipe")[seed // 2 % 2])
    rig, eyes = rig_of(seed)
    stamped, both = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    path = folder / "episode-000000.mcap"
    path.write_bytes(b"simulated")
    views, off = [], []
    both = both or alone
    for k, (camera, eye) in enumerate(list(eyes.items())[: 1 if alone else None]):
        at_fault = both or k == seed % 2
        made = exposed(kind if at_fault else "", seconds, rng)
        rate = (None, 1.5 * RATE)[seed // 4 % 2] if at_fault and kind == "rate" else RATE
        found, ratio = streams(hand, camera, eye, made, stamped, seconds, rng, rate)
        views, off = [*views, *found], [*off, ratio]
    taxels = {finger: felt(hand, finger, seconds, rng) for finger in FINGERS["fingers"]}
    recording = DemoRecording(path, rig, hand.task, taxels, tuple(views), True, ())
    row = {"seed": seed, "kind": kind or "idle", "stamped": stamped, "both": both, "refused": "", "remarks": []}
    row["times_outside"] = float((np.concatenate(off) > 3).mean())
    try:
        tracked = track(recording)
        row["remarks"] = list(tracked.remarks)
        row |= coverage(hand, tracked)
        check_guesses(targets_of(tracked, None))
    except TacdataError as error:
        row["refused"] = error.given
    return row


def coverage(hand, tracked):
    """Return the share of frames whose truth is outside of 3 standard deviations, and the largest error [mm]."""
    outside, worst = [], 0.0
    for name, found in tracked.tracks.items():
        truth = np.array([hand.tip(name, (t - START) * 1e-9)[:3, 3] for t in tracked.time_ns])
        away, known = found.position - truth, np.isfinite(found.position).all(axis=1)
        spread = np.sqrt(found.covariance[:, range(3, 6), range(3, 6)])
        outside.append((np.abs(away) > 3 * spread).any(axis=1)[known])
        worst = max(worst, float(1000 * np.nanmax(np.linalg.norm(away, axis=1))))
    return {"outside": float(np.concatenate(outside).mean()), "worst_mm": worst}


def main():
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=18.0)
    parser.add_argument("--kind", choices=(*KINDS, *FAULTS))
    parser.add_argument("--faults", action="store_true", help="faults of cameras and stamps, in place of busy hosts")
    parser.add_argument("--alone", action="store_true", help="one camera in place of two")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.seeds):
            kind = KINDS[seed // 2 % len(KINDS)] if seed % 2 else ""
            kind = chosen.kind or (FAULTS[seed % len(FAULTS)] if chosen.faults else kind)
            rows.append(judged(seed, kind, chosen.seconds, Path(folder), chosen.alone))
            print(line(rows[-1]), flush=True)
            if chosen.json:
                chosen.json.write_text(json.dumps(rows, indent=1) + "\n")
    report(rows)


def line(row):
    """Return one recording's figures as a line."""
    accused = [words for words in row["remarks"] if any(part in words for part in ACCUSING)]
    return (
        f"{row['seed']:4} {row['kind']:<20} {'stamped' if row['stamped'] else '':<8}"
        f"{'both' if row['both'] else 'one':<5} outside {row.get('outside', float('nan')):6.2%} "
        f"worst {row.get('worst_mm', float('nan')):5.1f} mm "
        f"times outside {row['times_outside']:.1%} {'refused' if row['refused'] else ''} {' | '.join(accused)}"
    )


def report(rows):
    """Print the figures over all recordings."""
    accused = [r for r in rows if any(part in words for words in r["remarks"] for part in ACCUSING)]
    wrong = [r for r in rows if not r["refused"] and r["outside"] > 0.01]
    refused = Counter(r["kind"] for r in rows if r["refused"])
    print(f"recordings                      {len(rows)}")
    accepted = [r["outside"] for r in rows if not r["refused"]]
    print(f"frames outside, of all accepted {np.mean(accepted):.2%}")
    print(f"accepted, more than 1 % outside {len(wrong)}: seeds {[r['seed'] for r in wrong]}")
    print(f"false accusations               {len(accused)}: seeds {[r['seed'] for r in accused]}")
    print(f"refused                         {sum(refused.values())}: {dict(refused)}")
    print(f"refused with stamps             {sum(bool(r['refused']) and r['stamped'] for r in rows)}")


if __name__ == "__main__":
    main()
