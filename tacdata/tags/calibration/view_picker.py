"""Picks images of a board for calibration: still ones, each different from those kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.tags.board import Board
from tacdata.tags.calibration.board_mismatch import mismatch
from tacdata.tags.calibration.board_view import BoardView, find_board
from tacdata.tags.calibration.image_file import ENDINGS, read_grey

STILL = 1.0
"""Movement between two consecutive images [px per 1000 px of width] above which they are blurred."""
NEW = 40.0
"""Movement against every view kept [px per 1000 px of width] from which an image is new."""
LOOKED_AT_AGAIN = 5
"""Images without the board that are kept to find out why [1]."""


class ViewPicker:
    """Takes images one after the other; `views` holds those that were kept."""

    def __init__(self, board: Board, still: bool = True) -> None:
        """Keep the board; ``still``: consecutive images belong to one film."""
        self.board, self.still = board, still
        self.views: list[BoardView] = []
        self.size: tuple[int, int] | None = None
        """Width and height of the images [px]."""
        self.seen = 0
        """Images taken."""
        self.with_board = 0
        """Images that show the board."""
        self._last: BoardView | None = None
        self._without_board: list[np.ndarray] = []

    def take(self, image: np.ndarray, name: str) -> bool:
        """Examine an image, grey or BGR uint8; return whether it was kept.

        Raises:
            FormatError: If it has another size than those before.
        """
        size = (image.shape[1], image.shape[0])
        if self.size not in (None, size):
            raise FormatError(
                f"{name}: {size[0]} x {size[1]} pixels, those before {self.size[0]} x {self.size[1]}",
                "images of one size",
                "remove it, or calibrate each size by itself",
            )
        self.size, self.seen = size, self.seen + 1
        view = find_board(image, self.board, name)
        previous, self._last = self._last, view
        if view is None:
            if len(self._without_board) < LOOKED_AT_AGAIN:
                self._without_board.append(image.copy())
            return False
        self.with_board += 1
        if self.still:
            # Thresholds are shares of the width, so that they hold for any resolution.
            unit = size[0] / 1000
            # A board in motion is blurred, and a rolling shutter shears it.
            if previous is None or view.moved(previous) > STILL * unit:
                return False
            if any(view.moved(member) < NEW * unit for member in self.views):
                return False
        self.views.append(view)
        return True

    def check_board(self, least: int = 0) -> str:
        """Look for the reason why images show no board; return it as a remark where others show enough.

        Args:
            least: Images with the board that are needed [count].

        Raises:
            FormatError: If the reason holds for most images, or if too few are left.
        """
        if not self._without_board or (change := mismatch(self._without_board, self.board)) is None:
            return ""
        fault = f"the board in {self.with_board} of {self.seen} images; in the others {change.found}"
        if 2 * self.with_board < self.seen or len(self.views) < least:
            raise FormatError(fault, "the board that the board file describes", change.remedy)
        return f"{fault}: {change.remedy}"


def images_of(source: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and image, grey uint8, of a folder's images or a video's.

    Raises:
        UsageError: If there is no such file or folder, or no image in it.
        FormatError: If a file is damaged.
    """
    import cv2

    if source.is_dir():
        paths = sorted(path for path in source.iterdir() if path.suffix.lower() in ENDINGS)
        if not paths:
            raise UsageError(f"{source} holds no image", f"files ending in {', '.join(ENDINGS)}", "check the path")
        for path in paths:
            yield path.name, read_grey(path)
        return
    if not source.is_file():
        raise UsageError(f"no file or folder {source}", "a folder of images or a video", "check the path")
    # OpenCV's own messages name neither the file nor a remedy.
    quiet = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    film = cv2.VideoCapture(str(source))
    # Images that are turned for display would be those of another camera.
    film.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    cv2.utils.logging.setLogLevel(quiet)
    number, good = 0, film.isOpened()
    while good:
        good, image = film.read()
        if good:
            yield f"{source.name} image {number}", cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
            number += 1
    film.release()
    if not number:
        raise FormatError(f"{source} is no video that can be read", "a video file", "convert it, or take images")
