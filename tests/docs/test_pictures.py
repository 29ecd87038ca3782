"""The documents' pictures are drawn by the code of today, and README's have its layout: sizes, panels, headings.

What stands in the panels is that of one run of `tacdata demo`; it takes minutes, and is not repeated here.
"""

import importlib.util
import json

import numpy as np
import pytest
from example_folder import fill
from PIL import Image
from running.in_process import tacdata
from running.typed_pages import HOW_TO

from tacdata.labels import read_label
from tacdata.recording import read_episode
from tacdata.training.inference.prediction import PredictedMaps, write_prediction
from tacdata.viewers.pictures import film

PICTURES = HOW_TO.parent / "pictures"
ROOT = HOW_TO.parents[1]
HEADINGS = {"Taxel signals": (124, 138, 0, 640)}
"""Headings -> rows and columns of the page in which they stand, and nothing of the press [pixels].

Headings of the maps are left out: their number depends on the maps that a label holds."""
APART, MOVED, LETTER = 20, 10, 4
"""Gap between two headings, and how far an axis of other numbers moves them; less than a letter [pixels]."""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """The pictures of another press, drawn now."""
    folder = tmp_path_factory.mktemp("drawn")
    fill(folder)
    for number in range(2):
        label = read_label(folder / "session" / "labels" / f"episode-{number:06d}.parquet")
        sensor = read_episode(folder / "session" / f"episode-{number:06d}.mcap").sensor
        maps = PredictedMaps(
            episode=number,
            time_ns=label.time_ns,
            depth=np.float32(0.9) * np.maximum(label.signed, 0),
            part="test",
            checkpoint="ab" * 32,
            network="paper",
            dataset="cd" * 32,
            sensor=sensor.content_hash,
            provenance=label.provenance,
        )
        write_prediction(folder / "network" / "predictions" / f"episode-{number:06d}.parquet", maps)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(film.MOST, ".gif", 2)
        done = tacdata("pictures", folder, "--out", folder / "pictures")
    assert done.returncode == 0, done.stderr
    return folder / "pictures"


@pytest.mark.parametrize("name", ["episode.png", "press.gif"])
def test_pictures_have_the_size_of_today(drawn, name):
    with Image.open(PICTURES / name) as shipped, Image.open(drawn / name) as new:
        assert shipped.size == new.size, f"draw {name} anew: tacdata demo, then tacdata pictures"


def test_pictures_are_drawn_by_the_code_of_today():
    spec = importlib.util.spec_from_file_location("draw", ROOT / ".dev" / "pictures.py")
    draw = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(draw)
    kept = json.loads((PICTURES / "code.json").read_text())
    old = [name for name in draw.DRAWN_BY if kept.get(name) != draw.code_of(name)]
    assert not old, f"draw anew, and look at it: .venv/bin/python .dev/pictures.py {' '.join(old)}"


def words(picture, band):
    """Return (begin, width) [pixels] of each group of dark columns in a band of a picture; letters stand close."""
    top, bottom, left, right = band
    dark = np.asarray(Image.open(picture).convert("L"))[top:bottom, left:right].min(axis=0) < 128
    at = np.flatnonzero(dark)
    groups = np.split(at, np.flatnonzero(np.diff(at) > APART) + 1)
    return [(int(group[0]), int(group[-1] - group[0])) for group in groups]


@pytest.mark.parametrize("heading", HEADINGS)
def test_headings_of_the_page_stand_where_they_stand_today(drawn, heading):
    shipped, new = (words(folder / "episode.png", HEADINGS[heading]) for folder in (PICTURES, drawn))
    assert len(shipped) == heading.count(",") + 1 == len(new), "draw episode.png anew: tacdata demo, tacdata pictures"
    for (begin, width), (now, wide) in zip(shipped, new, strict=True):
        assert abs(begin - now) <= MOVED and abs(width - wide) <= LETTER, "draw episode.png anew"
