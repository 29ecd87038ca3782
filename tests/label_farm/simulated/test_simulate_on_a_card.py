"""A card solves one skin after the other, in one process."""

import gc

import pytest
import torch
from bump_skin import SMALL

from tacdata.label_farm.simulated.plan import SimulationPlan
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.solving import solve
from tacdata.sensor import default_sensor

THREE_SKINS = {**{key: value for key, value in SMALL.items() if key != "mesh"}, "specimens": {"count": 3}}
"""On the default mesh, which is kept: others need packages that a bare computer with a card lacks."""


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_the_third_skin_is_solved_as_the_first_is(tmp_path):
    """A second skin found no memory, or ended the process where garbage was collected amid a captured graph."""
    simulation = Simulation(tmp_path, SimulationPlan.from_document(THREE_SKINS, "plan"), default_sensor(), 0, False)
    simulation.open()
    reasons = {}
    before = gc.get_threshold()
    gc.set_threshold(50, 2, 2)  # so that a collection falls into every stretch of work that allows one
    try:
        solve(simulation, 6, "cuda:0", settled=reasons.__setitem__)
    finally:
        gc.set_threshold(*before)
    assert reasons == dict.fromkeys(range(6), "")
    assert {simulation.specimen(number).name for number in reasons} == {s.name for s in simulation.specimens}
    assert Simulation.read(tmp_path).settled == set(range(6))
    assert gc.isenabled()
