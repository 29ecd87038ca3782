"""Drawn views of a board, for the tests of calibration."""

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.tags.board import Board, draw_squares
from tacdata.virtual_rig.optics.sheet import render_sheet, whole_lens

BOARD = Board(9, 6, 25.0, 18.0, "4X4_50")
TRUTH = {
    "width": 640,
    "height": 480,
    "fx": 605.0,
    "fy": 602.0,
    "cx": 325.5,
    "cy": 236.0,
    "distortion": [-0.25, 0.08, 0.001, -0.0007, 0.0],
}


def images(count, tilt=40.0, spread=1.0, seed=0, truth=TRUTH):
    """Images of the board at random places, tilted by up to ``tilt`` [deg] about both axes."""
    random, lens = np.random.default_rng(seed), whole_lens(truth)
    cells = draw_squares(BOARD, 40)
    sheet = np.pad(cells, 40, constant_values=255)
    width, height = (BOARD.columns + 2) * 0.025, (BOARD.rows + 2) * 0.025
    for _ in range(count):
        angles = random.uniform(-20, 20), random.uniform(-tilt, tilt), random.uniform(-tilt, tilt)
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("zxy", angles, degrees=True).as_matrix()
        reach = 0.5 * spread * np.array([truth["width"] / truth["fx"], truth["height"] / truth["fy"]])
        centre = random.uniform(0.3, 0.6) * np.append(random.uniform(-reach, reach), 1.0)
        pose[:3, 3] = centre - pose[:3, :3] @ (width / 2, height / 2, 0)
        yield render_sheet(sheet, width, pose, truth, random, lens=lens)
