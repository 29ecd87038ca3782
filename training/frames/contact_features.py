"""Quantities of a map and of its loads on which the error of the map's maximum depends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from tacdata.training.networks.network import Network

SHALLOW = 0.01
"""Maximum of a map over D_max below which it is not corrected [1]: 0.03 mm at D_max = 3 mm."""
EDGE = 1 / 30
"""Depth over D_max from which a pixel counts as in contact [1]: 0.1 mm at D_max = 3 mm."""


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


def _spread(part: torch.Tensor, centers: torch.Tensor) -> list[torch.Tensor]:
    """Return the logarithms of the variances of the load's place along its two axes [mm^2], each (b,)."""
    offset = centers[None] - (part @ centers)[:, None]
    along_x, along_y, mixed = ((part * offset[..., i] * offset[..., j]).sum(dim=1) for i, j in ((0, 0), (1, 1), (0, 1)))
    middle = 0.5 * (along_x + along_y)
    # The eigenvalues of the two by two matrix.
    apart = (0.25 * (along_x - along_y) ** 2 + mixed**2).clamp(min=1e-12).sqrt()
    return [(middle - apart).clamp(min=1e-3).log(), (middle + apart).clamp(min=1e-3).log()]
