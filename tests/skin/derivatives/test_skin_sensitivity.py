"""Derivatives of whole presses against central differences of whole presses, and what must hold exactly.

The compared presses balance forces and close gaps so tightly that their differences are those of the equations.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import FormatError, UsageError
from tacdata.indenters.ellipsoid import Ellipsoid
from tacdata.indenters.sphere import Sphere
from tacdata.skin.derivatives.parameter_names import known
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import turned
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.load_path import LoadPath
from tacdata.skin.solve.settings import SolverSettings

EGG = Ellipsoid(3.0, 2.0, 1.5)
PATH = (0.15, 0.3, 0.22)
STEPS = {"yaw": 4e-3, "tilt_x": 4e-4, "tilt_y": 4e-4, "youngs_modulus": 2e-5, "friction": 2e-5, "thickness": 2e-5}
"""Of the central differences, in the parameter's unit; too small for a quadrature point to change its status within."""


MORE = pytest.mark.long("tacdata/skin", reason="more derivatives, each beside two more presses")
EXACT = SolverSettings(residual=1e-9, penetration=1e-7, mean_penetration=1e-7)


def model(friction=0.0):
    sensor = slab_sensor(size=4.0, friction=friction, pixels=9)
    # Steps are longer than the differences of PATH, so that a deeper press takes no step more.
    settings = ModelSettings(solver=EXACT, step=0.16, error_estimate=False)
    return SkinModel(sensor, settings, mesh=box_mesh(sensor, 4, 4, 2))


def press(depths=PATH, indenter=EGG):
    return PressRequest(indenter, 0.13, -0.21, 17.0, depths)


def moved(skin, request, name, step, number):
    """A whole press with one parameter moved, none of it by derivatives."""
    whole = skin.skin.placed(number, request)
    material, rub, shape, thickness = skin.sensor.material, skin.sensor.contact.friction, request.indenter, 1.0
    depths, touch, turn = request.depths, whole.touch.copy(), {"yaw": request.yaw, "tilt_x": 0.0, "tilt_y": 0.0}
    if name in ("x", "y"):
        touch["xy".index(name)] += step
    elif name == "z":
        depths = tuple(depth - step for depth in depths)
    elif name in turn:
        turn[name] += step
    elif name == "thickness":
        thickness += step / skin.sensor.skin.thickness
        touch[2] += step
    elif name == "friction":
        rub += step
    elif name.startswith("indenter/"):
        name = name.removeprefix("indenter/")
        shape = replace(shape, **{name: getattr(shape, name) + step})
    else:
        material = replace(material, **{name: getattr(material, name) + step})
    angles = (torch.tensor([np.radians(angle)], dtype=torch.float64) for angle in turn.values())
    return replace(
        whole,
        path=LoadPath(depths, skin.settings.step, ""),
        touch=touch,
        turn=turned(*angles)[..., 0].numpy(),
        conditions=conditions(material, rub, shape, thickness),
    )


def picture(skin, state):
    return skin.skin.face.depth_map(skin.sensor.map.x, skin.sensor.map.y, state.displacement)


def differences(skin, request, names):
    """Of [force, map, taxel forces, closures], by name at every state; all presses at once, each as if alone."""
    steps = [(name, sign * STEPS.get(name, 2e-6)) for name in names for sign in (1, -1)]
    presses = [moved(skin, request, *step, number) for number, step in enumerate(steps)]
    batch = skin.skin.batch([request], len(presses))
    states = [[] for _ in presses]
    for number, _, state in batch.run(presses, skin.skin.reader.states):
        states[number].append((state.force, picture(skin, state), state.taxel_force, state.taxel_closure))
    return {
        name: [[(up - down) / (2 * step) for up, down in zip(*pair, strict=True)] for pair in zip(*both, strict=True)]
        for (name, step), *both in zip(steps[::2], states[::2], states[1::2], strict=True)
    }


def assert_alike(skin, request, names, share):
    """Within ``share`` of the largest entry, at every state."""
    states, wholes = list(sensitivities(skin, request, names)), differences(skin, request, names)
    assert [depth for depth, _, _ in states] == list(request.depths)
    for column, name in enumerate(names):
        for (depth, _, found), expected in zip(states, wholes[name], strict=True):
            assert found.error <= 1e-5
            own = [found.force, found.surface, found.taxel_force, found.taxel_closure]
            for value, wanted in zip(own, expected, strict=True):
                assert value[column] == pytest.approx(wanted, abs=share * np.abs(wanted).max() + 1e-7), (name, depth)


@pytest.mark.parametrize(
    "names",
    [
        ["x", "tilt_y", "thickness", "poisson_ratio", "indenter/c"],
        pytest.param(["y", "z", "yaw", "tilt_x", "indenter/a"], marks=MORE),
    ],
    ids=" ".join,
)
def test_a_smooth_press_by_pose_sizes_and_material(names):
    assert_alike(model(), press(), names, 0.01)


def test_a_derivative_by_itself_is_as_exact_as_beside_others():
    assert_alike(model(), press((0.1, 0.2)), ["tilt_x"], 0.002)


@pytest.mark.long("tacdata/skin", reason="seven derivatives, each beside two more presses")
def test_a_press_with_friction_on_its_whole_path():
    names = ["x", "z", "tilt_y", "thickness", "poisson_ratio", "friction", "indenter/c"]
    assert_alike(model(friction=0.2), press(), names, 0.03)


def test_forces_are_proportional_to_the_modulus_and_displacements_do_not_know_it():
    """Exact for the equations; what is left are the residuals of press and linear solve."""
    skin = model(friction=0.2)
    for _, state, found in sensitivities(skin, press(), ["youngs_modulus", "poisson_ratio"]):
        assert found.force[0] == pytest.approx(state.force / 0.30, abs=1e-5 * state.force[2] / 0.30)
        assert np.abs(found.surface[0]).max() < 1e-4 * np.abs(found.surface[1]).max()


@MORE
def test_taxels_feel_where_the_press_is(bumps):
    """Forces and closures of four protrusions on a board, with friction, against presses a little beside."""
    settings = replace(bumps.settings, solver=EXACT, step=0.16, error_estimate=False)
    skin = SkinModel(bumps.sensor, settings, mesh=bumps.mesh)
    request = PressRequest(Sphere(2.0), 0.5, 0.45, 0.0, (0.15, 0.3))
    assert_alike(skin, request, ["x", "z", "thickness"], 0.03)


def test_contact_areas_grow_with_the_load(bumps):
    """By Hertz's law: not with the modulus, and by two thirds of the force's share."""
    request = PressRequest(Sphere(2.0), 0.5, 0.45, 0.0, (0.4,))
    [(_, state, found)] = sensitivities(bumps, request, ["youngs_modulus", "z"])
    assert np.abs(found.taxel_area[0]).max() < 0.01 * state.taxel_area.max() / 0.30
    assert found.taxel_area[1] / state.taxel_area == pytest.approx(2 / 3 * found.taxel_force[1] / state.taxel_force)


def test_what_does_not_touch_has_no_derivatives():
    [(_, _, found)] = sensitivities(model(), press((0.0,)), ["x", "z", "youngs_modulus"])
    assert not found.force.any() and not found.surface.any()


def test_parameters_say_their_units_and_unknown_ones_are_refused():
    skin = model()
    [(_, _, found)] = sensitivities(skin, press((0.05,)), ["z", "yaw", "indenter/a"])
    assert found.parameters == ("z", "yaw", "indenter/a") and found.units == ("mm", "deg", "mm or deg")
    assert "indenter/radius" in known(skin.sensor, Sphere(2.0))
    with pytest.raises(UsageError, match="radius"):
        list(sensitivities(skin, press(), ["indenter/radius"]))
    with pytest.raises(UsageError, match="without friction"):
        list(sensitivities(skin, press(), ["friction"]))


@pytest.mark.parametrize(
    ("law", "values", "name"),
    [
        ("mooney_rivlin", {"c01_share": 0.3}, "material/c01_share"),
        pytest.param("ogden", {"exponent": [1.3, 5.0], "share": [0.8, 0.2]}, "material/exponent/1", marks=MORE),
    ],
)
def test_a_laws_own_parameters(law, values, name):
    step, request, smooth = 1e-3, press((0.1, 0.2)), model()

    def states(by):
        field, _, entry = name.removeprefix("material/").partition("/")
        new = values[field] + by if not entry else [v + by * (k == int(entry)) for k, v in enumerate(values[field])]
        material = replace(smooth.sensor.material, law=law, parameters={**values, field: new})
        skin = SkinModel(replace(smooth.sensor, material=material), smooth.settings, mesh=smooth.mesh)
        return skin, [state.force for _, state in skin.states(request)] if by else []

    (_, up), (_, down), (skin, _) = states(step), states(-step), states(0.0)
    for above, below, (_, _, found) in zip(up, down, sensitivities(skin, request, [name]), strict=True):
        wanted = (above - below) / (2 * step)
        assert found.force[0] == pytest.approx(wanted, abs=0.01 * np.abs(wanted).max())


def test_a_parameter_that_cannot_move_alone_is_refused():
    sensor = model().sensor
    material = replace(sensor.material, law="ogden", parameters={"exponent": [1.3, 5.0], "share": [0.8, 0.2]})
    skin = SkinModel(replace(sensor, material=material), model().settings, mesh=model().mesh)
    with pytest.raises(FormatError, match="shares add up"):
        list(sensitivities(skin, press(), ["material/share/0"]))
