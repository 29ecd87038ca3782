"""Wrong steps per millimetre."""

from tacdata.effects.effect import Effect, Family, Parameter, Scale, State, Values


class TravelScale(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "amplitude"
    family = Family.KINEMATICS
    memoryless = True
    equation = "(x, y, d) -> (1 + k) (x, y, d)"
    experiment = "a gauge block, or a tag, over a long travel"
    form_error = 0.02
    parameters = (Parameter("k", "1", "relative error of travel", 0.02, -0.3, 0.3),)
    scale = Scale.DRIVE
    seen_by_tag = True

    def apply(self, state: State, values: Values) -> State:
        return state.with_pose(state.pose * (1 + values["k"]))
