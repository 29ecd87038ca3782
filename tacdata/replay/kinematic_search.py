"""Joint values nearest to fingertip targets: Levenberg-Marquardt steps, each within the joints' limits.

A step that does not reduce the error is rejected and repeated with more damping (D. W. Marquardt, SIAM Journal on
Applied Mathematics 11 (1963) 431). So the search for an unreachable target ends at the nearest configuration that the
steps lead to, and the next target starts from there.
"""

from __future__ import annotations

import numpy as np

from tacdata.replay.kinematics import Kinematics

STEPS = 60
"""Largest number of steps from one start [count]; the first time gets ten times as many."""
REST = 1e-7
"""Step size below which the search has converged [rad or m]."""
THERE = 1e-16
"""Sum of squared errors below which the search ends [m^2]."""
DAMPING = 1e-6, 1e4
"""Initial damping, and the damping at which the search ends [m^2]."""
LONGER, SHORTER = 0.25, 8.0
"""Factors of the damping after an accepted and after a rejected step [1]."""
OTHERS = 4
"""Random starts where a target is not reached [count]."""
COUPLING = 10.0
"""Weight of a mimic joint's deviation relative to a metre [m/rad or 1]."""
SOLVER = "daqp"


class KinematicSearch:
    """Moves a robot's joints so that its fingertips come to their targets."""

    def __init__(self, model: Kinematics) -> None:
        """Begin at the model's home."""
        import mink

        self._mink, self.model = mink, model
        weight = model.robot.orientation_weight
        self._tips = [
            mink.FrameTask(f"tip {name}", "site", position_cost=1.0, orientation_cost=weight) for name in model.fingers
        ]
        self._coupled = mink.EqualityConstraintTask(model.model, cost=COUPLING) if model.model.neq else None
        self._tasks = [*self._tips, *([self._coupled] if self._coupled else [])]
        self._limits = [mink.ConfigurationLimit(model.model)]
        self._state = mink.Configuration(model.model, q=model.home)

    def aim(self, places: np.ndarray, turns: np.ndarray) -> None:
        """Set the targets in the robot's root frame: positions [m], shape (f, 3), and rotations, shape (f, 3, 3)."""
        mink = self._mink
        for task, place, turn in zip(self._tips, places, turns, strict=True):
            task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(turn), place))

    def settle(self, begin: np.ndarray, steps: int = STEPS) -> tuple[np.ndarray, float]:
        """Return the joint values that the steps from ``begin`` lead to, shape (joints,), and the cost there [m^2]."""
        values, damping = np.array(begin, float), DAMPING[0]
        self._state.update(values)
        cost = self._cost()
        for _ in range(steps):
            if cost < THERE or damping > DAMPING[1]:
                break
            step = self._step(damping)
            if step is None:
                damping *= SHORTER
                continue
            tried = self._state.integrate(step, 1.0)
            self._state.update(tried)
            trial_cost, stride = self._cost(), float(np.abs(step).max())
            if trial_cost < cost:
                values, cost, damping = tried, trial_cost, max(damping * LONGER, DAMPING[0] * 1e-3)
            else:
                self._state.update(values)
                damping *= SHORTER
            if stride < REST:
                break
        return values, cost

    def errors(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the errors of joint values: targets [m] and [rad], shapes (f,), and mimic joints [rad or m]."""
        self._state.update(values)
        residuals = np.array([task.compute_error(self._state) for task in self._tips])
        coupling_error = 0.0 if self._coupled is None else float(np.abs(self._coupled.compute_error(self._state)).max())
        return np.linalg.norm(residuals[:, :3], axis=1), np.linalg.norm(residuals[:, 3:], axis=1), coupling_error

    def drawn(self, rng: np.random.Generator) -> np.ndarray:
        """Return random joint values within the limits, or half a turn, shape (joints,).

        Joints that move no fingertip stay at home: a leg must not move because a finger cannot reach.
        """
        values = self.model.home
        for k in self.model.moving:
            joint = self.model.joints[k]
            low = -np.pi if joint.lower is None else joint.lower
            values[k] = rng.uniform(low, np.pi if joint.upper is None else joint.upper)
        return values

    def _cost(self) -> float:
        return float(sum(np.sum((task.cost * task.compute_error(self._state)) ** 2) for task in self._tasks))

    def _step(self, damping: float) -> np.ndarray | None:
        """Return the step [rad or m], shape (joints,); None where there is none within the limits."""
        mink = self._mink
        try:
            return mink.solve_ik(self._state, self._tasks, 1.0, SOLVER, damping=damping, limits=self._limits)
        except mink.NoSolutionFound:
            return None
