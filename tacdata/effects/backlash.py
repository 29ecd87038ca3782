"""Play of the depth drive."""

from tacdata.chain.memory import dead_band
from tacdata.effects.effect import AtRest, Effect, Family, Parameter, State, Values


class Backlash(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = "d = play_{b/2}(z) + b/2: after reversal nothing moves for b"
    source = "play operator; Brokate & Sprekels, Hysteresis and Phase Transitions, ch. 2"
    experiment = (
        "overshoot and return to the same depth; three rates: constant in depth units, whatever rate, load "
        "and indenter; a tag sees it"
    )
    parameters = (Parameter("b", "mm", "play", 0.03, 0.0, 0.6),)
    at_rest = AtRest.STAYS
    seen_by_tag = True

    def apply(self, state: State, values: Values) -> State:
        half = 0.5 * float(values["b"])
        if half == 0.0:
            return state
        # Half the play is added: on the way down the depth is the commanded one.
        return state.deeper(dead_band(state.depth, half, state.course.dither) + half)
