"""Play of the lateral drives."""

from tacdata.chain.memory import dead_band
from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class LateralBacklash(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal")
    group = "lateral"
    family = Family.FRICTION_AND_PLAY
    memoryless = True
    equation = "x = play_{b/2}(x), y = play_{b/2}(y): half the play aside of the command, on the side it came from"
    source = "play operator"
    experiment = "the same place approached from +x, -x, +y, -y"
    parameters = (Parameter("b", "mm", "play", 0.05, 0.0, 0.6),)
    seen_by_tag = True

    def apply(self, state: State, values: Values) -> State:
        half = 0.5 * float(values["b"])
        if half == 0.0:
            return state
        pose = state.pose.copy()
        # Nothing is added here, as in depth: a place may be approached from either side.
        for axis in (0, 1):
            pose[:, axis] += dead_band(pose[:, axis], half, float(state.course.dithers[axis]))
        return state.with_pose(pose)
