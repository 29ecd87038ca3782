"""Requirements and the measured figures."""

from dataclasses import dataclass

import numpy as np

from scoring.measures import SAME, calibration, interval
from scoring.outcome import WRONG


@dataclass(frozen=True)
class Bar:
    """One line."""

    what: str
    asked: str
    measured: str
    met: bool | None
    """By the share itself; None where nothing was measured."""
    sure: bool = True
    """Whether the whole 95 % interval is on the same side."""

    @property
    def verdict(self):
        """Return whether it is met, in words."""
        if self.met is None:
            return "not measured"
        return ("yes" if self.met else "no") + ("" if self.sure else ", too few worlds to be sure")


def share(k, n):
    """Return a share with its count and interval, in words."""
    if not n:
        return "no world"
    low, high = interval(k, n)
    return f"{100 * k / n:.1f} % ({k}/{n}, {100 * low:.1f} to {100 * high:.1f})"


def bars(rows):
    """Return every line for the rows of a run."""
    return [
        *_outcomes(rows),
        *_pairs(rows),
        _coverage(rows),
        _gap(rows),
        _labels(rows),
        _confidence(rows),
        _seconds(rows),
    ]


def _of(rows, *blocks):
    return [r for r in rows if r["block"] in blocks]


def _bar(what, limit, most, hits):
    n, k = len(hits), sum(hits)
    asked = f"{'at most' if most else 'at least'} {100 * limit:g} %"
    if not n:
        return Bar(what, asked, share(k, n), None)
    says = [bool(p <= limit if most else p >= limit) for p in (k / n, *interval(k, n))]
    return Bar(what, asked, share(k, n), says[0], len(set(says)) == 1)


def _outcomes(rows):
    def hits(chosen, *outcomes):
        return [r["outcome"] in outcomes for r in chosen]

    yield _bar("false names on nulls", 0.02, True, hits(_of(rows, "nulls"), "false name"))
    for times, limit in (("3", 0.75), ("10", 0.95)):
        chosen = _of(rows, f"singles{times}")
        yield _bar(f"singles at {times} x limit: success", limit, False, hits(chosen, "success"))
        family = [r.get("family", False) for r in chosen]
        yield _bar(f"singles at {times} x limit: family right", limit, False, family)
        yield _bar(f"singles at {times} x limit: confidently wrong", 0.02, True, hits(chosen, *WRONG))
    yield _bar("aliases: overclaim", 0.05, True, hits(_of(rows, "aliases"), *WRONG))
    outside = [r for r in rows if r["block"].startswith("outside")]
    yield _bar("outside the library: confidently wrong", 0.05, True, hits(outside, *WRONG))


def _pairs(rows):
    far = _of(rows, "pairs")
    yield _bar("pairs, not adversarial: exact", 0.65, False, [r["outcome"] == "success" for r in far])
    weak = [min(r["times"], key=lambda n: r["times"][n]) for r in far]
    named = [r.get("found", {}).get(w) == "named" for r, w in zip(far, weak, strict=True)]
    yield _bar("pairs, not adversarial: weaker one named", 0.75, False, named)


def _coverage(rows):
    held = [p["held"] for r in rows if r["block"].startswith("singles") for p in r.get("parameters", [])]
    given = [h for h in held if h is not None]
    words = share(sum(given), len(given)) + f"; without an interval: {len(held) - len(given)}"
    asked = "85 to 95 %"
    if not given:
        return Bar("90 % intervals of named singles hold the truth", asked, words, None)
    met, (low, high) = 0.85 <= float(np.mean(given)) <= 0.95, interval(sum(given), len(given))
    sure = (low >= 0.85 and high <= 0.95) if met else (low > 0.95 or high < 0.85)
    return Bar("90 % intervals of named singles hold the truth", asked, words, met, sure)


def _gap(rows):
    large = _of(rows, "singles3", "singles10", "pairs")
    closed = [r["gap"] for r in large if r.get("gap") is not None and r["outcome"] != "missed"]
    if not closed:
        return Bar("gap closed, of the true form's", "median at least 0.9", "no world", None)
    middle = float(np.median(closed))
    words = f"{middle:.3f} (n = {len(closed)} not missed, 10th percentile {np.percentile(closed, 10):.3f})"
    low, high = interval(sum(c >= 0.9 for c in closed), len(closed))
    sure = low >= 0.5 or high < 0.5
    return Bar("gap closed, of the true form's", "median at least 0.9", words, middle >= 0.9, sure)


def _labels(rows):
    known = [r for r in rows if "label_after" in r]
    return _bar(
        "labels no worse than before", 0.98, False, [r["label_after"] <= r["label_before"] + SAME for r in known]
    )


def _confidence(rows):
    pairs = [p for r in rows for p in r.get("confidence", [])]
    if not pairs:
        return Bar("expected calibration error", "at most 0.05", "not given", None)
    error, brier, _ = calibration(pairs)
    return Bar(
        "expected calibration error",
        "at most 0.05",
        f"{error:.3f}, Brier {brier:.3f} (n = {len(pairs)})",
        error <= 0.05,
    )


def _seconds(rows):
    seconds = [r["seconds"] for r in rows if r["seconds"] is not None]
    if not seconds:
        return Bar("CPU seconds a world", "at most 30", "no world", None)
    words = (
        f"median {np.median(seconds):.1f}, 95th percentile {np.percentile(seconds, 95):.1f}, most {max(seconds):.1f}"
    )
    return Bar("CPU seconds a world", "at most 30", f"{words} (n = {len(seconds)})", max(seconds) <= 30)
