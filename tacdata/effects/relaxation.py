"""Stress relaxation, one exponential."""

import numpy as np

from tacdata.chain.contact import let_go
from tacdata.chain.memory import low_pass, low_passes
from tacdata.effects.effect import AtRest, Course, Effect, Family, Parameter, Response, State, Values

POWER = Parameter("m", "1", "power of load by which readings grow", 1.0, 0.3, 4.0, grid=(0.67, 1.0, 1.5))
"""Power of the transducer: 2/3 if a protrusion closes a gap by Hertz's law, above 1 if a gap is nearly closed."""


class Relaxation(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f L_tau q_e, L_tau the first-order mean with time constant tau"
    source = "standard linear solid; Ferry, Viscoelastic Properties of Polymers, ch. 3"
    experiment = (
        "a hold of five time constants and as long a recovery, at two depths and three rates: the plateau is "
        "not zero and the relaxed share is the same at every depth; force relaxes with the skin, not with the "
        "taxel's dielectric"
    )
    parameters = (
        Parameter("f", "1", "relaxed share", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.15, 0.4, 1.0, 2.5, 6.0, 16.0, 40.0, 120.0)),
    )
    at_rest = AtRest.RELAXES
    times_by_radius = 0.0

    def apply(self, state: State, values: Values) -> State:
        loads = state.loads
        # The force with the loads: it is the skin that relaxes, not its taxels.
        return state.with_loads(loads - values["f"] * low_pass(loads, state.course.step, float(values["tau"])))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "a single row an episode" if course.rows <= 2 * course.episodes else ""


class RelaxationLetGo(Relaxation):
    """Stress relaxation, one exponential, of a skin that the tool can leave."""

    equation = "q = q_e - f L_tau q_e where that force pushes, 0 where it would pull"
    source = "standard linear solid; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"

    def apply(self, state: State, values: Values) -> State:
        return let_go(super().apply(state, values))

    def unjudgeable(self, course: Course, response: Response) -> str:
        reason = super().unjudgeable(course, response)
        return reason or ("loads are not known: read by a transducer of any power" if response.fitted else "")


class RelaxationRead(Relaxation):
    """Stress relaxation, one exponential, of a skin that the tool can leave, read by a transducer of any power."""

    equation = "r = max(0, F - f L_tau F)^m, F = r_e^(1/m), of each channel"
    source = "standard linear solid; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"
    parameters = (
        Parameter("f", "1", "relaxed share of load", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.4, 2.5, 16.0, 60.0)),
        POWER,
    )
    times_by_radius = None  # of loads that are not known

    def apply(self, state: State, values: Values) -> State:
        loads, power = state.loads, float(values["m"])
        size = np.abs(loads).max(axis=0)
        # Loads only push: the sign of a channel is the sign of its largest reading.
        largest = loads[np.abs(loads).argmax(axis=0), np.arange(loads.shape[1])]
        scale = np.where(size > 0, np.copysign(size, largest), 1.0)
        # From 0 to 1, as a power of a number with a unit has no meaning.
        share = loads / scale
        load = np.copysign(np.abs(share) ** (1 / power), share)
        net = load - values["f"] * self.late(load, state.course.step, values)
        # A reading on the other side of idle is no load, and stays as it is.
        net = np.where(load > 0, np.maximum(net, 0.0) ** power, share)
        return state.with_loads(net * scale)

    def late(self, load: np.ndarray, step: np.ndarray, values: Values) -> np.ndarray:
        """Return the relaxing mean of the past loads, of the same shape."""
        return low_pass(load, step, float(values["tau"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return super().unjudgeable(course, response) if response.fitted else "loads are known, whatever reads them"


class NonlinearRelaxation(Effect):
    """Stress relaxation that grows with depth."""

    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f L_tau (q_e d / D), D the deepest depth"
    source = "quasi-linear form; Fung, Biomechanics, ch. 7"
    experiment = "step and hold at four depths on fresh sites"
    parameters = (
        Parameter("f", "1", "relaxed share at the deepest depth", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.4, 2.5, 16.0, 60.0)),
    )
    at_rest = AtRest.RELAXES
    times_by_radius = 0.0
    memory_by_depth = True

    def apply(self, state: State, values: Values) -> State:
        loads = state.loads
        # Inside the mean: a share relaxes by the depth at which it was pressed, not by the present one.
        share = np.maximum(state.depth, 0.0)[:, None] / state.course.span
        loads = loads - values["f"] * low_pass(loads * share, state.course.step, float(values["tau"]))
        return state.with_loads(loads)


class PowerCreep(Effect):
    """Stress relaxation over many decades."""

    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f mean of L_tau q_e over tau in geometric steps of 3 from tau0 to 243 tau0"
    source = "broad spectrum; Ferry, ch. 4"
    experiment = (
        "a hold of five time constants and as long a recovery, at two depths and three rates: the plateau is "
        "not zero and the relaxed share is the same at every depth"
    )
    parameters = (
        Parameter("f", "1", "relaxed share over the decades", 0.15, 0.0, 0.95),
        Parameter("tau0", "s", "shortest time constant", 0.1, 0.01, 10.0, grid=(0.05, 0.3, 2.0)),
    )
    at_rest = AtRest.RELAXES
    times_by_radius = 0.0

    def apply(self, state: State, values: Values) -> State:
        loads = state.loads
        # Together these exponentials follow a power of time over 2.4 decades.
        taus = float(values["tau0"]) * 3.0 ** np.arange(6)
        return state.with_loads(loads - values["f"] * low_passes(loads, state.course.step, taus, np.full(6, 1 / 6)))


class PowerCreepLetGo(PowerCreep):
    """Stress relaxation over many decades, of a skin that can separate."""

    equation = "q = q_e - f mean of L_tau q_e over six times in steps of 3, 0 where the force would pull"
    source = "broad spectrum; Ferry, ch. 4; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"

    def apply(self, state: State, values: Values) -> State:
        return let_go(super().apply(state, values))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "loads are not known: read by a transducer of any power" if response.fitted else ""


class PowerCreepRead(RelaxationRead):
    """Stress relaxation over many decades, of a skin that the tool can leave, read by a transducer of any power."""

    equation = "r = max(0, F - f mean of L_tau F over six times in steps of 3)^m, F = r_e^(1/m), of each channel"
    source = "broad spectrum; Ferry, ch. 4; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"
    parameters = (*PowerCreep.parameters, POWER)

    def late(self, load: np.ndarray, step: np.ndarray, values: Values) -> np.ndarray:
        """Return the relaxing mean of the past loads, of the same shape."""
        return low_passes(load, step, float(values["tau0"]) * 3.0 ** np.arange(6), np.full(6, 1 / 6))
