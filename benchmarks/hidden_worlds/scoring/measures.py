"""Figures of one world: gap closed, error of labels, error and coverage of parameters."""

import numpy as np
from scipy.stats import beta
from worlds import skin

SAME = 1e-4
"""Labels that differ by less are the same [mm]."""
ROWS = 250
"""Most rows of a world whose depth maps are compared."""


def interval(k, n):
    """Return the 95 % Clopper-Pearson interval of a share."""
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return low, high


def aligned_error(model, measured):
    """Return the mean square left of each channel by a model, its own gain and offset fitted [counts^2], mean."""
    total = 0.0
    for m, y in zip(model.T, measured.T, strict=True):
        flat = np.column_stack([m, np.ones(len(m))])
        total += float(np.mean((y - flat @ np.linalg.lstsq(flat, y, rcond=None)[0]) ** 2))
    return total / model.shape[1]


def _at(said, name, truth):
    """Return a predicted quantity at the rows of the truth, straight in between."""
    out = np.empty((len(truth["time"]), said[name].shape[1]))
    for e in np.unique(truth["episode"]):
        rows, own = truth["episode"] == e, said["episode"] == e
        for c in range(out.shape[1]):
            out[rows, c] = np.interp(truth["time"][rows], said["time"][own], said[name][own, c])
    return out


def gap(said, truth):
    """Return how much of the gap that the true form would close is closed [1], on the same presses made again.

    The presses are made again with other contact, without noise; model, its start and the truth's own form (without
    knowing the contact) are each aligned to it by a gain and an offset a channel. None where there is no gap.
    """
    errors = [aligned_error(m, truth["again"]) for m in (_at(said, "before", truth), _at(said, "after", truth))]
    best = aligned_error(truth["oracle"], truth["again"])
    if errors[0] - best < 0.05 * best:
        return None
    return (errors[0] - errors[1]) / (errors[0] - best)


def labels(said, truth, trusted):
    """Return the error of depth maps before and after [mm rms].

    Both from poses at the judge's readings, straight in between: at a corner of the path that is off by a micrometre or
    two, which is nothing that a name does.

    Args:
        said: Prediction of the judge's model.
        truth: True values.
        trusted: Whether the verdict is a name, so that labels are solved again.
    """
    rows = np.flatnonzero(np.maximum(truth["pose"][:, 2], truth["command"][:, 2]) > 0.02)
    rows = rows[:: max(len(rows) // ROWS, 1)]
    radius = truth["radius"][rows]
    real = skin.depth_map(truth["pose"][rows], radius, truth["layer"][rows])

    def error(pose):
        return float(np.sqrt(np.mean((skin.depth_map(pose[rows], radius) - real) ** 2)))

    # Verdicts of judges without a nominal pose are compared with the command itself.
    before = error(_at(said, "nominal", truth) if "nominal" in said else truth["command"])
    return before, error(_at(said, "pose", truth)) if trusted else before


def parameters(truth, verdict):
    """Return every parameter whose true value is known: effect, name, value, truth, whether its interval holds it."""
    made = []
    for name, values in truth["parameters"].items():
        for member in verdict["effects"]:
            if member["mechanism"] != name or member["status"] != "named" or member.get("level") == "family":
                continue
            for key, true in values.items():
                given = member["parameters"].get(key)
                if given is None or isinstance(given["value"], list):
                    continue
                low, high = given.get("interval") or (np.nan, np.nan)
                held = bool(low <= true <= high) if np.isfinite(low) else None
                made.append({"effect": name, "name": key, "value": given["value"], "truth": true, "held": held})
    return made


def confidences(truth, verdict, accepted):
    """Return the probability of every mechanism that is named, and whether it is right."""
    made = []
    for m in verdict["effects"]:
        given = m.get("probability", {}).get("mechanism")
        if given is not None and m["status"] == "named" and m.get("level") != "family":
            made.append((float(given), any(m["mechanism"] in accepted(h) for h in truth["effects"])))
    return made


def calibration(pairs, bins=10):
    """Return the expected calibration error, Brier's score, and each bin's mean confidence, share right and count."""
    said, right = np.array([p for p, _ in pairs]), np.array([float(r) for _, r in pairs])
    which = np.minimum((said * bins).astype(int), bins - 1)
    table = [(said[which == b].mean(), right[which == b].mean(), int((which == b).sum())) for b in np.unique(which)]
    error = sum(n * abs(p - r) for p, r, n in table) / len(pairs)
    return float(error), float(np.mean((said - right) ** 2)), table
