"""Creep: readings go on growing at constant depth, and come back late."""

from dataclasses import replace

from tacdata.chain.memory import low_pass
from tacdata.effects.effect import AtRest, Course, Effect, Family, Parameter, Response, State, Values


class Creep(Effect):
    stage = "mechanics"
    moves = ("signal",)
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f (q_e - L_tau q_e): a share f follows the path late"
    source = "standard linear solid seen by its strain; Ferry, Viscoelastic Properties of Polymers, ch. 3"
    experiment = (
        "a hold of five time constants and as long a recovery, at three rates: a lag that does not shrink "
        "with the rate, and a reading that grows in the hold where relaxation lets it fall"
    )
    parameters = (
        Parameter("f", "1", "late share", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.4, 1.0, 2.5, 6.0, 16.0, 60.0)),
    )
    at_rest = AtRest.GOES_ON

    def apply(self, state: State, values: Values) -> State:
        lag = state.load - low_pass(state.load, state.course.step, float(values["tau"]))
        # Readings alone: the force of a path in depth does not creep with them.
        return replace(state, load=state.load - values["f"] * lag)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "a single row an episode" if course.rows <= 2 * course.episodes else ""
