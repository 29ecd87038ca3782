"""Error of the depth zero."""

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class ZOffset(Effect):
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    memoryless = True
    equation = "d -> d + dz"
    experiment = (
        "slow approaches at three corners and the centre: a constant onset error is dz, a plane is tilt, one "
        "per channel an air gap"
    )
    form_error = 0.02
    parameters = (Parameter("dz", "mm", "deeper than commanded", 0.05, -1.0, 1.0),)

    def apply(self, state: State, values: Values) -> State:
        return state.deeper(values["dz"])
