"""The skin model as the farm calls it: several presses at once are the presses one by one."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.errors import SolveError
from tacdata.label_farm.presses.fem import FemModel
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.model import solve_each
from tacdata.label_farm.presses.tolerance import Tolerance
from tacdata.sensor import default_sensor


@pytest.mark.long("label_farm", "tacdata/skin", reason="presses of a mesh as fine as the default")
@pytest.mark.timeout(900)
def test_a_batch_gives_each_press_its_own_answer():
    whole = default_sensor()
    taxels, skin = replace(whole.taxels, columns=2, rows=2), replace(whole.skin, size_x=7.0, size_y=7.0)
    sensor = replace(whole, name="corner", taxels=taxels, skin=skin, map=replace(whole.map, pixels_x=12, pixels_y=12))
    model = FemModel(sensor)
    loose = Tolerance(share=0.2, least=0.1)
    jobs = [
        Job(sensor.content_hash, "a" * 64, {"shape": "sphere", "radius": 3.0}, x, 0.0, 0.0, (0.0, depth, 0.0), loose)
        for x, depth in ((0.0, 0.1), (60.0, 0.1), (1.5, 0.12))
    ]
    assert model.batch == 16, "a processor reads its factor once for all of them"
    found = {job.x: outcome for job, outcome in solve_each(model, jobs)}
    assert isinstance(found[60.0], SolveError), "beside the skin: one bad press stops no other"
    for job in (jobs[0], jobs[2]):
        alone, together = model.solve(job), found[job.x]
        assert np.abs(alone.surface - together.surface).max() < 1e-3 * job.deepest
        assert "ladder" in together.provenance
