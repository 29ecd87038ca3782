"""Warnings about the cameras of a recording."""

from __future__ import annotations

from typing import Any

from tacdata.recording.check.clocks import clock_warnings

IMAGE_GAP_MS = 1000.0
"""Warning threshold: time without an image, or with a repeated one [ms of real time]; at least ten periods."""
SEEN_SHARE = 0.5
"""Warning threshold: smaller share of images with a face in view [1]."""
MISSED_SHARE = 0.05
"""Warning threshold: share of images lost by the camera's own times [1]."""
SLOW_SHARE = 0.75
"""Warning threshold: smaller share of the nominal rate [1]. On a fast clock it is divided by the clock's rate, since
the host renders the images and may be too slow.
"""


def camera_warnings(entries: dict[str, Any], values: dict[str, Any], rate_of_clock: float) -> list[tuple[str, str]]:
    """Return the warnings about the cameras as (stream, text).

    Args:
        entries: The rig file's ``cameras``.
        values: Figures of each (`camera_figures`).
        rate_of_clock: Seconds that the host's clock shows per real second.
    """
    remarks = []
    for name, entry in entries.items():
        figures, stream = values.get(name), f"camera {name}"
        if figures is None or not figures["images"]:
            remarks.append((stream, "no image"))
            continue
        texts = [*_still(figures, rate_of_clock), *_losses(figures, rate_of_clock), *figures["notes"]]
        if figures["clock"] and figures["missed"] is not None:
            # Its drift is not judged: the nominal rate of a camera is a request, not a promise of its crystal.
            texts += clock_warnings({**figures["clock"], "drift": None}, rate_of_clock)
        if "cube" in entry:
            texts += _view("tag", figures, figures["images"])
        for finger, view in figures["fingers"].items():
            texts += _view(f"tag of {finger}", view, figures["images"])
        remarks += [(stream, text) for text in texts]
    return remarks


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
    """Describe the images that are missing."""
    remarks = []
    if values["lost"]:
        remarks.append(f"{values['lost']} images lost: the host did not fetch them in time")
    if values["damaged"]:
        remarks.append(f"{values['damaged']} damaged images discarded")
    if (values["missed"] or 0) > MISSED_SHARE * values["images"]:
        remarks.append(f"{values['missed']} images missing by its own times, beside {values['images']} received")
    nominal, rate = values["nominal_rate"], values["rate"]
    if nominal and rate and rate < SLOW_SHARE * nominal / max(rate_of_clock, 1.0):
        remarks.append(f"{rate:.1f} images/s, nominal {nominal:g}")
    return remarks


def _still(values: dict, rate_of_clock: float) -> list[str]:
    """Describe a camera that stopped sending, or that repeated the same image."""
    period = 1000 / (values["nominal_rate"] or values["rate"] or 1.0)
    limit = max(IMAGE_GAP_MS * rate_of_clock, 10 * period)
    remarks = []
    if values["longest_gap"] > limit:
        remarks.append(f"no image for {values['longest_gap'] / 1000:.1f} s")
    if values["longest_still"] > limit:
        remarks.append(f"the same image for {values['longest_still'] / 1000:.1f} s: it hangs")
    return remarks
