"""Warmth stiffens the skin."""

from tacdata.effects.effect import Effect, Family, Parameter, State, Values
from tacdata.effects.temperature_offset import same_temperature


class TemperatureStiffness(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "temperature"
    family = Family.DRIFT
    equation = "q = q_e (1 + k (T - T_mean) / 10)"
    source = "entropic elasticity, G ~ T; Treloar, The Physics of Rubber Elasticity"
    experiment = "readings without contact at several temperatures: they move by electronics, pressed ones by both"
    parameters = (Parameter("k", "1/10K", "relative change over 10 K", 0.03, -0.5, 0.5),)

    def apply(self, state: State, values: Values) -> State:
        return state.scaled(1 + values["k"] * state.course.warmth)

    unjudgeable = same_temperature
