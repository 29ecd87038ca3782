"""The skin is stiffer throughout."""

from tacdata.effects.effect import Effect, Family, LikeGain, Parameter, State, Values


class Modulus(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "amplitude"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = "q = (1 + e) q_e"
    source = "linear elasticity: loads scale with the modulus"
    experiment = "a load cell or a kitchen scale under one press; a Shore coupon of the same batch"
    parameters = (Parameter("e", "1", "relative excess of the modulus", 0.1, -0.8, 3.0),)
    like_gain = LikeGain.EQUAL

    def apply(self, state: State, values: Values) -> State:
        # Depths are prescribed, so strains stay and loads scale.
        return state.scaled(1 + values["e"])
