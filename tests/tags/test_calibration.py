"""Intrinsics from drawn boards, where the camera is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_images import BOARD, TRUTH, images
from scipy.optimize import least_squares

from tacdata.errors import FormatError, UsageError
from tacdata.tags.board import Board, draw_board, printable
from tacdata.tags.calibration.board_view import BoardView, find_board
from tacdata.tags.calibration.intrinsics import calibrate, coverage_of
from tacdata.tags.calibration.picture import draw_calibration

SIZE = (640, 480)


@pytest.fixture(scope="module")
def views():
    found = [find_board(image, BOARD, f"{k:02}") for k, image in enumerate(images(14))]
    return [view for view in found if view is not None]


@pytest.fixture(scope="module")
def found(views):
    return calibrate(views, BOARD, SIZE)


def gap(calibration, truth):
    """Largest distance [px] of where two cameras put what is seen, anywhere in the image, however they are turned."""
    matrix = np.array([[truth["fx"], 0, truth["cx"]], [0, truth["fy"], truth["cy"]], [0, 0, 1]])
    grid = np.stack(np.meshgrid(np.linspace(0, 639, 13), np.linspace(0, 479, 9)), axis=-1).reshape(-1, 1, 2)
    until = (cv2.TERM_CRITERIA_COUNT, 100, 0)
    bent = np.array(truth["distortion"])
    flat = cv2.undistortPointsIter(grid, matrix, bent, np.eye(3), np.eye(3), until)[:, 0]
    rays = np.column_stack([flat, np.ones(len(flat))])

    def off(turn):
        seen = cv2.projectPoints(rays, turn, np.zeros(3), calibration.matrix, calibration.distortion)[0]
        return (seen - grid).ravel()

    left = least_squares(off, np.zeros(3)).fun.reshape(-1, 2)
    return float(np.linalg.norm(left, axis=1).max())


def test_the_camera_is_found_again(found):
    truth = np.array([TRUTH[name] for name in ("fx", "fy", "cx", "cy")])
    estimate = found.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert np.abs(estimate / truth - 1)[:2].max() < 0.002
    assert (np.abs(estimate - truth) < 4 * found.spread).all(), "the spread that is stated holds"
    assert gap(found, TRUTH) < 0.5
    assert found.rms < 0.15 and found.held_out_rms < 0.2
    assert found.model == "k1k2p1p2", "no coefficient that the images do not ask for"
    assert found.intrinsics["width"] == 640 and len(found.intrinsics["distortion"]) == 4


def test_without_distortion_the_lens_is_another_one(found):
    assert gap(replace(found, distortion=np.zeros(4)), TRUTH) > 5.0, "the measure tells lenses apart"


def test_a_view_that_does_not_fit_is_dropped_in_words(views):
    random = np.random.default_rng(1)
    bad = replace(views[3], corners=views[3].corners + random.normal(0, 3, views[3].corners.shape))
    result = calibrate([*views[:3], bad, *views[4:]], BOARD, SIZE, "k1k2p1p2")
    dropped = [used for used in result.views if used.reason]
    assert [used.view.name for used in dropped] == [bad.name]
    assert "px" in dropped[0].reason
    assert gap(result, TRUTH) < 0.7


def test_single_corners_in_wrong_places_are_left_out(views):
    corners = views[3].corners.copy()
    corners[2] += (9.0, -6.0)
    result = calibrate([*views[:3], replace(views[3], corners=corners), *views[4:]], BOARD, SIZE, "k1k2p1p2")
    assert not any(used.reason for used in result.views)
    assert any("corners left out" in remark for remark in result.remarks)
    assert gap(result, TRUTH) < 0.5


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("few", "7 views"),
        ("one corner", "of the image"),
        ("never tilted", "tilted by at most"),
        ("other board", "check columns"),
    ],
)
def test_views_that_tell_too_little_are_refused(views, kind, words):
    board = BOARD
    if kind == "few":
        views = views[:7]
    elif kind == "one corner":
        views = [BoardView(v.name, v.ids, v.corners / 4) for v in views]
    elif kind == "never tilted":
        square = np.random.default_rng(2)
        points = BOARD.corners[:, :2] * 605 / 400
        views = [
            BoardView(f"{k}", np.arange(len(points)), points + place + square.normal(0, 0.1, points.shape))
            for k, place in enumerate((x, y) for x in (5, 160, 330) for y in (5, 130, 270))
        ]
    else:
        board = Board(6, 9, 25.0, 18.0, "4X4_50")
    with pytest.raises(FormatError, match=words):
        calibrate(views, board, SIZE, "k1k2p1p2")


def test_coverage_counts_cells():
    corners = np.array([[x, y] for x in range(0, 320, 10) for y in range(0, 480, 10)], float)
    assert coverage_of([BoardView("half", np.arange(len(corners)), corners)], SIZE) == 0.5


def test_the_picture_shows_every_view(found):
    picture = draw_calibration(found)
    assert picture.dtype == np.uint8 and picture.shape[1] > 1000
    assert (picture.min(axis=2) < 128).mean() > 0.01


def test_a_printed_board_is_read_back_at_its_size():
    board = printable(BOARD, 150)
    sheet = draw_board(board, "a4", 150)
    assert sheet.shape == (1240, 1754)
    view = find_board(sheet, board)
    assert view is not None and len(view.ids) == 8 * 5
    across = view.corners[np.argsort(view.ids)].reshape(5, 8, 2)
    step = np.diff(across, axis=1)[..., 0]
    assert np.abs(step * 25.4 / 150 - board.square).max() < 0.02
    assert abs(board.square - 25.0) < 0.09, "a whole number of dots"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"marker": 24.0}, "30 to 90 %"),
        ({"columns": 20, "rows": 20}, "200 markers"),
        ({"dictionary": "4X4_51"}, "dictionary"),
        ({"square": 0.0}, "square"),
        ({"rows": 2}, "rows"),
    ],
)
def test_impossible_boards_are_refused(change, words):
    with pytest.raises(FormatError, match=words):
        Board.from_document({**BOARD.document, **change})


def test_a_board_larger_than_the_paper_is_refused():
    with pytest.raises(UsageError, match="at most"):
        draw_board(Board(12, 9, 25.0, 18.0, "5X5_100"))
    with pytest.raises(UsageError, match="a4"):
        draw_board(BOARD, "a0")
