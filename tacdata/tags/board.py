"""A ChArUco board: a chessboard with markers, for camera calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath

PAPER = {"a4": (297.0, 210.0), "a3": (420.0, 297.0), "letter": (279.4, 215.9)}
"""Width and height of a sheet in landscape [mm]."""
DPI = 600
"""Dots per inch of a drawn board; the edges of its squares are off by at most half a dot, 0.02 mm."""


@dataclass(frozen=True)
class Board:
    """Squares and markers as printed. Its corners lie between the squares, row by row."""

    columns: int
    """Squares across [count]."""
    rows: int
    """Squares down [count]."""
    square: float
    """Side of a square [mm]."""
    marker: float
    """Side of a marker [mm]."""
    dictionary: str
    """OpenCV's name of the markers' dictionary without "DICT_"."""
    legacy: bool = False
    """Whether the pattern begins as OpenCV before 4.6 drew it."""

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str = "board") -> Board:
        """Build a board from a parsed file (`schemas/calibration_board.schema.json`).

        Raises:
            FormatError: If it breaks the schema, markers do not fit their squares or there are too few of them.
        """
        documents.check(document, "calibration_board", origin)
        board = cls(**{key: value for key, value in document.items() if key != "version"})
        # Smaller markers are not read from a distance; larger ones touch the squares' corners, whose places are needed.
        if not 0.3 * board.square < board.marker < 0.9 * board.square:
            fault = f"{origin}: a marker of {board.marker:g} mm in a square of {board.square:g} mm"
            raise FormatError(fault, "30 to 90 % of the square", "measure both on the print")
        needed, available = board.columns * board.rows // 2, int(board.dictionary.split("_")[1])
        if needed > available:
            raise FormatError(
                f"{origin}: {board.columns} x {board.rows} squares need {needed} markers",
                f"{available}, which dictionary {board.dictionary} has",
                "fewer squares or a larger dictionary",
            )
        return board

    @property
    def document(self) -> dict[str, Any]:
        """The board as in its file."""
        plain = {key: getattr(self, key) for key in ("columns", "rows", "square", "marker", "dictionary")}
        return {"version": "1.0", **plain, **({"legacy": True} if self.legacy else {})}

    @property
    def corners(self) -> np.ndarray:
        """Corners between the squares in the board's plane [mm], shape ((columns - 1) (rows - 1), 3)."""
        return np.array(self.opencv.getChessboardCorners(), float)

    @property
    def opencv(self) -> Any:
        """The board as OpenCV's `CharucoBoard`."""
        import cv2

        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, markers)
        board.setLegacyPattern(self.legacy)
        return board


def read_board(path: StrPath) -> Board:
    """Read a board's file.

    Raises:
        UsageError: If it does not exist.
        FormatError: As `Board.from_document`.
    """
    return Board.from_document(documents.read(Path(path), "calibration_board"), str(path))


def draw_squares(board: Board, side: int) -> np.ndarray:
    """Return the board alone with ``side`` dots per square, uint8 0 or 255, shape (rows side, columns side)."""
    import cv2

    marker = round(board.marker / board.square * side)
    image = np.zeros((board.rows * side, board.columns * side), np.uint8)
    opencv = board.opencv
    for number, corners in zip(opencv.getIds().ravel().tolist(), opencv.getObjPoints(), strict=True):
        # Whole dots: rounding must not differ between squares.
        column, row = np.floor(np.array(corners)[:, :2].mean(axis=0) / board.square).astype(int).tolist()
        square = image[row * side : (row + 1) * side, column * side : (column + 1) * side]
        square[:] = 255
        rim = (side - marker) // 2
        square[rim : rim + marker, rim : rim + marker] = cv2.aruco.generateImageMarker(
            opencv.getDictionary(), number, marker
        )
    return image


def printable(board: Board, dpi: int = DPI) -> Board:
    """Return the nearest board whose squares are whole dots, as `draw_board` draws it."""
    dot = 25.4 / dpi
    side = round(board.square / dot)
    marker = round(board.marker / board.square * side)
    return replace(board, square=round(side * dot, 4), marker=round(marker * dot, 4))


def draw_board(board: Board, paper: str = "a4", dpi: int = DPI) -> np.ndarray:
    """Return a sheet to print at 100 %: board, ruler and instructions, uint8, shape (height, width).

    Raises:
        UsageError: If the board does not fit the paper.
    """
    import cv2

    if paper not in PAPER:
        raise UsageError(f"paper {paper!r}", ", ".join(PAPER), "choose one of them")
    width, height = PAPER[paper]
    breadth, rise = board.columns * board.square, board.rows * board.square
    # Margins, and below the board the ruler and the instructions.
    if breadth > width - 16 or rise > height - 34:
        raise UsageError(
            f"a board of {breadth:g} x {rise:g} mm",
            f"at most {width - 16:g} x {height - 34:g} mm on {paper}",
            "smaller or fewer squares, or larger paper",
        )
    dot = 25.4 / dpi
    sheet = np.full((round(height / dot), round(width / dot)), 255, np.uint8)
    left, top = round((width - breadth) / 2 / dot), round(8 / dot)
    drawn = draw_squares(board, round(board.square / dot))
    sheet[top : top + drawn.shape[0], left : left + drawn.shape[1]] = drawn
    base = top + drawn.shape[0] + round(8 / dot)
    cv2.rectangle(sheet, (left, base), (left + round(100 / dot) - 1, base + round(3 / dot)), 0, -1)
    lines = (
        f"{board.columns} x {board.rows} squares, {board.dictionary}. The bar is 100 mm long: print at 100 %,",
        f"glue the sheet to something flat, measure squares ({board.square:.2f} mm) and correct the board file.",
    )
    for k, line in enumerate(lines):
        place = (left, base + round((9 + 5 * k) / dot))
        font, size, thick = cv2.FONT_HERSHEY_SIMPLEX, 0.11 / dot, max(1, round(0.25 / dot))
        cv2.putText(sheet, line, place, font, size, 0, thick, cv2.LINE_AA)
    return sheet
