"""Which presses a skin can take."""

from __future__ import annotations

import numpy as np

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.contact.first_touch import reach, thickness_at
from tacdata.skin.press import PressRequest

_STEEPEST = 30.0
"""Largest tilt [deg]; beyond, the depth of the lowest point does not describe a press."""


def check_press(request: PressRequest, sensor: Sensor) -> None:
    """Refuse a press that misses the skin, goes through it, or lets it close over the shape.

    Raises:
        SolveError: Saying which.
    """
    skin = sensor.skin
    if not request.depths or not np.all(np.isfinite(request.depths)):
        raise SolveError(f"depths {request.depths} mm", "one or more depths of 0 mm or more", "correct the press")
    if min(request.depths) < 0 and sensor.contact.adhesion is None:
        raise SolveError(
            f"a depth of {min(request.depths):g} mm, above a skin that does not stick",
            "0 mm or more",
            "correct the press, or state contact/adhesion in the sensor file",
        )
    angles = f"yaw {request.yaw} deg, tilts {request.tilt_x} and {request.tilt_y} deg"
    if not np.all(np.isfinite([request.x, request.y, request.yaw, request.tilt_x, request.tilt_y])):
        raise SolveError(f"press at ({request.x}, {request.y}) mm, {angles}", "finite numbers", "correct the press")
    if max(abs(request.tilt_x), abs(request.tilt_y)) > _STEEPEST:
        raise SolveError(f"a press with {angles}", f"tilts of at most {_STEEPEST:g} deg", "reduce the tilt")
    if abs(request.x) > skin.size_x / 2 or abs(request.y) > skin.size_y / 2:
        raise SolveError(
            f"press at ({request.x:g}, {request.y:g}) mm, the skin spans {skin.size_x:g} x {skin.size_y:g} mm",
            "a place on the skin",
            "move the press",
        )
    thick = thickness_at(sensor, request)
    if max(request.depths) >= thick:
        raise SolveError(
            f"depth {max(request.depths):g} mm in a skin {thick:.3g} mm thick at ({request.x:g}, {request.y:g}) mm",
            f"less than {thick:.3g} mm",
            "reduce the depth",
        )
    high = request.indenter.height
    if max(request.depths) > high + 1e-9:
        raise SolveError(
            f"depth {max(request.depths):g} mm of a {request.indenter.shape} that is {high:g} mm high: all of it lies "
            "in the skin, and nothing says what holds it",
            f"at most {high:g} mm",
            "reduce the depth, or give a mesh of the shape with its holder",
        )
    if "sides" not in sensor.contact.bonded or max(request.depths) <= 0:
        return
    spare = [size / 2 - abs(place) for place, size in ((request.x, skin.size_x), (request.y, skin.size_y))]
    # An upright shape that is wholly inside needs no search for the part of it that presses.
    if not (request.tilt_x or request.tilt_y) and request.indenter.extent <= min(spare):
        return
    half_x, half_y = reach(sensor, request)
    excess = half_x - spare[0], half_y - spare[1]
    # Beyond a bonded rim the shape would press the frame, which the model does not have.
    if max(excess) > 0:
        raise SolveError(
            f"{request.indenter.shape} at ({request.x:g}, {request.y:g}) mm, {max(request.depths):g} mm deep, reaches "
            f"{max(excess):.2f} mm over the rim, which is bonded to the frame",
            f"a footprint of {half_x:.2f} x {half_y:.2f} mm around the press inside the rim",
            "move the press inward, press less deep, or describe another bonding in the sensor file",
        )
