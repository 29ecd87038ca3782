"""Resumes a finger's track where the filter lost it: rejected sightings that agree among themselves are right.

A filter whose process noise is too small for a sudden motion rejects every sighting after it. Two criteria distinguish
such a run of rejections from mirrored poses and exchanged tags. Its members fit one motion. And the likelihood of the
whole track increases if the finger may have moved abruptly before the first of them, or if the sightings that were
accepted just before it are the wrong ones: after a gap a mirrored pose may be the first that fits.
"""

from __future__ import annotations

import numpy as np

from tacdata.demonstrations.paths.bridging import unseen_noise
from tacdata.demonstrations.paths.motion_filter import GAP, NS, ProcessNoise, Smoothed, smooth
from tacdata.demonstrations.paths.sightings import Sightings

LEAST_RUN = 4
"""Minimum number of rejected sightings in a row for resuming the track; fewer are mirrored poses."""
LOOKED_AT = 8
"""Number of first sightings of a run that must fit one motion; later the finger may turn round."""
AGREEING = 0.8
"""Share of a run that must fit one motion of its own [1]."""
PRIOR = 10.0
"""Minimum gain in log-likelihood of the track [nats]: abrupt motions are rare a priori."""
MOST = 20
"""Largest number of places at which a track is resumed."""
SUSPECT = 3
"""Largest number of sightings between a gap and a run that may be the wrong ones."""


def acquire(sightings: Sightings, times_ns: np.ndarray, wander: ProcessNoise) -> Smoothed:
    """Return a finger's smoothed path, as `smooth` does, with its track resumed where it was lost.

    Args:
        sightings: At least two sightings.
        times_ns: Times [ns], shape (n,), ascending.
        wander: Process noise.
    """
    nothing = np.zeros(0, np.int64)
    resumptions: list[int] = []
    wrong: list[int] = []
    wander = unseen_noise(sightings, wander)
    # Candidates are compared by their likelihood, which the forward pass alone gives.
    best = smooth(sightings, nothing, wander, back=False)
    refused: set[int] = set()
    while len(resumptions) + len(wrong) < MOST:
        run = next((r for r in _runs(best.accepted) if r[0] not in refused), None)
        if run is None:
            break
        # Each run is tried once, or one that brings nothing would be tried for ever.
        refused.add(run[0])
        if not _agree(sightings, run, wander):
            continue
        tries = [([*resumptions, run[0]], wrong)]
        # Perhaps the wrong ones are those that the filter accepted after a gap, and the rejected ones are right.
        suspects = _first_after_gap(sightings, np.flatnonzero(best.accepted[: run[0]]))
        if suspects:
            tries.append((resumptions, [*wrong, *suspects]))
        for resumed, doubted in tries:
            tried = smooth(sightings, nothing, wander, back=False, reacquired=resumed, left_out=doubted)
            if tried.log_likelihood > best.log_likelihood + PRIOR:
                resumptions, wrong, best = resumed, doubted, tried
    return smooth(sightings, times_ns, wander, reacquired=resumptions, left_out=wrong)


def _runs(accepted: np.ndarray) -> list[tuple[int, int]]:
    """Return first and end of every run of at least `LEAST_RUN` rejected sightings; accepted ones may lie between.

    If only one of two cameras is accepted, accepted and rejected sightings alternate. So a run continues over single
    accepted sightings.
    """
    runs: list[tuple[int, int]] = []
    rejected = np.flatnonzero(~accepted)
    for first in rejected:
        if runs and first - runs[-1][1] <= 1:
            runs[-1] = runs[-1][0], int(first) + 1
        else:
            runs.append((int(first), int(first) + 1))
    return [run for run in runs if (~accepted[run[0] : run[1]]).sum() >= LEAST_RUN]


def _first_after_gap(sightings: Sightings, accepted: np.ndarray) -> list[int]:
    """Return the last accepted sightings, if a gap is right before them and they are few; else none.

    Args:
        sightings: The finger's sightings.
        accepted: Those that were accepted before a run of rejections, ascending.
    """
    breaks = np.flatnonzero(np.diff(sightings.time_ns[accepted]) > GAP / NS) + 1
    last = accepted[breaks[-1] :] if len(breaks) else accepted[:0]
    return last.tolist() if len(last) <= SUSPECT else []


def _agree(sightings: Sightings, run: tuple[int, int], wander: ProcessNoise) -> bool:
    """Return whether the sightings of a run fit one motion."""
    mask = np.zeros(len(sightings), bool)
    mask[run[0] : min(run[1], run[0] + LOOKED_AT)] = True
    part = sightings.where(mask)
    return float(smooth(part, np.zeros(0, np.int64), wander, back=False).accepted.mean()) >= AGREEING
