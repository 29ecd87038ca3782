"""Gaussian process of a map's deepest pixel, on features of the loads and of a map that no press has moved.

A network predicts the mean of each pixel. The maximum of means is not the mean of maxima, and the depth at a given load
depends on the unit's skin. So the logarithm of labelled over predicted maximum is a Gaussian process (C. E. Rasmussen,
C. K. I. Williams, 2006) of features of a contact: its depth, region, place and loads.

The predicted maximum is that of the network before it was fitted, with the unit's calibration. On presses that a
network has learned from, its errors are too small to tell those on others. A correction that the network had before
the fit is the prior's mean, and is applied to the fitted one's maxima too.

Far from the presses a ridge regression of the map on the readings errs less. So both logarithms are averaged, each by
its precision on presses left out: the process's falls with its deviation, that of the regression is constant.

Kernel: a constant, a linear part, and a squared exponential. Its size, length and noise are those with the least error
on presses left out. The process's deviation grows away from the presses, and scales intervals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from tacdata.training.frames import ridge
from tacdata.training.frames.contact_features import SHALLOW, features
from tacdata.training.frames.labelled_contacts import BATCH, Contacts, prior_maxima
from tacdata.training.frames.windows import Windows

if TYPE_CHECKING:
    from tacdata.training.networks.network import Correction, Network

FEWEST = 6
"""Presses below which nothing is corrected [count]: with 3 presses the correction did harm on rig 20."""
FOLDS = 5
"""Parts of the presses, each left out once to choose the kernel [count]."""
CONSTANT = 0.3
"""Standard deviation of the constant [1]."""
AMPLITUDES, LENGTHS, SLOPES, NOISES = (0.0, 0.1, 0.25), (0.7, 1.2), (0.1, 0.3, 1.0), (0.05, 0.15, 0.4)
"""Values that are tried of each quantity of `Kernel`."""
FARTHEST = 0.8
"""Largest correction of a maximum, in its logarithm [1]."""
_BEYOND = 3.0
"""Standard deviations beyond which a feature is not extrapolated [1]."""


@dataclass(frozen=True)
class Kernel:
    """Covariance of the logarithm of a maximum between two contacts."""

    amplitude: float
    """Standard deviation of the squared exponential [1]."""
    length: float
    """Its length, in root mean square deviations of the features [1]."""
    slope: float
    """Standard deviation of the linear part [1]."""
    noise: float
    """Standard deviation of a label 1 mm deep [1]; it falls with the root of depth."""

    def nonlinear(self, a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        """Return the squared exponential of standardized features, (n, f) and (m, f) -> (n, m)."""
        square = (a.square().sum(1)[:, None] + b.square().sum(1) - 2.0 * a @ b.T).clamp(min=0.0) / a.shape[1]
        return self.amplitude**2 * torch.exp(square / (-2.0 * self.length**2))

    def __call__(self, a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        """Return the covariances of standardized features, (n, f) and (m, f) -> (n, m)."""
        return self.nonlinear(a, b) + self.slope**2 * (a @ b.T) / a.shape[1] + CONSTANT**2

    def variance(self, a: torch.Tensor) -> torch.Tensor:
        """Return the variances of standardized features, (n, f) -> (n,)."""
        return self.amplitude**2 + self.slope**2 * a.square().mean(1) + CONSTANT**2

    def label_variance(self, peak: torch.Tensor) -> torch.Tensor:
        """Return the variances of labels from their maxima [mm], (n,) -> (n,)."""
        return self.noise**2 / peak.clamp(min=0.1)


@dataclass(frozen=True, eq=False)
class PeakProcess:
    """Correction of a map's maximum by presses of the unit."""

    centers: torch.Tensor
    """Places of the taxels [mm], shape (taxels, 2)."""
    mean: torch.Tensor
    """Mean of each feature over the presses [1], shape (features,)."""
    scale: torch.Tensor
    """Standard deviation of each feature [1], shape (features,)."""
    weight: torch.Tensor
    """Constant and linear part of the process's mean [1], shape (features + 1,)."""
    rows: torch.Tensor
    """Standardized features of frames of the presses [1], shape (n, features)."""
    effect: torch.Tensor
    """Factor of each frame's covariance with a contact [1], shape (n,)."""
    noise: torch.Tensor
    """Variance of each frame's label [1], shape (n,)."""
    kernel: Kernel | None
    """The covariance; None of a linear correction, as releases up to schema 1.5 wrote."""
    origin: Network | None = None
    """The network before the fit; None if the maps are those of the corrected network itself."""
    share: float = 1.0
    """Share of the process in the logarithm of the maximum [1]; the network has the remaining one."""
    linear: torch.Tensor | None = None
    """Ridge regression of the pixels over D_max on (1, readings [counts]), shape (taxels + 1, pixels); None without."""
    balance: float = 1.0
    """Deviation, squared, at which the regression is as precise as the process [1]."""
    _factor: list[torch.Tensor] = field(default_factory=list, repr=False)

    def corrected(
        self, depth: torch.Tensor, signals: torch.Tensor, network: Network, counts: torch.Tensor
    ) -> torch.Tensor:
        """Return maps over D_max with their maxima corrected, (b, pixels_x, pixels_y).

        Args:
            depth: Maps of the network over D_max, shape (b, pixels_x, pixels_y).
            signals: Output of `Network.calibrated`, shape (b, T, taxels).
            network: The network.
            counts: The newest readings [counts], shape (b, taxels).
        """
        maximum, _ = self._answer(*self._features(depth, signals, network, counts), counts)
        if self.prior is not None:
            depth = self.prior.corrected(depth, signals, network, counts)
        return self.rescaled(depth, maximum)

    @property
    def prior(self) -> Correction | None:
        """Correction of the network before the fit, by other presses; None without."""
        return self.origin.peak if self.origin is not None else None

    def moved(self, change: Callable[[torch.Tensor], torch.Tensor]) -> PeakProcess:
        """Return the process with each tensor changed: another device or precision."""
        names = ("centers", "mean", "scale", "weight", "rows", "effect", "noise", "linear")
        values = {name: change(value) for name in names if (value := getattr(self, name)) is not None}
        origin = self.origin._apply(change) if self.origin else None
        return replace(self, **values, origin=origin, _factor=[])

    def rescaled(self, depth: torch.Tensor, maximum: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max with maxima between their present ones and those of the process, (b,)."""
        largest = depth.amax(dim=(1, 2)).clamp(min=SHALLOW)
        ratio = (self.share * (maximum / largest).log()).clamp(-FARTHEST, FARTHEST).exp()
        ratio = torch.where(largest > SHALLOW, ratio, torch.ones_like(ratio))
        # In proportion to the depth: the maximum takes all of the correction, the region's edge nearly none.
        part = depth.clamp(min=0.0) / largest[:, None, None]
        return depth * (1.0 + (ratio[:, None, None] - 1.0) * part)

    @torch.inference_mode()
    def answers(self, network: Network, windows: Windows, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the process's maximum over D_max and its deviation, in the logarithm, shapes (m,) [1].

        Args:
            network: The network that is corrected.
            windows: Its windows.
            frames: Numbers of the frames, shape (m,).
        """
        maxima, deviations, place = [], [], windows.taxels.device
        for batch in torch.as_tensor(frames).split(BATCH):
            readings = windows.batch(batch.to(place))
            signals, counts = network.calibrated(readings), network.newest(readings)
            depth = network.respond(signals) if self.origin is None else signals.new_zeros(0)
            maximum, deviation = self._answer(*self._features(depth, signals, network, counts), counts)
            maxima.append(maximum.cpu().numpy())
            deviations.append(deviation.cpu().numpy())
        return np.concatenate([*maxima, np.empty(0)]), np.concatenate([*deviations, np.empty(0)])

    @property
    def document(self) -> dict[str, Any]:
        """Everything but the frames as plain data (in `schemas/checkpoint.schema.json`)."""
        values = {name: getattr(self, name).double().tolist() for name in ("mean", "scale", "weight")}
        prior = {"prior": self.prior.document} if isinstance(self.prior, PeakProcess) else {}
        balance = {"balance": self.balance} if self.linear is not None else {}
        kernel = {"kernel": asdict(self.kernel)} if self.kernel else {}
        return {**values, "share": self.share, **balance, **kernel, **prior}

    @property
    def tensors(self) -> dict[str, torch.Tensor]:
        """The frames and the weights of the network before the fit, for the checkpoint's file."""
        content = {f"peak.{name}": getattr(self, name) for name in ("rows", "effect", "noise")}
        if self.linear is not None:
            content["peak.linear"] = self.linear
        for name, value in (self.origin.state_dict() if self.origin else {}).items():
            half = value.half()
            # The network that ships is kept in half precision: so is its copy.
            content[f"origin.{name}"] = half if bool((half == value).all()) else value
        if isinstance(self.prior, PeakProcess):
            content |= {f"prior.{name}": value for name, value in self.prior.tensors.items()}
        return {name: value.detach().cpu().contiguous() for name, value in content.items()}

    @classmethod
    def from_document(
        cls,
        document: dict[str, Any],
        tensors: dict[str, torch.Tensor],
        centers: np.ndarray,
        origin: Network | None,
        device: torch.device | str,
    ) -> PeakProcess:
        """Rebuild a process from `document` and `tensors`."""
        mean, scale, weight = (
            torch.tensor(document[name], dtype=torch.float32, device=device) for name in ("mean", "scale", "weight")
        )
        # A linear correction of an earlier release has no frames.
        rows, effect, noise = (
            tensors.get(f"peak.{name}", torch.zeros(0)).to(device) for name in ("rows", "effect", "noise")
        )
        kernel = Kernel(**document["kernel"]) if "kernel" in document else None
        places = torch.as_tensor(np.float32(centers), device=device)
        share, linear = document.get("share", 1.0), None
        if "balance" in document:
            linear = tensors["peak.linear"].to(device)
        balance = document.get("balance", 1.0)
        return cls(places, mean, scale, weight, rows, effect, noise, kernel, origin, share, linear, balance)

    def _features(
        self, depth: torch.Tensor, signals: torch.Tensor, network: Network, counts: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        if self.origin is not None:
            network, depth = self.origin, self.origin.respond(signals)
        values, largest = features(depth, signals, network, self.centers)
        if self.origin is not None:
            largest = prior_maxima(largest, depth, signals, network, counts)
        # A linear correction of an earlier release has the first features alone.
        values = values[:, : len(self.mean)]
        return ((values - self.mean) / self.scale).clamp(-_BEYOND, _BEYOND), largest

    def _answer(
        self, standard: torch.Tensor, largest: torch.Tensor, counts: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return maxima over D_max and the process's deviations, both (b,)."""
        change = self.weight[0] + standard @ self.weight[1:]
        if not self.kernel:
            return largest * change.clamp(-FARTHEST, FARTHEST).exp(), torch.ones_like(largest).double()
        change = change + self.kernel.nonlinear(standard, self.rows) @ self.effect
        maximum, deviation = largest * change.clamp(-FARTHEST, FARTHEST).exp(), self._deviation(self.kernel, standard)
        if self.linear is not None:
            regressed = (self.linear[0] + counts @ self.linear[1:]).amax(dim=1).clamp(min=SHALLOW)
            weight = (self.balance / (self.balance + deviation.square())).to(maximum.dtype)
            maximum = (weight * maximum.log() + (1.0 - weight) * regressed.log()).exp()
        return maximum, deviation

    def _deviation(self, kernel: Kernel, standard: torch.Tensor) -> torch.Tensor:
        rows, contact = self.rows.double(), standard.double()
        if not self._factor:
            root = torch.linalg.cholesky(kernel(rows, rows) + torch.diag(self.noise.double()))
            identity = torch.eye(len(rows), dtype=rows.dtype, device=rows.device)
            self._factor.append(torch.linalg.solve_triangular(root, identity, upper=False))
        known = self._factor[0] @ kernel(rows, contact)
        return (kernel.variance(contact) - known.square().sum(0)).clamp(min=1e-9).sqrt()


def fit_process(known: Contacts, model: PeakProcess | None = None) -> PeakProcess | None:
    """Fit the process to frames of presses; None if fewer than `FEWEST` presses touch.

    Args:
        known: The frames.
        model: A process with the covariance and the balance, for which two presses do; by default those with the
            least error on presses left out.
    """
    if len(np.unique(known.press)) < (2 if model else FEWEST):
        return None
    mean, scale = known.values.mean(dim=0), known.values.std(dim=0, correction=0)
    scale = torch.where(scale > 1e-6, scale, torch.ones_like(scale))
    rows = ((known.values - mean) / scale).clamp(-_BEYOND, _BEYOND)
    kernel = model.kernel if model and model.kernel else _chosen(rows, known)
    noise = kernel.label_variance(known.peak)
    observed = kernel(rows, rows) + torch.diag(noise)
    balance = model.balance if model else _balance(observed, noise, known)
    effect = torch.linalg.solve(observed, known.target)
    weight = torch.cat([CONSTANT**2 * effect.sum()[None], kernel.slope**2 * (effect @ rows) / rows.shape[1]])
    linear = torch.from_numpy(ridge.regression(known.products) / known.top)

    def single(value: torch.Tensor) -> torch.Tensor:
        # As in the file: a checkpoint that is read again must answer the same way.
        return value.float().to(known.centers.device)

    mean, scale, weight, rows, effect, noise, linear = map(single, (mean, scale, weight, rows, effect, noise, linear))
    return PeakProcess(
        known.centers, mean, scale, weight, rows, effect, noise, kernel, known.origin, 1.0, linear, balance
    )


def _balance(observed: torch.Tensor, noise: torch.Tensor, known: Contacts) -> float:
    """Return the squared deviation at which the regression is as precise as the process, on presses left out [1]."""
    inverse = torch.linalg.inv(observed)
    effect, squares = inverse @ known.target, []
    for press in np.unique(known.press):
        # The closed form of a process without a press (C. E. Rasmussen, C. K. I. Williams, 2006, section 5.4.2).
        own = torch.from_numpy(np.flatnonzero(known.press == press))
        block = torch.linalg.inv(inverse[own][:, own])
        variance = (torch.diagonal(block) - noise[own]).clamp(min=1e-9)
        squares.append((block @ effect[own]).square() / variance)
    regressed = (known.regressed.log() - (known.peak / known.top).log()).square().median()
    return float(regressed / torch.cat(squares).median().clamp(min=1e-9))


def _chosen(rows: torch.Tensor, known: Contacts) -> Kernel:
    """Return the kernel whose maxima err least on presses left out [mm]."""
    numbers, press = np.unique(known.press, return_inverse=True)
    part = np.random.default_rng(0).permutation(len(numbers))[press] % FOLDS
    target, peak = known.target, known.peak
    best, least = Kernel(AMPLITUDES[-1], LENGTHS[-1], SLOPES[-1], NOISES[-1]), np.inf
    for amplitude, length, slope in product(AMPLITUDES, LENGTHS, SLOPES):
        if not amplitude and length != LENGTHS[0]:
            continue
        covariance = Kernel(amplitude, length, slope, 0.0)(rows, rows)
        for noise in NOISES:
            kernel = Kernel(amplitude, length, slope, noise)
            observed = covariance + torch.diag(kernel.label_variance(peak))
            error = torch.empty_like(target)
            for number in np.unique(part):
                inside, outside = (torch.from_numpy(np.flatnonzero(mask)) for mask in (part != number, part == number))
                effect = torch.linalg.solve(observed[inside][:, inside], target[inside])
                error[outside] = target[outside] - covariance[outside][:, inside] @ effect
            loss = float((peak * (1.0 - torch.exp(-error))).abs().mean())
            if loss < least:
                best, least = kernel, loss
    return best
