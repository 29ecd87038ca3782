"""Noise that was drawn once still differs from frame to frame and from pixel to pixel."""

import numpy as np

from tacdata.virtual_rig.optics.noise_stretch import NoiseStretch


def test_frames_have_noise_of_unit_variance_that_no_other_frame_has():
    noise = NoiseStretch(np.random.default_rng(3))
    frames = [noise.standard_normal((120, 160)) for _ in range(3)]
    for k, frame in enumerate(frames):
        assert frame.shape == (120, 160) and frame.dtype == np.float32
        assert abs(frame.mean()) < 0.03 and abs(frame.std() - 1) < 0.02
        for other in frames[:k]:
            assert abs(np.corrcoef(frame.ravel(), other.ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(frames[0][:, 1:].ravel(), frames[0][:, :-1].ravel())[0, 1]) < 0.03


def test_the_same_seed_gives_the_same_frames():
    first, second = (NoiseStretch(np.random.default_rng(5)) for _ in range(2))
    for _ in range(2):
        assert np.array_equal(first.standard_normal((9, 7)), second.standard_normal((9, 7)))
