"""The page of a verdict holds all of itself, and says what the document and the text say."""

import re
from copy import deepcopy
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
from pressing import course

from tacdata import documents
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.page import charts
from tacdata.discrepancy.page.heat_map import heat_map
from tacdata.discrepancy.page.telling import telling
from tacdata.discrepancy.page.verdict_page import TAKEN_OUT, verdict_page
from tacdata.discrepancy.verdict.before_and_after import beside_model
from tacdata.discrepancy.verdict.sealed import chosen
from tacdata.discrepancy.verdict.text import in_text
from tacdata.effects import library, load

FEW = ("latency", "relaxation", "backlash")


@pytest.fixture(scope="module", params=[{"delay": 0.05}, {}], ids=["delay", "nothing"])
def judged(request):
    """A verdict and the readings beside its model."""
    made = course(episodes=24, **request.param)
    others = tuple(e.called for e in library() if e.name not in FEW)
    done = judge(made, read_spec(None), without=others)
    return done.document, beside_model(made, done.found, chosen(made))


class Outside(HTMLParser):
    """Collects what a page would load from elsewhere."""

    def __init__(self):
        super().__init__()
        self.loaded = []

    def handle_starttag(self, tag, attrs):
        self.loaded += [value for name, value in attrs if name in ("src", "href")]


def test_a_page_holds_all_of_itself_and_its_pictures_are_sound(judged):
    page = verdict_page(*judged)
    reader = Outside()
    reader.feed(page)
    assert not reader.loaded
    assert "`" not in page, "commands are set as code"
    pictures = re.findall(r"<svg.*?</svg>", page, re.S)
    assert len(pictures) >= 5
    for picture in pictures:
        ElementTree.fromstring(picture)


def test_the_page_the_document_and_the_text_are_of_one_mind(judged):
    verdict, residuals = judged
    documents.check(verdict, "verdict", "verdict")
    page, text = verdict_page(verdict, residuals), in_text(verdict)
    assert f'class="badge">{verdict["status"]}<' in page and text.startswith(verdict["status"].upper())
    for e in verdict["effects"]:
        assert load(e["effect"]).spoken in page and load(e["effect"]).spoken in text
    sealed = verdict["sealed"]
    shown = f"{sealed['before']:.3g} → {sealed['after']:.3g}"
    assert (shown in page) == bool(verdict["effects"])
    words = "of the gap closed" in text
    assert words == ("of their gap closed" in page) == bool(verdict["effects"] and sealed["certain"])


def test_what_only_specimens_tell_together_is_drawn_into_no_press(judged):
    verdict, residuals = judged
    told = {
        "effect": "frame_compliance",
        "mechanism": "frame_compliance",
        "family": "kinematics",
        "status": "ambiguous",
        "alternatives": ["stiffening"],
        "margins": {},
        "confidence": None,
    }
    for gap in (True, False):
        shown = verdict | {"status": "ambiguous", "effects": [told], "gate": verdict["gate"] | {"gap": gap}}
        page = verdict_page(shown, residuals)
        assert ("model with the effects" in page) == ("with the effects" in page) == gap


def test_telling_presses_are_sealed_ones(judged):
    verdict, residuals = judged
    presses = telling(residuals)
    assert {p.name for p in presses} <= set(verdict["data"]["sealed"]) and presses


def test_the_map_is_the_mean_square_over_the_noise(judged):
    _, residuals = judged
    made = heat_map(residuals)
    assert made.before.shape == (len(made.rows), len(made.columns))
    known = np.isfinite(made.before)
    assert known.sum() >= 9
    whole = np.nanmean(np.square(residuals.standardized(residuals.before))[residuals.phase > 0])
    assert made.before[known].min() <= whole <= made.before[known].max()


def test_what_the_effects_change_is_shown_without_what_a_press_has_of_its_own(judged):
    """A map under poses and gains of single presses hardly changes, whatever is explained."""
    verdict, residuals = judged
    told = {
        "effect": "creep",
        "mechanism": "creep",
        "family": "memory of the skin",
        "status": "named",
        "alternatives": [],
        "margins": {},
        "confidence": 0.9,
    }
    parts = [{"by": "phase", "name": "unloading", "before": 21.5, "after": 4.25}]
    page = verdict_page(verdict | {"effects": [told], "slices": parts, "path": []}, residuals)
    where = page[page.index(TAKEN_OUT.split("'")[1]) :]
    assert "own pose and gain left in" in page
    assert ">unloading<" in where and ">21.5<" in where and ">4.25<" in where
    assert not re.search("<li>(phase|depth|rate): ", page), "it stands in the picture"
    assert "pose and gain taken out" not in verdict_page(verdict | {"effects": []}, residuals)


def test_a_bar_of_shares_is_as_long_as_they_are():
    bar = ElementTree.fromstring(charts.shares_bar([("share0", "a <b>", 0.6), ("rest", "no name yet", 0.3)]))
    assert [float(r.get("width")) for r in bar] == pytest.approx([480, 240])


def test_the_ends_of_an_axis_fit_beside_it():
    drawn = charts.curves("", np.arange(3.0), [("measured", np.array([-123456.0, 0, 1049.6]))], ("s", "counts"))
    ends = [t.text or "" for t in ElementTree.fromstring(drawn).iter("text")]
    assert not any("e+" in t for t in ends) and max(len(t) for t in ends) <= 7


def test_a_map_of_depths_begins_at_touch(judged):
    made = heat_map(judged[1])
    assert made.columns[0].startswith("0 to ") and not any("e-" in words for words in made.columns)


def test_a_rival_that_fits_worse_is_said_to_have_other_forms(judged):
    verdict = deepcopy(judged[0])
    if not verdict["effects"]:
        assert "Why not the others" not in verdict_page(*judged)
        return
    effect = verdict["effects"][0]
    effect["margins"], effect["alternatives"] = {"drift": 4.0, "creep": 9.0}, ["drift"]
    page = verdict_page(verdict, judged[1])
    assert "drift may stand in" in page and "4.0 standard errors, but another form of it may not" in page
    assert "not creep: it explains the presses worse by 9.0 standard errors than" in page


def test_maps_side_by_side_have_one_scale_of_colour():
    """A map of what is left would else be as red as the one before."""
    maps = [charts.map_of("", ["hold"], ["0 to 1 mm"], np.array([[value]]), 1000.0) for value in (1000.0, 1.5)]
    before, after = (float(m.split("fill-opacity:")[1].split('"')[0]) for m in maps)
    assert before > 0.8 and after < 0.15
    assert "1000<" in maps[0] and "e+" not in maps[0]


def test_a_field_that_was_hardly_read_is_not_drawn_and_a_map_of_none_is_left_out(judged, monkeypatch):
    whole = verdict_page(*judged)
    monkeypatch.setattr("tacdata.discrepancy.page.heat_map.FEWEST", 10**9)
    with np.errstate(all="raise"):
        page = verdict_page(*judged)
    assert "loading, slow" in whole and "loading, slow" not in page
