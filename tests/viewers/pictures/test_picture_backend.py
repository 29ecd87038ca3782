"""A page is tested by what stands on it: every text inside, none on another, units on every axis."""

import itertools
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from PIL import Image

from tacdata.errors import UsageError
from tacdata.viewers.pictures.backend import STYLE, PictureBackend, page
from tacdata.viewers.scenes.episode import episode_scene


def drawn(scene):
    with rc_context(STYLE):
        figure = page(scene)
        FigureCanvasAgg(figure)
    return figure


@pytest.fixture(scope="module")
def figures(episode, label, prediction, images):
    bare = replace(episode, tags=(), phases=(), tip_ns=episode.tip_ns[:0], tip=episode.tip[:0])
    scenes = {
        "all": episode_scene(episode, label, prediction, images),
        "label": episode_scene(episode, label),
        "recording": episode_scene(episode),
        "bare": episode_scene(bare),
    }
    return {name: drawn(scene) for name, scene in scenes.items()}


@pytest.fixture(scope="module")
def printed(figures):
    return {name: texts(figure) for name, figure in figures.items()}


def texts(figure):
    """Return (text, box) of everything that is really printed; ticks beyond an axis' limits are not."""
    printed, original = [], Text.draw

    def remember(self, renderer, *arguments, **named):
        if self.get_visible() and self.get_text().strip():
            printed.append((self.get_text(), self.get_window_extent(renderer)))
        original(self, renderer, *arguments, **named)

    with patch.object(Text, "draw", remember):
        figure.canvas.draw()
    return printed


@pytest.mark.parametrize("name", ["all", "label", "recording", "bare"])
def test_nothing_printed_is_cropped(figures, printed, name):
    page_box = figures[name].bbox
    outside = [
        text
        for text, box in printed[name]
        if box.x0 < page_box.x0 or box.x1 > page_box.x1 or box.y0 < page_box.y0 or box.y1 > page_box.y1
    ]
    assert not outside


@pytest.mark.parametrize("name", ["all", "label", "recording", "bare"])
def test_no_title_or_label_lies_on_another(printed, name):
    words = [(t, b) for t, b in printed[name] if any(c.isalpha() for c in t)]
    assert len(words) > 8
    clashes = [(a, b) for (a, p), (b, q) in itertools.combinations(words, 2) if p.padded(-1).overlaps(q.padded(-1))]
    assert not clashes


@pytest.mark.parametrize("name", ["all", "label", "recording", "bare"])
def test_every_axis_has_a_unit(figures, name):
    for axes in figures[name].axes:
        labels = [axes.get_xlabel(), axes.get_ylabel()]
        shown = [text for text in labels if text]
        assert all("[" in text or text in ("column", "row") for text in shown), shown
        # Inner axes of a grid share the labels of the outer ones; colour bars have one.
        assert shown or axes.get_images(), "an axis without any label"


def test_a_file_is_written_whole_with_colours_in_it(episode, label, tmp_path):
    PictureBackend(tmp_path / "page.png", resolution=50).draw(episode_scene(episode, label))
    with Image.open(tmp_path / "page.png") as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape[1] == 800
    yellow = (pixels[..., 0] > 200) & (pixels[..., 1] > 200) & (pixels[..., 2] < 90)
    assert yellow.sum() > 50, "the deep end of the scale is in the picture"
    assert [p.name for p in tmp_path.iterdir()] == ["page.png"]


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "page.png").write_text("mine")
    with pytest.raises(UsageError, match="exists"):
        PictureBackend(tmp_path / "page.png")
    with pytest.raises(UsageError, match=r"ends in \.png"):
        PictureBackend(tmp_path / "page.pdf")
