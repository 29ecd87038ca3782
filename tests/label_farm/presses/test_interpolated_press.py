"""What is lost between the states of a real press: solved at all midpoints, held against what a label would say."""

import numpy as np
import pytest

from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.label_farm.presses.interpolate import Branch
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.presses.tolerance import Tolerance
from tacdata.sensor import default_sensor


@pytest.mark.long("label_farm", reason="presses of the default skin at twice the states")
@pytest.mark.timeout(900)
@pytest.mark.parametrize("indenter", [Sphere(3.0), FlatPunch(2.0, 0.2)], ids=lambda indenter: indenter.shape)
def test_no_frame_is_further_off_than_a_state_left_out(indenter):
    """The default skin's coarser mesh, both branches; prints with -s what stands in
    `label_farm/presses/tolerance.py`."""
    from tacdata.skin.model import SkinModel
    from tacdata.skin.press import PressRequest

    model = SkinModel(default_sensor()).companion
    ladder = np.array(Ladder().depths(1.0))
    dense = np.sort(np.concatenate([ladder[:6], (ladder[:5] + ladder[1:6]) / 2]))
    depths = (*dense, *dense[-2::-1])
    request = PressRequest(indenter, 1.1, -0.7, 0.0, depths)
    states = [state for _, state in model.states(request)]
    surface = model.figures(request, depths, states).surface.reshape(len(depths), -1)
    peak = len(dense) - 1
    for name, values in (("loading", surface[: peak + 1]), ("unloading", surface[peak:][::-1])):
        branch, whole = Branch(dense[::2], values[::2]), Branch(dense, values)
        lost = np.abs(branch.at(dense) - values).max(axis=1)
        bound = branch.left_out_beside(dense)
        print(
            f"\n{indenter.shape} {name}: lost at most {1e3 * lost.max():.1f} um, bound {1e3 * bound.max():.1f} um; "
            f"left out with twice the states {1e3 * whole.left_out().max():.1f} um"
        )
        assert (lost[1::2] <= bound[1::2]).all()
        # Bounds stay near what states left out cost: a fiftieth of the depth under the sphere's moving edge.
        assert bound.max() < 0.025
    maps = surface.reshape(len(depths), *model.sensor.map.shape)
    chosen = [*range(0, peak + 1, 2), *range(peak + 2, len(depths), 2)]
    few = Tolerance().exceeded(np.array(depths)[chosen], maps[chosen])
    many = Tolerance().exceeded(np.array(depths), maps)
    print(f"rms over the dented pixels over the tolerance: {few:.2f}, with twice the states {many:.2f}")
    # Where a node comes into contact, a map goes on by whole elements: under a sphere more states do not help there.
    assert few < 1 and many < 1
