"""Diagnoses images without a board: another pattern, size, dictionary, or a mirror, tried on a few of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

import schemas
from tacdata.tags.board import Board
from tacdata.tags.calibration.board_view import LEAST_CORNERS, find_board
from tacdata.tags.detection.detector import to_grey

LEAST_MARKERS = 4
"""Markers of another dictionary that must be seen in an image; one or two occur by chance."""


@dataclass(frozen=True)
class Mismatch:
    """What differs between a board file and the board in the images."""

    found: str
    """What the images show, as a sentence."""
    remedy: str
    """What to change."""


def mismatch(images: Sequence[np.ndarray], board: Board) -> Mismatch | None:
    """Return the change that makes a board's corners appear in images that show none; None if nothing tried does.

    Args:
        images: A few images, grey or BGR, uint8.
        board: The board of the file.
    """
    best: tuple[int, Mismatch] | None = None
    for candidate, is_mirrored, reason in _candidates(images, board):
        corners = 0
        for image in images:
            view = find_board(np.ascontiguousarray(image[:, ::-1]) if is_mirrored else image, candidate)
            corners += 0 if view is None else len(view.ids)
        if corners > (best[0] if best else LEAST_CORNERS - 1):
            best = corners, reason
    return best[1] if best else None


def _candidates(images: Sequence[np.ndarray], board: Board) -> Iterator[tuple[Board, bool, Mismatch]]:
    """Yield boards to try, whether in the mirrored images, and the conclusion if they are found."""
    for dictionary in (board.dictionary, *_dictionaries_seen(images, board)):
        named = replace(board, dictionary=dictionary)
        for is_mirrored in (False, True):
            for is_turned in (False, True):
                for is_legacy in (board.legacy, not board.legacy):
                    turned = replace(named, columns=board.rows, rows=board.columns) if is_turned else named
                    changed = replace(turned, legacy=is_legacy)
                    if changed != board or is_mirrored:
                        yield changed, is_mirrored, _in_words(board, changed, is_mirrored)


def _in_words(board: Board, changed: Board, is_mirrored: bool) -> Mismatch:
    found, remedy = [], []
    if is_mirrored:
        found.append("the images are mirrored")
        remedy.append("switch the camera's mirroring off")
    if changed.legacy != board.legacy:
        found.append(f"the pattern begins as OpenCV drew it {'before' if changed.legacy else 'from'} 4.6")
        remedy.append(f"legacy: {'true' if changed.legacy else 'false'}")
    if (changed.columns, changed.rows) != (board.columns, board.rows):
        found.append(f"{changed.columns} squares across and {changed.rows} down")
        remedy.append(f"columns: {changed.columns} and rows: {changed.rows}")
    if changed.dictionary != board.dictionary:
        found.append(f"markers of the dictionary {changed.dictionary}")
        remedy.append(f"dictionary: {changed.dictionary}")
    settings = [text for text in remedy if ":" in text]
    others = [text for text in remedy if ":" not in text]
    words = others + ([f"write {', '.join(settings)} in the board file"] if settings else [])
    return Mismatch(", ".join(found), ", and ".join(words))


def _dictionaries_seen(images: Sequence[np.ndarray], board: Board) -> list[str]:
    """Return other dictionaries whose markers the images show, most frequent first."""
    import cv2

    needed = board.columns * board.rows // 2
    names = schemas.load("calibration_board")["properties"]["dictionary"]["enum"]
    names = [name for name in names if name != board.dictionary and int(name.split("_")[1]) >= needed]
    counts = {}
    for name in names:
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))
        detector = cv2.aruco.ArucoDetector(markers)
        seen = [detector.detectMarkers(grey) for image in images for grey in (to_grey(image), _mirrored(image))]
        counts[name] = max((0 if ids is None else len(ids) for _, ids, _ in seen), default=0)
    # The larger dictionaries of a size include the smaller ones: of equals the smallest is named.
    return sorted((n for n in names if counts[n] >= LEAST_MARKERS), key=lambda n: (-counts[n], int(n.split("_")[1])))


def _mirrored(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(to_grey(image)[:, ::-1])
