"""Lag of the drive: the guide follows its command late."""

from tacdata.chain.memory import second_order
from tacdata.effects.effect import AtRest, Effect, Family, Parameter, State, Values


class ServoLag(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "lag"
    family = Family.DELAY_AND_FILTER
    word = "lag of the drive"
    equation = "(tau / 2)^2 d'' + tau d' + d = z: critically damped"
    experiment = "the same speed with other accelerations; a tag on the carriage sees a drive's lag"
    parameters = (Parameter("tau", "s", "time constant", 0.05, 0.0, 1.0),)
    at_rest = AtRest.CATCHES_UP
    seen_by_tag = True
    damping = 1.0
    """Damping of the loop; 1 is critical [1]."""

    def apply(self, state: State, values: Values) -> State:
        tau = float(values["tau"])
        if tau <= 0.0:
            return state
        pose = state.pose.copy()
        # From rest at the height of the first row.
        way, step = pose[:, 2] - pose[0, 2], state.course.step
        pose[:, 2] = pose[0, 2] + second_order(way, step, tau, self.damping)
        return state.with_pose(pose)


class ServoLagOvershoots(ServoLag):
    """The guide follows its command late and overshoots."""

    equation = "d'' / w^2 + tau d' + d = z, w = 1.4 / tau: damped by 0.7"
    source = "standard form; 0.7 is the least damping that drives are tuned to"
    damping = 0.7
