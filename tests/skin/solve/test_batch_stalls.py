"""A press that stalls in a batch: nobody waits for it, and it ends alone."""

import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.indenters.sphere import Sphere
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.batch import Batch
from tacdata.skin.solve.load_path import LoadPath

SENSOR = slab_sensor(size=4.0, friction=0.2, pixels=9)
PRESSES = [PressRequest(Sphere(1.5), x, 0.1, 0.0, (0.2, 0.4, 0.2)) for x in (-0.4, -0.1, 0.2)]
STALLS = PressRequest(Sphere(1.0), 0.5, 0.4, 0.0, (0.31,))
FAILURES = 4
"""Attempts that are made to fail: the load step is halved each time."""


@pytest.fixture(scope="module")
def model():
    return SkinModel(SENSOR, ModelSettings(error_estimate=False), mesh=box_mesh(SENSOR, 6, 6, 2))


class Watch:
    """Solves presses in one batch; notes at which iteration each was done and how many columns every step had."""

    def __init__(self, model, requests, patch):
        self.done, self.widths, self.states, failed = {}, [], {}, []
        judge, step = LoadPath.judge, Batch._step

        def judged(path, *figures, settings):
            verdict = judge(path, *figures, settings=settings)
            if path.depths == STALLS.depths and path.newton == 6 and len(failed) < FAILURES:
                failed.append(path.attempt)
                path.reason = "made to fail"
                return "failed"
            # Until then it finds nothing.
            return "go on" if path.depths == STALLS.depths and len(failed) < FAILURES else verdict

        def stepped(own, now):
            if busy := sum(press is not None for press in own._presses):
                self.widths.append(busy)
                self.columns = own._at.u.shape[2]
            step(own, now)

        patch.setattr(LoadPath, "judge", judged)
        patch.setattr(Batch, "_step", stepped)
        for number, depth, state in model.states_many(requests, len(requests)):
            self.done[number] = len(self.widths)
            self.states[number, depth] = state
        self.failed = failed


def test_nobody_waits_for_a_press_that_stalls_and_it_ends_alone(model, monkeypatch):
    with monkeypatch.context() as patch:
        among = Watch(model, [PRESSES[0], STALLS, *PRESSES[1:]], patch)
    with monkeypatch.context() as patch:
        without = Watch(model, PRESSES, patch)
    assert len(among.failed) == FAILURES
    assert among.failed == pytest.approx([STALLS.depths[0] / 2**k for k in range(FAILURES)], rel=0.3)
    # Each of the others is done within an iteration of when it was without it: linear solves end by shares of a batch.
    for beside, alone in ((0, 0), (2, 1), (3, 2)):
        assert abs(among.done[beside] - without.done[alone]) <= 1
    assert among.done[1] > 1.5 * max(without.done.values())
    assert among.widths[-1] == among.columns == 1, "the batch is as wide as what is left of it"
    [(depth, alone)] = model.states(STALLS)
    assert among.states[1, depth].force[2] == pytest.approx(alone.force[2], rel=0.01)
