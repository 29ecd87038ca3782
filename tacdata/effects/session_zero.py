"""Depth zero changes between sessions."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values

LEAST = 4
"""Least number of sessions: fewer have no more freedom than a shift from one to the next."""


class SessionZero(Effect):
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz (session - mean session)"
    experiment = "home and touch off several times"
    form_error = 0.02
    parameters = (Parameter("dz", "mm", "from one session to the next", 0.05, -1.0, 1.0),)

    def apply(self, state: State, values: Values) -> State:
        # About their mean: a shift common to all sessions is another effect, `z_offset`.
        number = state.course.session[state.course.episode].astype(float)
        return state.deeper(values["dz"] * (number - number.mean()))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "a single session" if course.session.max() < 1 else ""


class SessionLevels(SessionZero):
    """Depth zero of every session is off by itself."""

    equation = "d -> d + sum of dz_k cos(pi k (session + 1/2) / sessions), k of 1 to 3"
    source = "discrete cosine transform: any levels of four sessions; Ahmed et al., IEEE Trans. Comput. C-23 (1974) 90"
    parameters = tuple(Parameter(f"dz{k}", "mm", f"size of pattern {k}", 0.05, -1.0, 1.0) for k in (1, 2, 3))

    def apply(self, state: State, values: Values) -> State:
        session = state.course.session
        turn = np.pi * (session[state.course.episode] + 0.5) / (int(session.max()) + 1)
        shift = sum(values[p.name] * np.cos(k * turn) for k, p in enumerate(self.parameters, 1))
        return state.deeper(np.asarray(shift))

    def unjudgeable(self, course: Course, response: Response) -> str:
        count = int(course.session.max()) + 1
        few = f"{count} sessions: a shift from one to the next explains as much" if count < LEAST else ""
        return "a single session" if count < 2 else few
