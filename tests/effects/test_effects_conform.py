"""Every effect is nothing at its default, does something at its typical size, and says what it is."""

import difflib
import functools
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
import yaml

from tacdata.chain import STAGES, Chain, Course, Response, Tool, predict
from tacdata.effects import Family, Placed, library, load

EFFECTS = library()
GROUPS = sorted({effect.group for effect in EFFECTS})


class Springs(Response):
    """Nine channels, each a spring whose load falls off with distance."""

    places = np.array([(x, y) for x in (-2.0, 0.0, 2.0) for y in (-2.0, 0.0, 2.0)])

    def load(self, pose, tool):
        distance = ((pose[:, None, :2] - self.places) ** 2).sum(axis=-1)
        return np.maximum(pose[:, 2:3], 0) ** 1.5 * np.exp(-distance / 6) * np.where(tool == 0, 1.0, 0.7)[:, None]

    def force(self, pose, tool):
        return np.maximum(pose[:, 2], 0) ** 1.5

    def signal(self, load):
        return 1000 + 500 * load


@functools.cache
def pressed():
    """Six presses at two places, four sessions, two tools, with a tag that is a little off."""
    one = np.concatenate([np.linspace(-0.5, 1, 60), np.full(60, 1.0), np.linspace(1, -0.5, 60), np.full(40, -0.5)])
    episode = np.repeat(np.arange(6), len(one))
    site = np.array([0, 0, 1, 0, 1, 1])
    xy = np.array([[0.3, 0.2], [1.5, -1.0]])[site][episode]
    depth = np.tile(one, 6) * np.array([1, 0.6, 1, 0.8, 1, 0.7])[episode]
    time = np.arange(len(episode)) / 50 + 3.0 * episode
    tip = np.column_stack([xy, depth])
    n = len(time)
    return Course(
        time=time,
        episode=episode,
        tip=tip,
        tool=(episode % 2).astype(int),
        readings=np.zeros((n, 9)),
        averaged=np.ones(n),
        session=np.array([0, 0, 1, 2, 2, 3]),
        site=site,
        tools=(Tool("a", "sphere", 4.0), Tool("b", "sphere", 2.0)),
        names=tuple("abcdef"),
        centers=Springs.places,
        force=np.zeros(n),
        tag=tip + 0.02,
        temperature=20 + time / time[-1] * 5,
    )


def values(effect, size):
    course = pressed()
    made = {}
    for p in effect.parameters:
        value = p.grid[len(p.grid) // 2] if p.grid else p.default + size * p.typical
        made[p.name] = np.full(course.channels, value) if p.per_channel else np.array(value)
    return made


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_an_effect_says_what_it_is(effect):
    assert effect.stage in STAGES
    assert set(effect.moves) <= {"tag", "label", "signal", "force"}
    assert all([effect.title, effect.equation, effect.source, effect.experiment])
    assert effect.amplitudes
    assert 0 < effect.odds <= 1
    for p in effect.parameters:
        assert p.unit
        assert p.meaning
        assert p.low < p.high
        assert p.typical > 0
        assert all(p.low <= g <= p.high for g in p.grid)
    assert load(effect.called).called == effect.called, "the mechanism is the name of a file"
    assert load(effect.name).name == effect.name, "forms are found by their own names, which verdicts record"
    assert effect.title == type(effect).__doc__.split("\n")[0].rstrip("."), "the docstring is the title"


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_it_is_nothing_at_its_default(effect):
    course, response = pressed(), Springs()
    before = predict(course, response, [])
    after = predict(course, response, [Placed(effect, values(effect, 0.0))])
    for stream in ("signal", "force", "tag", "pose"):
        np.testing.assert_allclose(getattr(after, stream), getattr(before, stream), atol=1e-9)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_it_moves_what_it_says_and_nothing_else(effect):
    course, response = pressed(), Springs()
    if effect.unjudgeable(course, response):
        response.fitted = True  # some forms stand in where loads are not known
        course = replace(course, force=None)  # ... nor the force
    if effect.unjudgeable(course, response):
        response.places = Springs.places[:4]  # and some are of few channels
        course = replace(course, readings=course.readings[:, :4], centers=Springs.places[:4])
    if effect.unjudgeable(course, response):
        pytest.fail("this course should excite every effect")
    before = predict(course, response, [])
    sizes = {name: value[: course.channels] if value.ndim else value for name, value in values(effect, 1.0).items()}
    after = predict(course, response, [Placed(effect, sizes)])

    def moved(stream):
        return not np.allclose(getattr(after, stream), getattr(before, stream), atol=1e-9)

    if effect.name != "lateral_backlash":  # a course at rest sideways does not excite it within its dead band
        assert moved("signal") == ("signal" in effect.moves)
    assert moved("tag") == ("tag" in effect.moves and effect.seen_by_tag)
    assert moved("force") == ("force" in effect.moves)
    assert np.isfinite(after.signal).all()


def test_every_effect_has_a_family_and_all_forms_of_a_mechanism_have_the_same():
    families = {}
    for effect in EFFECTS:
        families.setdefault(effect.called, set()).add(effect.family)
    assert all(len(own) == 1 for own in families.values())
    assert {f for own in families.values() for f in own} == set(Family) - {Family.OTHER}


def test_an_ambiguity_group_has_one_spelling():
    # A group is where an effect is put: a new one is a decision, one that nearly spells another is a slip.
    for group in GROUPS:
        others = [other for other in GROUPS if other != group]
        assert not difflib.get_close_matches(group, others, n=1, cutoff=0.8)
    assert len({e.called for e in EFFECTS}) >= 30


def test_known_but_not_modelled_effects_belong_to_a_group():
    listed = yaml.safe_load(resources.files("tacdata.effects").joinpath("not_modelled.yaml").read_text())
    assert {e["group"] for e in listed} <= set(GROUPS)
    assert len({e["id"] for e in listed}) == len(listed)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_a_chain_that_was_run_says_the_same_with_one_more(effect):
    course, response = pressed(), Springs()
    base = [Placed(load(n), values(load(n), 1.0)) for n in ("drift", "relaxation", "backlash", "gain", "z_offset")]
    more = [*base[:2], Placed(effect, values(effect, 1.0)), *base[2:]]
    again, afresh = Chain(course, response, base).again(more), predict(course, response, more)
    assert np.abs(afresh.signal - predict(course, response, base).signal).max() > 0 or effect.moves == ("tag",)
    for stream in ("signal", "force", "tag", "pose"):
        np.testing.assert_array_equal(getattr(again, stream), getattr(afresh, stream))
