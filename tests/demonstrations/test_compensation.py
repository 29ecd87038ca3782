"""Compensation as the paper prints it, its gains, and the search for the smallest one."""

import numpy as np
import pytest
import yaml

from tacdata.demonstrations.compensation import compensate, contact_depth, read_gains
from tacdata.errors import FormatError, UsageError


def test_the_depth_is_the_mean_of_the_ten_largest():
    maps = np.zeros((2, 35, 26))
    maps[0].reshape(-1)[:20] = np.arange(20)
    assert contact_depth(maps).tolist() == [14.5, 0.0]
    maps[1, 0, 0] = np.nan
    assert np.isnan(contact_depth(maps)[1])
    with pytest.raises(FormatError, match="pixels"):
        contact_depth(np.zeros((1, 3, 3)))


def test_a_millimetre_of_depth_moves_by_the_gain_along_the_normal():
    position, normal = np.zeros((3, 3)), np.tile([0.0, 0.6, 0.8], (3, 1))
    moved = compensate(position, normal, np.array([0.0, 2.0, np.nan]), 0.005)
    assert np.allclose(moved, [[0, 0, 0], [0, 0.006, 0.008], [0, 0, 0]])


@pytest.mark.parametrize("gain", [-0.001, np.nan, np.inf])
def test_impossible_gains_are_refused(gain):
    with pytest.raises(UsageError, match="gain"):
        compensate(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.zeros(1), gain)


def test_normals_must_be_of_length_one():
    with pytest.raises(UsageError, match="length"):
        compensate(np.zeros((1, 3)), np.array([[0.0, 0.0, 2.0]]), np.zeros(1), 0.005)


def test_the_papers_gains_are_in_its_order():
    gains = read_gains()
    assert list(gains.of("grasp").values()) == [0.005, 0.005, 0.005]
    assert gains.of("wipe") == {"thumb": 0.004, "index": 0.010, "middle": 0.010}
    with pytest.raises(UsageError, match="grasp, wipe"):
        gains.of("pour")


def test_a_gains_file_is_checked(tmp_path):
    path = tmp_path / "gains.yaml"
    document = {"version": "1.0", "unit": "m/mm", "fingers": ["thumb", "index"], "tasks": {"turn": [0.001]}}
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(FormatError, match="1 gains"):
        read_gains(path)
    path.write_text(yaml.safe_dump({**document, "unit": "mm/mm"}))
    with pytest.raises(FormatError, match="unit"):
        read_gains(path)
    path.write_text(yaml.safe_dump({**document, "tasks": {"turn": [0.001, -0.1]}}))
    with pytest.raises(FormatError, match="tasks/turn/1"):
        read_gains(path)
    path.write_text(yaml.safe_dump({**document, "tasks": {"turn": [0.001, 5.0]}}))
    with pytest.raises(FormatError, match="5000 mm a millimetre"):
        read_gains(path)
    path.write_text(yaml.safe_dump({**document, "tasks": {"turn": [0.0, 5e-6]}}))
    with pytest.raises(FormatError, match=r"0\.005 mm a mm felt"):
        read_gains(path)
    path.write_text(yaml.safe_dump({**document, "fingers": ["thumb", "thumb"], "tasks": {"turn": [0.001, 0.01]}}))
    with pytest.raises(FormatError, match="non-unique"):
        read_gains(path)
