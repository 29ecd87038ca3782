"""Gaussian process of a map's deepest pixel, on features of the loads and of a map that no press has moved.

A network predicts the mean of each pixel. The maximum of means is not the mean of maxima, and the depth at a given load
depends on the unit's skin. So the logarithm of labelled over predicted maximum is a Gaussian process (C. E. Rasmussen,
C. K. I. Williams, 2006) of features of a contact: its depth, region, place and loads.

The predicted maximum is that of the network before it was fitted, with the unit's calibration. On presses that a
network has learned from, its errors are too small to tell those on others. A correction that the network had before
the fit is the prior's mean, and is applied to the fitted one's maxima too.

Kernel: a constant, a linear part, and a squared exponential. Its size, length and noise are those with the least error
on presses left out. The process's deviation grows away from the presses, and scales intervals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from tacdata.training.frames.windows import Windows

if TYPE_CHECKING:
    from tacdata.training.frames.frames import Frames
    from tacdata.training.networks.network import Correction, Network

FEWEST = 6
"""Presses below which nothing is corrected [count]: with 3 presses the correction did harm on rig 20."""
LEAST = 0.06
"""Labelled maximum from which a frame counts [mm]: below, noise decides the region."""
FRAMES = 40
"""Frames of a press that are taken at most, evenly [count]."""
ROWS = 1000
"""Frames of all presses together that are taken at most [count]: time and memory grow with its square."""
FOLDS = 5
"""Parts of the presses, each left out once to choose the kernel [count]."""
CONSTANT = 0.3
"""Standard deviation of the constant [1]."""
AMPLITUDES, LENGTHS, SLOPES, NOISES = (0.0, 0.1, 0.25), (0.7, 1.2), (0.1, 0.3, 1.0), (0.05, 0.15, 0.4)
"""Values that are tried of each quantity of `Kernel`."""
SHALLOW = 0.01
"""Maximum of a map over D_max below which it is not corrected [1]: 0.03 mm at D_max = 3 mm."""
EDGE = 1 / 30
"""Depth over D_max from which a pixel counts as in contact [1]: 0.1 mm at D_max = 3 mm."""
FARTHEST = 0.8
"""Largest correction of a maximum, in its logarithm [1]."""
BATCH = 256
"""Frames computed together [count]."""
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
    _factor: list[torch.Tensor] = field(default_factory=list, repr=False)

    def corrected(self, depth: torch.Tensor, signals: torch.Tensor, network: Network) -> torch.Tensor:
        """Return maps over D_max with their maxima corrected, (b, pixels_x, pixels_y).

        Args:
            depth: Maps of the network over D_max, shape (b, pixels_x, pixels_y).
            signals: Output of `Network.calibrated`, shape (b, T, taxels).
            network: The network.
        """
        maximum = self._maximum(*self._features(depth, signals, network))
        if self.prior is not None:
            depth = self.prior.corrected(depth, signals, network)
        return self.rescaled(depth, maximum)

    @property
    def prior(self) -> Correction | None:
        """Correction of the network before the fit, by other presses; None without."""
        return self.origin.peak if self.origin is not None else None

    def moved(self, change: Callable[[torch.Tensor], torch.Tensor]) -> PeakProcess:
        """Return the process with each tensor changed: another device or precision."""
        values = (self.centers, self.mean, self.scale, self.weight, self.rows, self.effect, self.noise)
        centers, mean, scale, weight, rows, effect, noise = map(change, values)
        origin = self.origin._apply(change) if self.origin else None
        return PeakProcess(centers, mean, scale, weight, rows, effect, noise, self.kernel, origin, self.share)

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
            signals = network.calibrated(windows.batch(batch.to(place)))
            depth = network.respond(signals) if self.origin is None else signals.new_zeros(0)
            standard, largest = self._features(depth, signals, network)
            maxima.append(self._maximum(standard, largest).cpu().numpy())
            deviations.append(self._deviation(standard).cpu().numpy())
        return np.concatenate([*maxima, np.empty(0)]), np.concatenate([*deviations, np.empty(0)])

    @property
    def document(self) -> dict[str, Any]:
        """Everything but the frames as plain data (in `schemas/checkpoint.schema.json`)."""
        values = {name: getattr(self, name).double().tolist() for name in ("mean", "scale", "weight")}
        prior = {"prior": self.prior.document} if isinstance(self.prior, PeakProcess) else {}
        return {**values, "share": self.share, **({"kernel": asdict(self.kernel)} if self.kernel else {}), **prior}

    @property
    def tensors(self) -> dict[str, torch.Tensor]:
        """The frames and the weights of the network before the fit, for the checkpoint's file."""
        content = {f"peak.{name}": getattr(self, name) for name in ("rows", "effect", "noise")}
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
        share = document.get("share", 1.0)
        return cls(places, mean, scale, weight, rows, effect, noise, kernel, origin, share)

    def _features(
        self, depth: torch.Tensor, signals: torch.Tensor, network: Network
    ) -> tuple[torch.Tensor, torch.Tensor]:
        if self.origin is not None:
            network, depth = self.origin, self.origin.respond(signals)
        values, largest = features(depth, signals, network, self.centers)
        if self.origin is not None:
            largest = _known(largest, depth, signals, network)
        # A linear correction of an earlier release has the first features alone.
        values = values[:, : len(self.mean)]
        return ((values - self.mean) / self.scale).clamp(-_BEYOND, _BEYOND), largest

    def _maximum(self, standard: torch.Tensor, largest: torch.Tensor) -> torch.Tensor:
        change = self.weight[0] + standard @ self.weight[1:]
        if self.kernel:
            change = change + self.kernel.nonlinear(standard, self.rows) @ self.effect
        return largest * change.clamp(-FARTHEST, FARTHEST).exp()

    def _deviation(self, standard: torch.Tensor) -> torch.Tensor:
        if not self.kernel:
            return torch.ones(len(standard), dtype=torch.float64, device=standard.device)
        rows = self.rows.double()
        if not self._factor:
            covariance = self.kernel(rows, rows) + torch.diag(self.noise.double())
            self._factor.append(torch.linalg.cholesky(covariance))
        contact = standard.double()
        known = torch.linalg.solve_triangular(self._factor[0], self.kernel(rows, contact), upper=False)
        return (self.kernel.variance(contact) - known.square().sum(0)).clamp(min=1e-9).sqrt()


def features(
    depth: torch.Tensor, signals: torch.Tensor, network: Network, centers: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return quantities of map and loads on which a maximum's error depends (b, features), and the maxima (b,).

    Depth, region, place and load of a contact, how taxels share the load, and how it changes with time.

    Args:
        depth: Maps over D_max, shape (b, pixels_x, pixels_y).
        signals: Output of `Network.calibrated`, shape (b, T, taxels).
        network: The network of the maps, for the scale of its signals and its window.
        centers: Places of the taxels [mm], shape (taxels, 2).
    """
    largest = depth.amax(dim=(1, 2)).clamp(min=SHALLOW)
    size = signals.abs() / network.get_buffer("sd").square().mean().sqrt()
    newest, oldest = size[:, network.offsets.index(0)], size[:, 0].sum(dim=1).clamp(min=1e-3)
    total = newest.sum(dim=1).clamp(min=1e-3)
    area = (depth > EDGE).float().sum(dim=(1, 2)) + 1.0
    # Shares of the deepest pixel that areas are taken at, beside the half.
    half, quarter, upper, top = (
        (depth > level * largest[:, None, None]).float().sum(dim=(1, 2)) + 1.0 for level in (0.5, 0.25, 0.75, 0.9)
    )
    deep, load = largest.log(), total.log()
    part = newest / total[:, None]
    shares = part.topk(min(6, part.shape[1]), dim=1).values
    concentration = shares[:, :4].sum(dim=1).clamp(min=1e-3).log()
    change = (total / oldest).log().clamp(-2.0, 2.0)
    products = [deep**2, load**2, deep * load, concentration * deep, concentration * load]
    first = [deep, load, area.log(), half.log(), change, concentration, *products]
    past = size[:, 1 : min(4, size.shape[1] - 1)].sum(dim=2).clamp(min=1e-3)
    pixel = depth.flatten(1).argmax(dim=1)
    column = torch.div(pixel, depth.shape[2], rounding_mode="floor")
    place = [column.float(), (pixel - column * depth.shape[2]).float()]
    values = [torch.stack([*first, *_spread(part, centers), *place, quarter.log(), upper.log(), top.log()], dim=1)]
    values += [shares.clamp(min=1e-3).log(), (past.log() - load[:, None]).clamp(-2.0, 2.0)]
    return torch.cat(values, dim=1), largest


@dataclass(frozen=True, eq=False)
class Contacts:
    """Frames of labelled presses in contact, as a process learns from them."""

    values: torch.Tensor
    """Their features [1], shape (n, features)."""
    target: torch.Tensor
    """Logarithms of labelled over predicted maximum [1], shape (n,)."""
    peak: torch.Tensor
    """Labelled maxima [mm], shape (n,)."""
    press: np.ndarray
    """Press of each frame [number], shape (n,)."""
    centers: torch.Tensor
    """Places of the taxels [mm], shape (taxels, 2)."""
    origin: Network | None
    """The network before the fit, of which the maps are; None if they are those of the network itself."""

    def without(self, presses: tuple[int, ...]) -> Contacts:
        """Return the frames of the other presses."""
        others = np.flatnonzero(~np.isin(self.press, presses))
        values, target, peak = (part[torch.from_numpy(others)] for part in (self.values, self.target, self.peak))
        return Contacts(values, target, peak, self.press[others], self.centers, self.origin)


@torch.inference_mode()
def contacts(network: Network, frames: Frames, presses: tuple[int, ...], origin: Network | None = None) -> Contacts:
    """Return the frames of presses that a process learns from.

    Args:
        network: The network that is corrected, on the CPU or a GPU; a correction that it has is left out.
        frames: The dataset.
        presses: Numbers of the presses.
        origin: The network before the fit, on the same device.
    """
    place = network.get_buffer("mean").device
    windows, top = Windows(frames, network.offsets, place), frames.sensor.map.depth_max
    centers = torch.as_tensor(np.float32(frames.sensor.taxels.centers), device=place)
    used, most, rows = origin or network, max(2, min(FRAMES, ROWS // len(presses))), []
    for press in presses:
        touching = frames.indices((press,))
        touching = touching[frames.depth[touching].max(axis=(1, 2)) > LEAST]
        rows.append(touching[:: -(-len(touching) // most) or 1])
    chosen, press = np.concatenate(rows), np.repeat(presses, [len(part) for part in rows])
    thinning = -(-len(chosen) // ROWS) or 1
    chosen, press = chosen[::thinning], press[::thinning]
    peak = torch.from_numpy(np.clip(frames.depth[chosen].max(axis=(1, 2)), 0.0, top).astype(float))
    values, maxima = [], []
    for batch in torch.as_tensor(chosen).split(BATCH):
        signals = network.calibrated(windows.batch(batch.to(place)))
        depth = used.respond(signals)
        columns, largest = features(depth, signals, used, centers)
        if origin is not None:
            largest = _known(largest, depth, signals, origin)
        values.append(columns.double().cpu())
        maxima.append(largest.double().cpu())
    target = (peak / top / torch.cat([*maxima, peak.new_empty(0)])).log()
    return Contacts(
        torch.cat([*values, peak.new_empty(0, 0)][: len(values) or 1]), target, peak, press, centers, origin
    )


def fit_process(known: Contacts, kernel: Kernel | None = None) -> PeakProcess | None:
    """Fit the process to frames of presses; None if fewer than `FEWEST` presses touch.

    Args:
        known: The frames.
        kernel: The covariance; that with the least error on presses left out by default. With it, two presses do.
    """
    if len(np.unique(known.press)) < (2 if kernel else FEWEST):
        return None
    mean, scale = known.values.mean(dim=0), known.values.std(dim=0, correction=0)
    scale = torch.where(scale > 1e-6, scale, torch.ones_like(scale))
    rows = ((known.values - mean) / scale).clamp(-_BEYOND, _BEYOND)
    kernel = kernel or _chosen(rows, known)
    noise = kernel.label_variance(known.peak)
    effect = torch.linalg.solve(kernel(rows, rows) + torch.diag(noise), known.target)
    weight = torch.cat([CONSTANT**2 * effect.sum()[None], kernel.slope**2 * (effect @ rows) / rows.shape[1]])

    def single(value: torch.Tensor) -> torch.Tensor:
        # As in the file: a checkpoint that is read again must answer the same way.
        return value.float().to(known.centers.device)

    mean, scale, weight, rows, effect, noise = map(single, (mean, scale, weight, rows, effect, noise))
    return PeakProcess(known.centers, mean, scale, weight, rows, effect, noise, kernel, known.origin)


def _known(largest: torch.Tensor, depth: torch.Tensor, signals: torch.Tensor, origin: Network) -> torch.Tensor:
    """Return the maxima of the network before the fit (b,), by its own correction if it has one: the prior's mean."""
    if origin.peak is None:
        return largest
    return origin.peak.corrected(depth, signals, origin).amax(dim=(1, 2)).clamp(min=SHALLOW)


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


def _spread(part: torch.Tensor, centers: torch.Tensor) -> list[torch.Tensor]:
    """Return the logarithms of the variances of the load's place along its two axes [mm^2], each (b,)."""
    offset = centers[None] - (part @ centers)[:, None]
    along_x, along_y, mixed = ((part * offset[..., i] * offset[..., j]).sum(dim=1) for i, j in ((0, 0), (1, 1), (0, 1)))
    middle = 0.5 * (along_x + along_y)
    # The eigenvalues of the two by two matrix.
    apart = (0.25 * (along_x - along_y) ** 2 + mixed**2).clamp(min=1e-12).sqrt()
    return [(middle - apart).clamp(min=1e-3).log(), (middle + apart).clamp(min=1e-3).log()]
