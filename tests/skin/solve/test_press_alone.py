"""A press that is solved alone gives the same numbers, to the last bit, whatever is solved with it or before it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import PLAIN, box_mesh, slab_sensor

from tacdata.errors import UsageError
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest

ALONE = replace(PLAIN, alone=True, error_estimate=True)
SENSOR = slab_sensor(size=4.0, friction=0.2, pixels=9)
FINE, COARSE = box_mesh(SENSOR, 6, 6, 2), box_mesh(SENSOR, 4, 4, 2)
PRESSES = [
    PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2, 0.4, 0.2)),
    PressRequest(FlatPunch(0.8, 0.3), -0.4, 0.1, 20.0, (0.15, 0.3)),
    PressRequest(Sphere(1.0), 0.0, 0.0, 0.0, (0.1, 0.3)),
]


def labels(presses, capacity, settings=ALONE):
    model = SkinModel(SENSOR, settings, mesh=FINE, companion=COARSE)
    return dict(model.solve_many(presses, capacity))


def same(one, other):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in ("surface", "force", "traction", "numerical", "taxel_force")
    )


def test_labels_are_the_same_in_every_batch():
    together, backwards = labels(PRESSES, 3), labels(PRESSES[::-1], 2)
    for number, press in enumerate(PRESSES):
        [alone] = labels([press], 1).values()
        assert same(alone, together[number]) and same(alone, backwards[2 - number])


def test_without_it_last_bits_depend_on_the_batch():
    usual = replace(ALONE, alone=False)
    [alone] = labels(PRESSES[:1], 1, usual).values()
    together = labels(PRESSES, 3, usual)[0]
    assert not same(alone, together)
    np.testing.assert_allclose(alone.force, together.force, rtol=1e-3, atol=1e-3 * np.abs(alone.force).max())


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_a_card_refuses_in_words():
    with pytest.raises(UsageError, match="no fixed order"):
        SkinModel(SENSOR, ALONE, "cuda:0", FINE, COARSE)
