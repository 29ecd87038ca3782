"""Wrong scale of the camera, or the gauge, that sees the tip."""

from dataclasses import replace

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, Scale, State, Values


class ViewScale(Effect):
    stage = "view"
    moves = ("tag",)
    group = "amplitude"
    family = Family.KINEMATICS
    equation = "the view of (x, y, d) is (1 + s) (x, y, d)"
    experiment = "a gauge block, or a second camera: readings do not follow the error of one of two observers"
    form_error = 0.02
    seen_by_tag = True
    parameters = (Parameter("s", "1", "relative error of lengths seen", 0.01, -0.3, 0.3),)
    scale = Scale.OBSERVER

    def apply(self, state: State, values: Values) -> State:
        # The view alone: the tip is where it was.
        return replace(state, view=state.view * (1 + values["s"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "" if course.tag is not None else "the tip is known from the command alone"
