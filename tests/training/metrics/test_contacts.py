"""Contacts in one map: hills that stand out, matched one to one; near ones are told apart."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata import documents
from tacdata.training.metrics.contacts import LONG, PROMINENCE, centroids, elongation, hills, match, predicted_centroids
from tacdata.training.reports.score_sheet import markdown
from tacdata.training.scoring.contact_scores import contact_rows

PITCH = 0.4


def bumps(*places, depth=0.8, shape=(35, 26)):
    """Paraboloids with lowest points at (i, j) [px]."""
    i, j = np.mgrid[: shape[0], : shape[1]]
    each = [depth - 0.02 * ((i - a) ** 2 + (j - b) ** 2) for a, b in places]
    return np.max([*each, np.zeros(shape)], axis=0)


def test_two_hills_in_one_region_are_two_contacts():
    depth = bumps((12, 13), (22, 13))
    assert (depth[12:23, 13] > 0.1).all(), "one region above the threshold"
    owner = hills(depth)
    assert set(np.unique(owner)) == {-1, 0, 1}
    assert owner[12, 13] != owner[22, 13] and (owner >= 0).sum() == (depth > 0.1).sum()
    assert np.sort(centroids(depth)[:, 0]) == pytest.approx([12, 22], abs=0.6)


def test_a_shoulder_is_no_contact():
    depth = np.zeros((35, 26))
    depth[5:25, 10:15] = 0.6
    depth[15, 12] = 0.6 * (1 - PROMINENCE) - 0.01
    depth[16:25, 10:15] -= 0.5 * PROMINENCE * 0.6
    assert hills(depth).max() == 0
    depth[15, 10:15] = 0.6 * (1 - 2.5 * PROMINENCE)
    assert hills(depth).max() == 1, "a pass deep enough parts them"


def test_noise_makes_no_contacts():
    noise = np.random.default_rng(0).normal(0, 0.005, (35, 26))
    assert len(centroids(bumps((16, 12), depth=0.5) + noise)) == 1
    assert len(centroids(np.zeros((35, 26)) + noise)) == 0


def test_two_discs_a_radius_apart_are_as_long_as_a_long_region_must_be():
    i, j = np.mgrid[:80, :60]
    first, second = (np.hypot(i - 30 - shift, j - 30) < 16 for shift in (0, 16))
    weight = (first.astype(float) + second) * 0.5
    assert elongation(weight, weight > 0) == pytest.approx(np.sqrt(2), abs=0.02)
    assert elongation(weight, weight > 0) > LONG
    assert elongation(np.ones_like(weight), first) == pytest.approx(1.0, abs=0.01), "one disc is round"


def test_a_shallow_pass_parts_a_long_prediction_and_not_a_round_one():
    i, j = np.mgrid[:35, :26]
    dent = 0.05 * np.exp(-((i - 17) ** 2) / 8)  # mm, across the middle: 8 % of the depth
    long = 0.6 * np.exp(-(((i - 17) / 8) ** 8) - ((j - 12) / 4) ** 4) - dent
    round_top = 0.6 * np.exp(-((np.hypot(i - 17, j - 12) / 9) ** 6)) - dent
    assert len(centroids(long)) == len(centroids(round_top)) == 1, "a label is no mean over what may be"
    assert len(predicted_centroids(long)) == 2
    assert len(predicted_centroids(round_top)) == 1
    flat = 0.6 * np.exp(-(((i - 17) / 8) ** 8) - ((j - 12) / 4) ** 4)
    assert len(predicted_centroids(flat)) == 1, "length alone makes no second contact"


def test_three_contacts_around_a_middle_stay_three():
    assert len(predicted_centroids(bumps((10, 8), (10, 18), (19, 13)))) == 3


def test_each_contact_is_matched_once():
    label = bumps((8, 8), (18, 18), (28, 8))
    found = match(bumps((9, 8), (18, 17)), label, PITCH)
    assert found.missed == 1 and found.invented == 0
    assert np.nansum(found.error) == pytest.approx(2.0, abs=0.1)
    assert found.apart == pytest.approx(np.hypot(10, 10), abs=0.3)
    reverse = match(label, bumps((9, 8), (18, 17)), PITCH)
    assert reverse.missed == 0 and reverse.invented == 1
    far = match(bumps((8, 20)), bumps((8, 8)), PITCH)
    assert far.missed == far.invented == 1, "4.8 mm away is another contact"
    nothing = match(np.zeros((35, 26)), bumps((8, 8)), PITCH)
    assert nothing.missed == 1 and nothing.invented == 0 and nothing.apart == np.inf


def test_rows_by_distance():
    one, near = match(bumps((9, 9)), bumps((9, 8)), PITCH), bumps((10, 13), (19, 13))
    rows = contact_rows([one, match(near, near, PITCH), match(bumps((10, 13)), near, PITCH)], PITCH)
    assert [row["contacts"] for row in rows] == ["one", "several"]
    assert rows[1]["above_mm"] == 3.0 and rows[1]["up_to_mm"] == 4.0
    assert rows[1]["all_found"]["count"] == 1 and rows[1]["missed"] == 1 and rows[1]["presses"] == 2
    assert rows[0]["centroid_error"]["median"] == pytest.approx(1.0, abs=0.05)


def test_scores_state_contacts(frames, trained_briefly):
    from tacdata.training.scoring.evaluate import evaluate

    document = evaluate(trained_briefly, frames, "cpu", threads=1).document
    documents.check(document, "scores", "scores")
    assert sum(row["presses"] for row in document["contacts"]["presses"]) > 0
    assert "Single contacts" in markdown(document)
    del document["contacts"]
    assert "Single contacts" not in markdown(document), "scores of older versions have none"


@pytest.fixture(scope="module")
def trained_briefly(frames, tmp_path_factory):
    from tacdata.training.settings import TrainingSettings
    from tacdata.training.train import train

    settings = TrainingSettings(arguments={"hidden": 16, "channels": 4}, epochs=1)
    return train(replace(frames), settings, tmp_path_factory.mktemp("contacts") / "run", device="cpu", threads=1)
