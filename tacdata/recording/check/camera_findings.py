"""What is worth a word about a recording's cameras."""

from __future__ import annotations

from typing import Any

from tacdata.recording.check.clocks import clock_doubts

IMAGE_GAP_MS = 1000.0
"""Time without an image, or with the same one, that is worth a word [ms of real time]; at least ten periods."""
SEEN_SHARE = 0.5
"""Share of images with a face in view under which it is worth a word [1]."""
MISSED_SHARE = 0.05
"""Share of images that a camera's own times miss from which it is worth a word [1]."""
SLOW_SHARE = 0.75
"""Share of the nominal rate under which a camera is worth a word [1]; on a fast clock, whose cameras
are drawn by a host that may be too slow for it, so many times less."""


def camera_doubts(entries: dict[str, Any], values: dict[str, Any], rate_of_clock: float) -> list[tuple[str, str]]:
    """Return (stream, words) of what is doubtful about the cameras.

    Args:
        entries: The rig file's ``cameras``.
        values: Figures of each (`camera_figures`).
        rate_of_clock: Seconds that the host's clock shows per real second.
    """
    found = []
    for name, entry in entries.items():
        figures, stream = values.get(name), f"camera {name}"
        if figures is None or not figures["images"]:
            found.append((stream, "no image"))
            continue
        texts = [*_still(figures, rate_of_clock), *_losses(figures, rate_of_clock), *figures["notes"]]
        if figures["clock"] and figures["missed"] is not None:
            texts += clock_doubts({**figures["clock"], "drift": None}, rate_of_clock)
        if "cube" in entry:
            texts += _view("tag", figures, figures["images"])
        for finger, seen in figures["fingers"].items():
            texts += _view(f"tag of {finger}", seen, figures["images"])
        found += [(stream, text) for text in texts]
    return found


def _view(what: str, values: dict[str, Any], images: int) -> list[str]:
    if not values["searched"]:
        return [f"{images} images, none searched for tags"]
    if values["seen"] == 0:
        return [f"no {what} in view in any image"]
    if values["seen"] < SEEN_SHARE:
        return [
            f"{what.replace('tag', 'tags', 1)} in view in {100 * values['seen']:.0f} % of {values['searched']} images"
        ]
    return []


def _losses(values: dict[str, Any], rate_of_clock: float) -> list[str]:
    """Return in words which images are missing."""
    found = []
    if values["lost"]:
        found.append(f"{values['lost']} images lost: the host did not fetch them in time")
    if values["damaged"]:
        found.append(f"{values['damaged']} damaged images discarded")
    if (values["missed"] or 0) > MISSED_SHARE * values["images"]:
        found.append(f"{values['missed']} images missing by its own times, beside {values['images']} received")
    nominal, rate = values["nominal_rate"], values["rate"]
    if nominal and rate and rate < SLOW_SHARE * nominal / max(rate_of_clock, 1.0):
        found.append(f"{rate:.1f} images/s, nominal {nominal:g}")
    return found


def _still(values: dict, rate_of_clock: float) -> list[str]:
    """Return in words whether a camera stopped sending, or sent the same image again and again."""
    period = 1000 / (values["nominal_rate"] or values["rate"] or 1.0)
    limit = max(IMAGE_GAP_MS * rate_of_clock, 10 * period)
    found = []
    if values["longest_gap"] > limit:
        found.append(f"no image for {values['longest_gap'] / 1000:.1f} s")
    if values["longest_still"] > limit:
        found.append(f"the same image for {values['longest_still'] / 1000:.1f} s: it hangs")
    return found
