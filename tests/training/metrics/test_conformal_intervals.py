"""Uncertainty by pixel: calibrated where the errors are alike, told apart where they are not."""

import numpy as np
import pytest

from tacdata.errors import FormatError, UsageError
from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.conformal_intervals import EXPONENT, LEVELS, calibrate, reliability

PITCH = 0.4


def episodes(count, seed, scale=1.0):
    """Blobs whose prediction errs by 5 % of the depth plus 5 um, times ``scale``."""
    generator = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(35), np.arange(26), indexing="ij")
    maps, labels = [], []
    for _ in range(count):
        blob = np.exp(-((x - generator.uniform(8, 26)) ** 2 + (y - generator.uniform(6, 20)) ** 2) / 30)
        depth = np.linspace(0, 1.5, 12)[:, None, None] * blob
        error = scale * (0.005 + 0.05 * depth) * generator.normal(size=depth.shape)
        maps.append(depth.astype(np.float32))
        labels.append((depth + error).clip(0).astype(np.float32))
    return maps, labels


def test_intervals_hold_the_share_that_they_should():
    known = calibrate(*episodes(20, 0), PITCH, "a" * 64)
    for entry in reliability(known, *episodes(20, 1), PITCH):
        assert entry["inside"] == pytest.approx(entry["level"], abs=0.02)
        assert entry["pixels"] > 1000


def test_intervals_of_four_presses_that_scatter_hold_their_share_on_average():
    scales = np.exp(0.6 * np.random.default_rng(7).normal(size=(80, 4)))
    fresh = [
        episodes(1, 900 + k, scale) for k, scale in enumerate(np.exp(0.6 * np.random.default_rng(8).normal(size=24)))
    ]
    maps, labels = ([part[side][0] for part in fresh] for side in (0, 1))
    inside = []
    for draw, row in enumerate(scales):
        presses = [episodes(1, 10 * draw + k, scale) for k, scale in enumerate(row)]
        known = calibrate(*([part[side][0] for part in presses] for side in (0, 1)), PITCH, "a" * 64)
        inside.append([entry["inside"] for entry in reliability(known, maps, labels, PITCH)])
    for level, share in zip(LEVELS, np.mean(inside, axis=0), strict=True):
        assert share == pytest.approx(level, abs=0.025)


def test_intervals_of_many_presses_serve_a_predictor_that_few_presses_judge():
    inside, plain, ratios = [], [], []
    for draw in range(20):
        scales = np.exp(0.6 * np.random.default_rng(draw).normal(size=34))
        presses = [episodes(1, 100 * draw + k, scale) for k, scale in enumerate(scales)]
        maps, labels = ([part[side][0] for part in presses] for side in (0, 1))
        # The second predictor errs half as much on every press.
        second = [label + 0.5 * (depth - label) for depth, label in zip(maps, labels, strict=True)]
        spreads = [np.ones(len(depth)) for depth in maps]
        first = calibrate(maps[:30], labels[:30], PITCH, "a" * 64, spreads=spreads[:30])
        # Of 400 presses the ratio of errors is believed nearly whole, of four by half.
        many = first.adapted(*([some[0]] * 400 for some in (second, maps, labels, spreads)), PITCH)
        few = first.adapted(second[:4], maps[:4], labels[:4], spreads[:4], PITCH)
        ratios.append([np.divide(known.factors, first.factors) for known in (many, few)])
        for found, known in ((inside, many), (plain, calibrate(second[:4], labels[:4], PITCH, "a" * 64))):
            entries = reliability(known, second[30:], labels[30:], PITCH, spreads[30:])
            found.append({entry["level"]: entry["inside"] for entry in entries}[0.68])
    np.testing.assert_allclose(np.mean(ratios, axis=0), np.outer((0.5, 0.5**0.5), np.ones(len(LEVELS))), rtol=0.05)
    assert np.mean(inside) == pytest.approx(0.68, abs=0.04)
    # Intervals by four presses alone scatter more from draw to draw.
    assert np.mean(np.abs(np.array(inside) - 0.68)) < 0.8 * np.mean(np.abs(np.array(plain) - 0.68))


def test_larger_errors_than_calibrated_are_told():
    known = calibrate(*episodes(20, 0), PITCH, "a" * 64)
    inside = {e["level"]: e["inside"] for e in reliability(known, *episodes(20, 1, scale=3.0), PITCH)}
    assert inside[0.9] < 0.6


def test_deep_pixels_are_less_certain_as_their_errors_are():
    known = calibrate(*episodes(20, 0), PITCH, "a" * 64)
    flat = np.full((1, 35, 26), 0.15, np.float32), np.full((1, 35, 26), 1.2, np.float32)
    shallow, deep = (float(known.sigma(depth, PITCH)[0, 17, 13]) for depth in flat)
    assert shallow == pytest.approx(0.005 + 0.05 * 0.15, rel=0.3)
    assert deep == pytest.approx(0.005 + 0.05 * 1.2, rel=0.3)
    widths = [float(known.half_width(flat[1], PITCH, level)[0, 17, 13]) for level in LEVELS]
    assert widths == sorted(widths)
    with pytest.raises(UsageError, match="level"):
        known.half_width(flat[1], PITCH, 0.42)


def test_what_is_written_is_read_for_its_checkpoint_alone(tmp_path):
    known = calibrate(*episodes(6, 0), PITCH, "a" * 64)
    assert conformal_intervals.read(tmp_path, "a" * 64) is None
    conformal_intervals.write(tmp_path, known)
    again = conformal_intervals.read(tmp_path, "a" * 64)
    np.testing.assert_array_equal(again.deviation, known.deviation)
    assert again.factors == known.factors
    assert conformal_intervals.read(tmp_path, "b" * 64) is None
    (tmp_path / conformal_intervals.FILE).write_text("{")
    with pytest.raises(FormatError):
        conformal_intervals.read(tmp_path, "a" * 64)


def test_too_little_to_calibrate_on():
    with pytest.raises(UsageError, match="two or more"):
        calibrate(*episodes(1, 0), PITCH, "a" * 64)
    nothing = [np.zeros((4, 35, 26), np.float32)] * 2
    assert calibrate(nothing, nothing, PITCH, "a" * 64).factors[0] == conformal_intervals.NOT_KNOWN


def test_intervals_say_what_they_were_calibrated_on(tmp_path):
    known = calibrate(*episodes(6, 0), PITCH, "a" * 64, "presses of another kind")
    conformal_intervals.write(tmp_path, known)
    again = conformal_intervals.read(tmp_path, "a" * 64)
    assert again.source == "presses of another kind" and again.source in again.definition


def test_intervals_widen_with_the_deviation_of_the_process(tmp_path):
    rng = np.random.default_rng(3)
    maps, labels = episodes(20, 0)
    spreads = [rng.uniform(0.5, 2.0, len(depth)) for depth in maps]
    scattered = [
        m + (label - m) * s[:, None, None] ** EXPONENT for m, label, s in zip(maps, labels, spreads, strict=True)
    ]
    known = calibrate(maps, scattered, PITCH, "a" * 64, spreads=spreads)
    conformal_intervals.write(tmp_path, known)
    again = conformal_intervals.read(tmp_path, "a" * 64)
    near, far = (again.half_width(maps[0], PITCH, 0.68, np.full(len(maps[0]), s)) for s in (0.5, 2.0))
    np.testing.assert_allclose(far, 4.0**EXPONENT * near)
    # Among frames of large deviation alone, an interval of one width for all would hold too few errors.
    wide = [np.flatnonzero(spread > 1.6) for spread in spreads]
    picked = [[part[k] for part, k in zip(parts, wide, strict=True)] for parts in (maps, scattered, spreads)]
    level = conformal_intervals.LEVELS.index(0.68)
    inside = reliability(known, *picked[:2], PITCH, picked[2])[level]["inside"]
    plain = reliability(calibrate(maps, scattered, PITCH, "a" * 64), *picked[:2], PITCH)[level]["inside"]
    assert inside == pytest.approx(0.68, abs=0.06) and plain < 0.55
    with pytest.raises(UsageError, match="deviation of the network's Gaussian process"):
        again.sigma(maps[0], PITCH)
