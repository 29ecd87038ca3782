"""The guide's height changes over its bed."""

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class GantrySag(Effect):
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    memoryless = True
    equation = "d -> d + k (x^2 + y^2) / L^2, L the largest distance from the centre"
    experiment = "move the sensor on the bed: a sag stays with the machine"
    parameters = (Parameter("k", "mm", "height at the largest distance", 0.03, -0.5, 0.5),)

    def apply(self, state: State, values: Values) -> State:
        square = (state.pose[:, :2] ** 2).sum(axis=1)
        # Over the largest distance pressed, so that k is a height that was reached.
        return state.deeper(values["k"] * square / max(float(square.max()), 1e-9))
