"""The guide lost steps at some moment."""

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class LostSteps(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz from a share s of the episodes on"
    experiment = "home again, and repeat the reference press"
    form_error = 0.02
    odds = 0.1  # drives lose steps when they are overloaded: machines are built not to, and any moment will do
    parameters = (
        Parameter("dz", "mm", "lost", 0.05, -1.0, 1.0),
        Parameter(
            "s", "1", "share of the episodes before it", 0.3, 0.02, 0.98, grid=tuple(0.05 * k for k in range(1, 20))
        ),
    )
    follows_clock = True
    seen_by_tag = True

    def apply(self, state: State, values: Values) -> State:
        # From one episode on, all later ones: nothing brings lost steps back.
        loss = state.course.episode >= values["s"] * state.course.episodes
        return state.deeper(values["dz"] * loss)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "a single episode" if course.episodes < 2 else ""
