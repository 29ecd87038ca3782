"""The page of a verdict holds all of itself, and says what the document and the text say."""

import json
import re
from copy import deepcopy

import numpy as np
import pytest
from pressing import course

from tacdata import documents
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.page.heat_map import heat_map
from tacdata.discrepancy.page.press_curves import largest_changes
from tacdata.discrepancy.page.verdict_page import TAKEN_OUT, verdict_page
from tacdata.discrepancy.report.before_and_after import beside_model
from tacdata.discrepancy.report.sealed_gap import chosen
from tacdata.discrepancy.report.text import in_text
from tacdata.effects import library, load

FEW = ("latency", "relaxation", "backlash")


@pytest.fixture(scope="module", params=[{"delay": 0.05}, {}], ids=["delay", "nothing"])
def judged(request):
    """A verdict and the readings beside its model."""
    made = course(episodes=24, **request.param)
    others = tuple(e.called for e in library() if e.called not in FEW)
    done = judge(made, read_spec(None), without=others)
    return done.document, beside_model(made, (done.conclusion.before, done.conclusion.after), chosen(made))


def figures(page):
    """Return the data of the figures, one list of frames each."""
    return [json.loads(data) for data in re.findall(r'<script type="application/json">(.*?)</script>', page)]


def test_the_presses_are_under_one_slider_with_their_readings_as_data(judged):
    verdict, residuals = judged
    page = verdict_page(*judged)
    assert not re.search(r'(src|href)="(?!#)', page), "nothing comes from elsewhere"
    assert "`" not in re.sub(r"<script.*?</script>", "", page, flags=re.S), "commands are set as code"
    reading, residual, loop = figures(page)
    assert len(reading) == len(residual) == len(loop) == len(largest_changes(residuals)) == page.count("<option ")
    press = largest_changes(residuals)[0]
    shown = reading[0]["series"][0]["values"]
    assert np.ptp(shown) == pytest.approx(np.ptp(press.measured), rel=1e-3)
    assert residual[0]["bands"][0]["high"] == pytest.approx(2 * press.noise, rel=1e-4)
    assert len(residual[0]["series"]) == 1 + bool(verdict["effects"])


def test_the_page_the_document_and_the_text_are_of_one_mind(judged):
    verdict, residuals = judged
    documents.check(verdict, "verdict", "verdict")
    page, text = verdict_page(verdict, residuals), in_text(verdict)
    assert f'">{verdict["status"]}</p>' in page and text.startswith(verdict["status"].upper())
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
        "level": None,
        "probability": {"family": 0.9, "mechanism": 0.5, "form": 0.5},
    }
    for gap in (True, False):
        shown = verdict | {"status": "ambiguous", "effects": [told], "gap": verdict["gap"] | {"seen": gap}}
        page = verdict_page(shown, residuals)
        assert ("model with the effects" in page) == ("with the effects" in page) == gap


def test_shown_presses_are_sealed_ones(judged):
    verdict, residuals = judged
    presses = largest_changes(residuals)
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
        "level": "mechanism",
        "probability": {"family": 0.99, "mechanism": 0.97, "form": 0.97},
    }
    parts = [{"by": "phase", "name": "unloading", "before": 21.5, "after": 4.25}]
    page = verdict_page(verdict | {"effects": [told], "slices": parts}, residuals)
    where = page[page.index(TAKEN_OUT.replace("'", "&#39;")) :]
    assert "own pose and gain left in" in page
    assert ">unloading<" in where and ">21.5<" in where and ">4.25<" in where
    assert not re.search("<li>(phase|depth|rate): ", page), "it stands in the picture"
    assert "pose and gain taken out" not in verdict_page(verdict | {"effects": []}, residuals)


def test_a_map_of_depths_begins_at_touch(judged):
    made = heat_map(judged[1])
    assert made.columns[0].startswith("0 to ") and not any("e-" in words for words in made.columns)


def test_the_sets_are_listed_with_their_probabilities(judged):
    verdict = deepcopy(judged[0])
    sets = verdict["posterior"]["sets"]
    assert sets and sum(one["probability"] for one in sets) <= 1 + 1e-9
    verdict["posterior"]["sets"] = [{"effects": ["drift", "creep"], "probability": 0.314, "log_evidence": 7.25}]
    page = verdict_page(verdict, judged[1])
    assert ">drift and creep<" in page and ">31 %<" in page and ">7.2<" in page


def test_a_field_that_was_hardly_read_is_not_drawn_and_a_map_of_none_is_left_out(judged, monkeypatch):
    whole = verdict_page(*judged)
    monkeypatch.setattr("tacdata.discrepancy.page.heat_map.FEWEST", 10**9)
    with np.errstate(all="raise"):
        page = verdict_page(*judged)
    assert "loading, slow" in whole and "loading, slow" not in page
