"""Diagnoses images without a board: another pattern, size, dictionary, or a mirror, tried on a few of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata import schemas
from tacdata.tags.board import Board
from tacdata.tags.calibration.board_view import LEAST_CORNERS, BoardView, Markers, find_board, find_markers
from tacdata.tags.detection.detector import to_grey

LEAST_MARKERS = 4
"""Markers of another dictionary that must be seen in an image; one or two occur by chance."""

MIRRORED, NEGATIVE = "mirrored", "negative"
_CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "": lambda grey: grey,
    MIRRORED: lambda grey: np.ascontiguousarray(grey[:, ::-1]),
    NEGATIVE: lambda grey: 255 - grey,
}
"""Possible change to the images -> its inverse."""
_FEWEST = 3
"""Smallest number of squares of a board along a side [1]."""


@dataclass(frozen=True)
class Mismatch:
    """Difference between a board file and the board in the images."""

    found: str
    """Content of the images, as a sentence."""
    remedy: str
    """Remedy."""


def mismatch(images: Sequence[np.ndarray], board: Board) -> Mismatch | None:
    """Return the change that makes a board's corners appear in images that show none; None if nothing tried does.

    Args:
        images: A few images, grey or BGR, uint8.
        board: The board of the file.
    """
    evidence = _Seen(images)
    best: tuple[int, Mismatch] | None = None
    nominal, alternatives = _usual([board.dictionary], board), _usual(evidence.dictionaries(board), board)
    # The likeliest first: a group is tried only where none before it shows corners.
    for candidates in (nominal, alternatives, _other_sizes(evidence, board)):
        for name, candidate in candidates:
            views = evidence.views(name, candidate)
            corners = sum(len(view.ids) for view in views if view is not None)
            if corners > (best[0] if best else LEAST_CORNERS - 1):
                best = corners, _in_words(board, candidate, name)
        if best:
            return best[1]
    return None


class _Seen:
    """Images, as they are and changed, with the markers in them: boards of one dictionary share their markers."""

    def __init__(self, images: Sequence[np.ndarray]) -> None:
        grey = [to_grey(image) for image in images]
        self._images = {name: [change(image) for image in grey] for name, change in _CHANGES.items()}
        self._markers: dict[tuple[str, str], list[Markers]] = {}

    def markers(self, change: str, dictionary: str) -> list[Markers]:
        """Return a dictionary's markers in each image."""
        if (change, dictionary) not in self._markers:
            markers = [find_markers(image, dictionary) for image in self._images[change]]
            self._markers[change, dictionary] = markers
        return self._markers[change, dictionary]

    def views(self, change: str, board: Board) -> list[BoardView | None]:
        """Return a board's corners in each image."""
        pairs = zip(self._images[change], self.markers(change, board.dictionary), strict=True)
        return [find_board(image, board, markers=markers) for image, markers in pairs]

    def dictionaries(self, board: Board) -> Iterator[str]:
        """Yield other dictionaries whose markers the images show, most frequent first."""
        # Every second square holds a marker.
        needed = board.columns * board.rows // 2
        names = schemas.load("calibration_board")["properties"]["dictionary"]["enum"]
        names = [name for name in names if name != board.dictionary and int(name.split("_")[1]) >= needed]
        counts = {
            name: max(len(each.ids) for change in _CHANGES for each in self.markers(change, name)) for name in names
        }
        # The larger dictionaries of a size include the smaller ones: of equals the smallest is named.
        ranked = sorted(names, key=lambda name: (-counts[name], int(name.split("_")[1])))
        yield from (name for name in ranked if counts[name] >= LEAST_MARKERS)


def _usual(dictionaries: Iterable[str], board: Board) -> Iterator[tuple[str, Board]]:
    """Yield how images are changed, and boards with as many squares to try in them."""
    for dictionary in dictionaries:
        named = replace(board, dictionary=dictionary)
        for name in _CHANGES:
            for is_turned in (False, True):
                for is_legacy in (board.legacy, not board.legacy):
                    variant = replace(named, columns=board.rows, rows=board.columns) if is_turned else named
                    changed = replace(variant, legacy=is_legacy)
                    if changed != board or name:
                        yield name, changed


def _other_sizes(evidence: _Seen, board: Board) -> Iterator[tuple[str, Board]]:
    """Yield boards of other sizes that have as many markers as the images show."""
    # Markers are numbered over the board from 0, so the largest number gives their count, however many are hidden.
    markers = 1 + max(
        (int(each.ids.max()) for each in evidence.markers("", board.dictionary) if len(each.ids)), default=-1
    )
    if markers < LEAST_MARKERS:
        return
    for columns in range(_FEWEST, 2 * markers // _FEWEST + 1):
        for rows in range(_FEWEST, 2 * markers // _FEWEST + 1):
            # The first square is black or white by the drawing, so an odd board has half a marker more or less.
            if columns * rows // 2 == markers or (columns * rows + 1) // 2 == markers:
                for is_legacy in (board.legacy, not board.legacy):
                    yield "", replace(board, columns=columns, rows=rows, legacy=is_legacy)


def _in_words(board: Board, changed: Board, change: str) -> Mismatch:
    causes, remedy = [], []
    if change == MIRRORED:
        causes.append("the images are mirrored")
        remedy.append("switch the camera's mirroring off")
    if change == NEGATIVE:
        causes.append("black and white are changed over")
        remedy.append("print the board black on white, or switch the camera's negative off")
    if changed.legacy != board.legacy:
        causes.append(f"the pattern begins as OpenCV drew it {'before' if changed.legacy else 'from'} 4.6")
        remedy.append(f"legacy: {'true' if changed.legacy else 'false'}")
    if (changed.columns, changed.rows) != (board.columns, board.rows):
        causes.append(f"{changed.columns} squares across and {changed.rows} down")
        remedy.append(f"columns: {changed.columns} and rows: {changed.rows}")
    if changed.dictionary != board.dictionary:
        causes.append(f"markers of the dictionary {changed.dictionary}")
        remedy.append(f"dictionary: {changed.dictionary}")
    settings = [text for text in remedy if ":" in text]
    steps = [text for text in remedy if ":" not in text]
    words = steps + ([f"write {', '.join(settings)} in the board file"] if settings else [])
    return Mismatch(", ".join(causes), ", and ".join(words))
