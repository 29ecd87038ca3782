"""Two solids on one holder press as both of them, each in its place."""

import dataclasses

import numpy as np
import pytest
from test_indenters_conform import distance

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.indenters import Indenter, from_document
from tacdata.indenters.indenter import BASE, ROOM

SINGLE = [name for name in registry.names(ROOM, BASE) if name not in ("pair", "mesh")]
BALL = {"shape": "sphere", "radius": 1.0}


@pytest.mark.parametrize("name", SINGLE)
def test_the_distance_is_that_of_the_nearer_solid_of_any_shape(name):
    own = registry.load(ROOM, BASE, name, Indenter).example()
    pair = from_document({"shape": "pair", "first": BALL, "second": own.document, "distance": 7.0})
    points = np.random.default_rng(5).uniform([-6.0, -3.0, -1.0], [6.0, 3.0, 3.0], (400, 3))
    aside = np.array([3.5, 0.0, 0.0])
    nearer = np.minimum(distance(pair.first, points + aside), distance(own, points - aside))
    np.testing.assert_allclose(distance(pair, points), nearer, atol=1e-12)


def test_sizes_of_both_solids_reach_the_device():
    pair = from_document({"shape": "pair", "first": BALL, "second": BALL, "distance": 5.0})
    larger = dataclasses.replace(pair, second=from_document({"shape": "sphere", "radius": 2.0}))
    middle = np.array([[-2.5, 0.0, 1.0], [2.5, 0.0, 1.0]])
    assert distance(pair, middle) == pytest.approx([-1.0, -1.0])
    assert distance(larger, middle) == pytest.approx([-1.0, -1.0])
    assert distance(larger, middle + np.array([0.0, 0.0, 1.0])) == pytest.approx([0.0, -2.0])


def test_solids_that_overlap_have_one_closed_surface():
    pair = from_document({"shape": "pair", "first": BALL, "second": BALL, "distance": 1.2})
    mesh = pair.surface(6.0)
    assert mesh.is_watertight
    assert mesh.volume < 1.95 * pair.first.surface(6.0).volume


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"first": {"shape": "pair", "first": BALL, "second": BALL, "distance": 3.0}}, "a single solid"),
        ({"second": 3.0}, "a shape with its sizes"),
        ({"second": {"shape": "sphere", "radius": -1.0}}, "radius"),
        ({"second": {"shape": "sphere"}}, "exactly radius"),
    ],
)
def test_what_is_no_pair_is_refused(change, words):
    with pytest.raises(FormatError, match=words):
        from_document({"shape": "pair", "first": BALL, "second": BALL, "distance": 5.0, **change})
