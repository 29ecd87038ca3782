"""Diagnoses images without a board: another pattern, size, dictionary, or a mirror, tried on a few of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

import schemas
from tacdata.tags.board import Board
from tacdata.tags.calibration.board_view import LEAST_CORNERS, find_board
from tacdata.tags.detection.detector import to_grey

LEAST_MARKERS = 4
"""Markers of another dictionary that must be seen in an image; one or two occur by chance."""

MIRRORED, NEGATIVE = "mirrored", "negative"
_CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "": lambda grey: grey,
    MIRRORED: lambda grey: np.ascontiguousarray(grey[:, ::-1]),
    NEGATIVE: lambda grey: 255 - grey,
}
"""What may have happened to the images -> how it is undone."""
_FEWEST = 3
"""Smallest number of squares of a board along a side [1]."""


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
    grey = [to_grey(image) for image in images]
    seen = {name: [change(image) for image in grey] for name, change in _CHANGES.items()}
    best: tuple[int, Mismatch] | None = None
    for candidates in (_usual(seen, board), _other_sizes(seen, board)):
        for name, candidate in candidates:
            views = [find_board(image, candidate) for image in seen[name]]
            corners = sum(len(view.ids) for view in views if view is not None)
            if corners > (best[0] if best else LEAST_CORNERS - 1):
                best = corners, _in_words(board, candidate, name)
        if best:
            return best[1]
    return None


def _usual(seen: dict[str, list[np.ndarray]], board: Board) -> Iterator[tuple[str, Board]]:
    """Yield how images are changed, and boards with as many squares to try in them."""
    for dictionary in (board.dictionary, *_dictionaries_seen(seen, board)):
        named = replace(board, dictionary=dictionary)
        for name in _CHANGES:
            for is_turned in (False, True):
                for is_legacy in (board.legacy, not board.legacy):
                    turned = replace(named, columns=board.rows, rows=board.columns) if is_turned else named
                    changed = replace(turned, legacy=is_legacy)
                    if changed != board or name:
                        yield name, changed


def _other_sizes(seen: dict[str, list[np.ndarray]], board: Board) -> Iterator[tuple[str, Board]]:
    """Yield boards of other sizes that have as many markers as the images show."""
    markers = 1 + max((max(each) for each in _markers(seen[""], board.dictionary) if len(each)), default=-1)
    if markers < LEAST_MARKERS:
        return
    for columns in range(_FEWEST, 2 * markers // _FEWEST + 1):
        for rows in range(_FEWEST, 2 * markers // _FEWEST + 1):
            if columns * rows // 2 == markers or (columns * rows + 1) // 2 == markers:
                for is_legacy in (board.legacy, not board.legacy):
                    yield "", replace(board, columns=columns, rows=rows, legacy=is_legacy)


def _in_words(board: Board, changed: Board, change: str) -> Mismatch:
    found, remedy = [], []
    if change == MIRRORED:
        found.append("the images are mirrored")
        remedy.append("switch the camera's mirroring off")
    if change == NEGATIVE:
        found.append("black and white are changed over")
        remedy.append("print the board black on white, or switch the camera's negative off")
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


def _dictionaries_seen(seen: dict[str, list[np.ndarray]], board: Board) -> list[str]:
    """Return other dictionaries whose markers the images show, most frequent first."""
    needed = board.columns * board.rows // 2
    names = schemas.load("calibration_board")["properties"]["dictionary"]["enum"]
    names = [name for name in names if name != board.dictionary and int(name.split("_")[1]) >= needed]
    counts = {name: max(len(ids) for images in seen.values() for ids in _markers(images, name)) for name in names}
    # The larger dictionaries of a size include the smaller ones: of equals the smallest is named.
    return sorted((n for n in names if counts[n] >= LEAST_MARKERS), key=lambda n: (-counts[n], int(n.split("_")[1])))


def _markers(images: Sequence[np.ndarray], dictionary: str) -> list[list[int]]:
    """Return the numbers of a dictionary's markers in each image."""
    import cv2

    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}")))
    found = [detector.detectMarkers(image)[1] for image in images]
    return [[] if ids is None else [int(number) for number in np.ravel(ids)] for ids in found]
