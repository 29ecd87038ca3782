"""The guide follows its command late, and overshoots a little where that stops."""

from __future__ import annotations

from tacdata.effects.servo_lag import ServoLag


class ServoLagOvershoots(ServoLag):
    """The guide follows its command late, and overshoots a little where that stops."""

    title = "The guide follows its command late and overshoots"
    equation = "d'' / w^2 + tau d' + d = z, w = 1.4 / tau: damped by 0.7"
    source = "standard form; 0.7 is the least damping that drives are tuned to"
    mechanism = "servo_lag"
    damping = 0.7
