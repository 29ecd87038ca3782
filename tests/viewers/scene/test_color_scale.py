import numpy as np
import pytest

from tacdata.viewers.scene.color_scale import ColorScale, round_up, scale_of, taxel_colors


def lightness(rgb):
    """CIE L* of sRGB colours (IEC 61966-2-1, CIE 15)."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(y > 216 / 24389, 116 * np.cbrt(y) - 16, y * 24389 / 27)


@pytest.mark.parametrize(
    ("value", "rounded"),
    [(1.157, 1.2), (1.0, 1.0), (0.311, 0.32), (987.0, 990.0), (996.0, 1000.0), (7.2, 7.2), (0.05, 0.05)],
)
def test_a_scale_ends_within_a_tenth_of_the_data(value, rounded):
    assert round_up(value) == rounded


def test_a_scale_spans_the_values_and_no_less_than_its_floor():
    values = np.array([0.2, np.nan, 2.7])
    assert scale_of(values, "mm") == ColorScale(0.0, 2.7, "mm")
    assert scale_of(-values, "mm", signed=True) == ColorScale(-2.7, 2.7, "mm", True)
    assert scale_of(np.full(3, 1e-4), "mm", floor=0.1).high == 0.1
    assert scale_of(np.full(3, np.nan), "mm", floor=0.1).high == 0.1


def test_depth_rises_in_lightness_so_that_it_reads_without_hue():
    colors = ColorScale(0.0, 2.0, "mm").rgb(np.linspace(0, 2, 40)) / 255
    assert (np.diff(lightness(colors)) > 0).all()


def test_error_is_lightest_at_zero_and_its_signs_differ_in_blue_against_yellow():
    colors = ColorScale(-1.0, 1.0, "mm", signed=True).rgb(np.linspace(-1, 1, 41)) / 255
    assert abs(int(np.argmax(lightness(colors))) - 20) <= 1
    # The blue-yellow axis is what red-green blindness leaves.
    negative, positive = colors[8], colors[32]
    assert negative[0] > negative[2] + 0.3
    assert positive[2] > positive[0] + 0.1


def test_values_beyond_the_ends_take_the_color_of_the_end():
    scale = ColorScale(0.0, 1.0, "mm")
    assert (scale.rgb(np.array([-5.0, 5.0])) == scale.rgb(np.array([0.0, 1.0]))).all()


def test_taxels_are_told_apart():
    colors = taxel_colors(6, 4)
    assert colors.shape == (24, 3)
    assert len(np.unique(colors, axis=0)) == 24
    row = lightness(colors[:6] / 255)
    assert (np.diff(row) > 0).all()
