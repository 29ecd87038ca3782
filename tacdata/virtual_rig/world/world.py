"""The emulated world: a skin that responds to the true position of the emulated indenter.

Its model is not the FEM that makes the labels: a stiffening bed of springs under the indenter, Boussinesq's spreading
of stress with depth (K. L. Johnson, Contact Mechanics, eq. 2.22), Hertzian protrusions (ibid., eq. 4.23), parallel
plates with a parasitic capacitance, a Prony series in time, gain spread, drift, noise and quantisation.

The pipeline sees it through the wires only; `Truth` is written into the rig's folder for tests.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from tacdata.rig import Registration
from tacdata.sensor import Sensor

GRID = 0.2
"""Spacing of the pressure grid [mm]."""
PRONY = ((0.10, 0.15), (0.07, 2.0), (0.05, 20.0))
"""Relaxing share of the force [1] and its time [s]."""
FULL_SCALE = 65535


@dataclass(frozen=True)
class Truth:
    """True parameters of the world, drawn from a seed."""

    seed: int
    registration: Registration
    """True pose of the sensor in the guide's frame."""
    mount_yaw: float
    """Error of every mounted indenter's yaw [deg]."""
    stiffness: float
    """Pressure per depth of the skin at first touch [N/mm^3]."""
    thickness: float
    """Thickness at which the skin would be crushed flat [mm]."""
    spread: float
    """Depth in Boussinesq's spreading [mm]."""
    protrusion: float
    """Force per closure^1.5 of a protrusion [N/mm^1.5]."""
    half_closure: float
    """Closure at which half of the closable gap is closed [mm]."""
    gain: tuple[float, ...]
    """Counts per relative change of capacitance [counts], one a taxel."""
    offset: tuple[float, ...]
    """Reading without contact [counts], one a taxel."""
    noise: float
    """Standard deviation of a reading [counts]."""
    drift: float
    """Standard deviation of the slow drift of a reading, over a minute [counts]."""

    @property
    def document(self) -> dict[str, Any]:
        """The truth as plain data."""
        values = asdict(self)
        values["gain"], values["offset"] = list(self.gain), list(self.offset)
        values["registration"]["origin"] = list(self.registration.origin)
        values["registration"]["tilt"] = list(self.registration.tilt)
        return values


ROUGH = (0.7, 0.7, 0.5), 3.0, 0.02
"""Largest errors of a sensor that was only put down: x, y, z [mm], yaw [deg], tilt [mm/mm]."""


def put_down(seed: int, nominal: Registration) -> Registration:
    """Return the pose of a sensor that was put down by eye and never registered."""
    rng = np.random.default_rng([seed, 8])
    shift, turn = rng.uniform(-1, 1, 3) * ROUGH[0], rng.uniform(-1, 1) * ROUGH[1]
    tilt = rng.uniform(-1, 1, 2) * ROUGH[2]
    x, y, z = (np.array(nominal.origin) + shift).tolist()
    a, b = tilt.tolist()
    return Registration((x, y, z), float(nominal.yaw + turn), (a, b))


def draw(seed: int, sensor: Sensor, nominal: Registration, rough: bool = False) -> Truth:
    """Draw a world around a nominal registration, with the small errors of a good lab.

    Args:
        seed: Same seed, same world.
        sensor: The sensor in it.
        nominal: The registration that the lab measured.
        rough: Whether the sensor was only put down (`put_down`), so that it must be registered first.
    """
    rng = np.random.default_rng([seed, 1])
    # The modulus that contacts see (Hertz).
    modulus = sensor.material.youngs_modulus / (1 - sensor.material.poisson_ratio**2)
    error = rng.normal(0, (0.05, 0.05, 0.02))
    careful = Registration(
        tuple(float(a + b) for a, b in zip(nominal.origin, error, strict=True)),  # ty: ignore[invalid-argument-type]
        float(nominal.yaw + rng.normal(0, 0.25)),
    )
    return Truth(
        seed=seed,
        registration=put_down(seed, nominal) if rough else careful,
        mount_yaw=float(rng.normal(0, 0.4)),
        stiffness=float(modulus / sensor.skin.thickness * rng.uniform(0.9, 1.1)),
        thickness=float(1.4 * sensor.skin.thickness),
        spread=float(sensor.skin.thickness * rng.uniform(0.5, 0.6)),
        protrusion=float(4 / 3 * modulus * np.sqrt(max(sensor.skin.protrusion_radius, 0.1)) * rng.uniform(0.9, 1.1)),
        half_closure=float(rng.uniform(0.5, 0.6)),
        gain=tuple((4000 * rng.normal(1, 0.08, sensor.taxels.count).clip(0.7, 1.3)).tolist()),
        offset=tuple(rng.normal(9000, 500, sensor.taxels.count).tolist()),
        noise=5.0,
        drift=4.0,
    )


class IndenterProfile(Protocol):
    """Indenter, as far as the skin needs it (`tacdata.indenters.Indenter` provides it)."""

    @property
    def extent(self) -> float:
        """Largest horizontal distance of the solid from its axis [mm]."""
        ...

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height of the lower surface over (x, y) [mm]."""
        ...


class World:
    """The skin over time. Call `readings` in the order of time."""

    def __init__(self, truth: Truth, sensor: Sensor) -> None:
        """Create a sensor of this geometry with these true properties."""
        self.truth = truth
        self.x = np.arange(-sensor.skin.size_x / 2, sensor.skin.size_x / 2 + GRID / 2, GRID)
        self.y = np.arange(-sensor.skin.size_y / 2, sensor.skin.size_y / 2 + GRID / 2, GRID)
        centers = sensor.taxels.centers
        dx, dy = centers[:, 0, None, None] - self.x[:, None], centers[:, 1, None, None] - self.y
        h, cell = truth.spread, sensor.taxels.pitch_x * sensor.taxels.pitch_y
        stress = 3 / (2 * np.pi * h**2) * (1 + (dx**2 + dy**2) / h**2) ** -2.5
        self.share = stress * cell * GRID**2  # force on taxel k per pressure at (i, j) [mm^2]
        self._rng = np.random.default_rng([truth.seed, 2])
        self._elastic = np.zeros(len(centers))
        self._branches = np.zeros((len(PRONY), len(centers)))
        self._wander = np.zeros(len(centers))
        self._time_ns: int | None = None

    def taxel_force(self, tip: np.ndarray, indenter: IndenterProfile | None, yaw: float) -> np.ndarray:
        """Return the instantaneous elastic force on each protrusion [N], shape (taxels,).

        Args:
            tip: True carriage position [mm, machine], shape (3,): the indenter's lowest point.
            indenter: The mounted indenter, or None.
            yaw: Nominal yaw of the mounting [deg].
        """
        x, y, depth = self.truth.registration.to_sensor(tip[None])[0]
        if indenter is None or depth <= 0:
            return np.zeros(len(self._elastic))
        i, j = _window(self.x, x, indenter.extent), _window(self.y, y, indenter.extent)
        angle = np.radians(yaw + self.truth.mount_yaw)
        dx, dy = self.x[i, None] - x, self.y[None, j] - y
        height = indenter.profile(np.cos(angle) * dx + np.sin(angle) * dy, np.cos(angle) * dy - np.sin(angle) * dx)
        depression = np.minimum(np.maximum(depth - height, 0.0), 0.9 * self.truth.thickness)
        pressure = self.truth.stiffness * depression / (1 - depression / self.truth.thickness)
        return np.tensordot(self.share[:, i, j], pressure, axes=2)

    def readings(self, tip: np.ndarray, indenter: IndenterProfile | None, yaw: float, time_ns: int) -> np.ndarray:
        """Return one raw frame [counts], shape (taxels,), of a tip position [mm, machine] at a time [ns]."""
        force = self._relaxed(self.taxel_force(tip, indenter, yaw), time_ns)
        closure = (np.maximum(force, 0.0) / self.truth.protrusion) ** (2 / 3)
        closed = closure / (closure + self.truth.half_closure)
        capacitance = 1 / (1 - 0.8 * closed) - 1  # relative change between parallel plates
        clean = np.array(self.truth.offset) + np.array(self.truth.gain) * capacitance + self._wander
        noisy = clean + self._rng.normal(0, self.truth.noise, len(clean))
        return np.clip(np.round(noisy), 0, FULL_SCALE)

    def _relaxed(self, elastic: np.ndarray, time_ns: int) -> np.ndarray:
        dt = 0.0 if self._time_ns is None else max((time_ns - self._time_ns) * 1e-9, 0.0)
        change, self._elastic, self._time_ns = elastic - self._elastic, elastic, time_ns
        for n, (share, tau) in enumerate(PRONY):
            decay = np.exp(-dt / tau)
            mean = (1 - decay) * tau / dt if dt > 0 else 1.0  # mean of the decay over the step, for a ramp within it
            self._branches[n] = decay * self._branches[n] + mean * share * change
        keep = np.exp(-dt / 60.0)
        fresh = self._rng.normal(0, 1, len(elastic))
        self._wander = keep * self._wander + self.truth.drift * np.sqrt(1 - keep**2) * fresh
        lasting = 1 - sum(share for share, _ in PRONY)
        return lasting * elastic + self._branches.sum(axis=0)


def _window(grid: np.ndarray, center: float, extent: float) -> slice:
    first, last = np.searchsorted(grid, (center - extent - GRID, center + extent + GRID))
    return slice(int(first), int(last))
