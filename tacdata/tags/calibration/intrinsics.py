"""Estimates a camera's intrinsics from views of a ChArUco board (Zhang, IEEE PAMI 22, 2000, by OpenCV).

Outlier views are dropped and named. Views that do not determine the camera are refused: too few, a board that was never
tilted (focal length and distance are then not identifiable), or corners in a small part of the image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.tags.board import Board
from tacdata.tags.calibration.board_view import BoardView

LEAST_VIEWS = 8
"""Minimum number of views [count]; 15 to 30 are usual."""
LEAST_TILT, LEAST_COVERAGE = 20.0, 0.4
"""Minimum angle between two views' boards [deg], and minimum share of the image's cells with a corner [1]."""
GOOD_COVERAGE = 0.7
"""Coverage [1] below which a remark is made."""
UNSURE, REFUSED = 0.003, 0.02
"""Relative standard deviation of the focal length [1] from which a remark is made, and from which it is refused."""
OUTLIER, LEAST_OUTLIER = 2.5, 0.3
"""A view is an outlier at this ratio of its reprojection error to the median [1], and at least at this error [px]."""
MOST_DROPPED = 1 / 3
"""Largest share of views [1] that may be dropped as outliers."""
STRAY, LEAST_STRAY, MOST_STRAYS = 8.0, 0.5, 0.15
"""A corner is an outlier at this many medians [1] and at least this distance [px]; at most this share of a view's
corners [1].
"""
BAD = 1.5
"""Reprojection error [px] from which the board file does not describe the board."""
BETTER = 0.97
"""Ratio of held-out reprojection errors [1] below which a model with more coefficients is preferred."""
CELLS, IN_CELL = (8, 6), 3
"""Cells of the image across and down, for the coverage, and corners that make a cell covered."""
MODELS = ("k1k2p1p2", "k1k2p1p2k3", "rational")


@dataclass(frozen=True, eq=False)
class UsedView:
    """A view and its residuals."""

    view: BoardView
    rms: float = np.nan
    """Reprojection error [px], root mean square."""
    residuals: np.ndarray | None = None
    """Corner minus projection [px], shape (n, 2)."""
    reason: str = ""
    """Why it was dropped; empty if it was used."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Estimated intrinsics and their uncertainty."""

    size: tuple[int, int]
    """Width and height [px]."""
    model: str
    """One of `MODELS`."""
    matrix: np.ndarray
    """Camera matrix [px], shape (3, 3)."""
    distortion: np.ndarray
    """k1 k2 p1 p2 [k3 [k4 k5 k6]] [1], shape (4,), (5,) or (8,)."""
    spread: np.ndarray
    """Standard deviations of fx, fy, cx, cy [px], shape (4,)."""
    rms: float
    """Reprojection error [px], root mean square."""
    held_out_rms: float
    """The same on views that were held out of an estimate from the other half [px]."""
    coverage: float
    """Share of the image's cells with corners [1]."""
    tilt: float
    """Largest angle between the board's normals in two views [deg]."""
    views: tuple[UsedView, ...]
    remarks: tuple[str, ...] = ()
    """Remarks for a person, as sentences."""

    @property
    def intrinsics(self) -> dict[str, Any]:
        """The intrinsics as in a rig file."""
        (fx, _, cx), (_, fy, cy), _ = self.matrix.tolist()
        width, height = self.size
        plain = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
        return {
            "width": width,
            "height": height,
            **{key: round(value, 4) for key, value in plain.items()},
            "distortion": [round(value, 7) for value in self.distortion.tolist()],
        }

    def document(self, board: Board, source: str, code_version: str, date: str) -> dict[str, Any]:
        """Return the calibration's file (`schemas/camera_calibration.schema.json`)."""
        return {
            "version": "1.0",
            "date": date,
            "code_version": code_version,
            "source": source,
            "model": self.model,
            "intrinsics": self.intrinsics,
            "uncertainty": dict(zip(("fx", "fy", "cx", "cy"), self.spread.round(4).tolist(), strict=True)),
            "rms": round(self.rms, 4),
            "held_out_rms": round(self.held_out_rms, 4),
            "coverage": round(self.coverage, 3),
            "tilt": round(self.tilt, 1),
            "board": board.document,
            "views": [_record(used) for used in self.views],
            "remarks": list(self.remarks),
        }


def calibrate(views: list[BoardView], board: Board, size: tuple[int, int], model: str = "auto") -> Calibration:
    """Estimate a camera's intrinsics.

    Args:
        views: Views of the board.
        board: The board.
        size: Width and height of all images [px].
        model: One of `MODELS`, or "auto": the smallest that predicts held-out views about as well as any.

    Raises:
        FormatError: If the views do not determine the camera, with the missing views.
    """
    _check_count(views, "")
    share = coverage_of(views, size)
    if share < LEAST_COVERAGE:
        raise FormatError(
            f"corners in {share:.0%} of the image",
            f"{LEAST_COVERAGE:.0%} or more, corners and edges of the image too",
            "take views with the board in every part of the image, and larger in it",
        )
    first = MODELS[0] if model == "auto" else model
    # With the simplest lens first: a richer one bends itself to single wrong corners.
    views, left_out = _without_strays(views, _fit(views, board, size, first))
    members, dropped = _fitting(views, board, size, first, len(views))
    # Chosen on the views that fit, by views held out: more coefficients always fit better those that they are fitted
    # to.
    choice = _choose_model(members, board, size) if model == "auto" else model
    members, more = _fitting(members, board, size, choice, len(views) - len(dropped))
    fit, held_out = _fit(members, board, size, choice), _held_out(members, board, size, choice)
    calibration = _judged(fit, members, [*dropped, *more], size, choice, held_out)
    return replace(calibration, remarks=(*calibration.remarks, *left_out))


def _without_strays(views: list[BoardView], fit: _Fit) -> tuple[list[BoardView], list[str]]:
    """Return the views without outlier corners, and a remark on how many those were."""
    deviation = [np.linalg.norm(each, axis=1) for each in fit.residuals]
    limit = max(STRAY * float(np.median(np.concatenate(deviation))), LEAST_STRAY)
    members, count = [], 0
    for view, far in zip(views, deviation, strict=True):
        good = far <= limit
        # Many outliers in one view are evidence against the view, which is judged as a whole later.
        is_minority = (~good).sum() <= MOST_STRAYS * len(good)
        count += int((~good).sum()) if is_minority else 0
        members.append(replace(view, ids=view.ids[good], corners=view.corners[good]) if is_minority else view)
    total = sum(len(each) for each in deviation)
    return members, [f"{count} of {total} corners left out, found more than {limit:.1f} px away"] if count else []


def _fitting(
    views: list[BoardView], board: Board, size: tuple[int, int], model: str, count: int
) -> tuple[list[BoardView], list[UsedView]]:
    """Return the views that fit one camera, and those dropped, worst first: at most `MOST_DROPPED` of ``count``."""
    members, dropped = list(views), []
    while True:
        rms = _fit(members, board, size, model).rms
        # Most views are wrong together: dropping single ones cannot help.
        if np.median(rms) > BAD:
            raise FormatError(
                f"the corners' reprojection error is {np.median(rms):.1f} px",
                f"less than {BAD:g} px; a good calibration has 0.1 to 0.4 px",
                "check columns, rows and legacy in the board file, and that the board is flat",
            )
        # One at a time: a wrong view pulls the fit, which makes the errors of good views larger.
        worst = int(np.argmax(rms))
        if rms[worst] <= max(OUTLIER * float(np.median(rms)), LEAST_OUTLIER):
            return members, dropped
        reason = f"its corners' reprojection error is {rms[worst]:.2f} px, that of the others {np.median(rms):.2f} px"
        dropped.append(UsedView(members.pop(worst), float(rms[worst]), None, reason))
        if len(dropped) > MOST_DROPPED * count:
            raise FormatError(
                f"more than {MOST_DROPPED:.0%} of {count} views do not fit one camera",
                "views with one focus and zoom of one flat board",
                "fix focus and zoom, glue the board to something flat, hold it still",
            )
        _check_count(members, f", {len(dropped)} dropped that do not fit")


def coverage_of(views: list[BoardView], size: tuple[int, int]) -> float:
    """Return the share of an image's cells [1] that hold `IN_CELL` corners or more."""
    pixels = np.concatenate([view.corners for view in views])
    cells = np.floor(pixels / size * CELLS).astype(int)
    inside = ((cells >= 0) & (cells < CELLS)).all(axis=1)
    _, counts = np.unique(cells[inside], axis=0, return_counts=True)
    return float((counts >= IN_CELL).sum()) / (CELLS[0] * CELLS[1])


@dataclass(frozen=True, eq=False)
class _Fit:
    matrix: np.ndarray
    distortion: np.ndarray
    spread: np.ndarray
    normals: np.ndarray
    rms: np.ndarray
    residuals: list[np.ndarray]
    total: float


def _check_count(views: list[BoardView], what: str) -> None:
    if len(views) < LEAST_VIEWS:
        raise FormatError(
            f"{len(views)} views of the board{what}",
            f"{LEAST_VIEWS} or more; 15 to 30 are usual",
            "take more images of the whole board, sharp, from different sides",
        )


def _judged(
    fit: _Fit, members: list[BoardView], dropped: list[UsedView], size: tuple[int, int], model: str, held_out: float
) -> Calibration:
    """Return the calibration, or refuse it."""
    # The largest angle between two boards.
    tilt = float(np.degrees(np.arccos(np.clip((fit.normals @ fit.normals.T).min(), -1, 1))))
    share = coverage_of(members, size)
    unsure = float((fit.spread[:2] / np.diag(fit.matrix)[:2]).max())
    if tilt < LEAST_TILT or unsure > REFUSED:
        raise FormatError(
            f"boards tilted by at most {tilt:.0f} deg against each other, focal length uncertain by {unsure:.1%}",
            f"{LEAST_TILT:g} deg or more, {REFUSED:.0%} or better: from the front alone, distance and focal length "
            "cannot be told apart",
            "tilt the board by 30 to 45 degrees to all four sides",
        )
    remarks = []
    if share < GOOD_COVERAGE:
        remarks.append(f"corners in {share:.0%} of the image only: towards the empty parts distortion is a guess")
    if unsure > UNSURE:
        remarks.append(f"focal length uncertain by {unsure:.2%}, and so are distances of tags")
    used = [
        UsedView(view, float(rms), residuals)
        for view, rms, residuals in zip(members, fit.rms, fit.residuals, strict=True)
    ]
    views = tuple(sorted([*used, *dropped], key=lambda each: each.view.name))
    return Calibration(
        size, model, fit.matrix, fit.distortion, fit.spread, fit.total, held_out, share, tilt, views, tuple(remarks)
    )


def _choose_model(views: list[BoardView], board: Board, size: tuple[int, int]) -> str:
    scores = {model: _held_out(views, board, size, model) for model in MODELS}
    choice = MODELS[0]
    for model in MODELS[1:]:
        if scores[model] < BETTER * scores[choice]:
            choice = model
    return choice


def _held_out(views: list[BoardView], board: Board, size: tuple[int, int], model: str) -> float:
    """Return the reprojection error [px] of each half of the views with the intrinsics of the other half."""
    import cv2

    squares: list[np.ndarray] = []
    for part in (0, 1):
        # Every other view, so that both halves cover all attitudes of the board.
        fit = _fit(views[part::2], board, size, model)
        for view in views[1 - part :: 2]:
            points = board.corners[view.ids]
            good, turn, place = cv2.solvePnP(points, view.corners, fit.matrix, fit.distortion)
            if good:
                projection = cv2.projectPoints(points, turn, place, fit.matrix, fit.distortion)[0][:, 0]
                squares.append(np.square(projection - view.corners).sum(axis=1))
    return float(np.sqrt(np.concatenate(squares).mean())) if squares else np.inf


def _fit(views: list[BoardView], board: Board, size: tuple[int, int], model: str) -> _Fit:
    import cv2

    flags = {MODELS[0]: cv2.CALIB_FIX_K3, MODELS[1]: 0, MODELS[2]: cv2.CALIB_RATIONAL_MODEL}[model]
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-8)
    corners = board.corners.astype(np.float32)
    points = [corners[view.ids] for view in views]
    pixels = [view.corners.astype(np.float32) for view in views]
    try:
        total, matrix, bent, turns, places, spread, _, _ = cv2.calibrateCameraExtended(
            points, pixels, size, np.eye(3), np.zeros(5), flags=flags, criteria=until
        )
    except cv2.error as error:
        raise FormatError(
            "these views determine no camera", "the board in several attitudes", f"take other views ({error.err})"
        ) from None
    # OpenCV also returns the coefficients that it kept at 0.
    bent = bent.ravel()[: {MODELS[0]: 4, MODELS[1]: 5, MODELS[2]: 8}[model]]
    residuals = []
    for point, pixel, turn, place in zip(points, pixels, turns, places, strict=True):
        residuals.append(pixel - cv2.projectPoints(point, turn, place, matrix, bent)[0][:, 0])
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    rms = np.array([np.sqrt(np.square(each).sum(axis=1).mean()) for each in residuals])
    return _Fit(matrix, bent, spread.ravel()[:4], normals, rms, residuals, float(total))


def _record(used: UsedView) -> dict[str, Any]:
    record: dict[str, Any] = {"name": used.view.name, "corners": len(used.view.ids), "used": not used.reason}
    if np.isfinite(used.rms):
        record["rms"] = round(used.rms, 4)
    return {**record, "reason": used.reason} if used.reason else record
