"""Depth maps of many states at once: the deformed outer face seen from above, on the CPU or CUDA.

Depth of a sample = height of the undeformed face minus height of the uppermost sheet of the deformed face, both above
the same (x, y). A sample without skin, deformed or undeformed, has depth 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from tacdata.errors import UsageError
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.surface.depth_map_kernel import HIGHEST, NOTHING
from tacdata.skin.surface.pressed_shape import PressedShape
from tacdata.warp_runtime import wp

SAMPLINGS = ("point", "area")
"""How a pixel gets its value: at its centre, or as the mean over its square."""

_GAUSS = 4
"""Samples along each side of a pixel for its mean (Gauss-Legendre: exact to degree 7 within one element)."""


class DepthRaster:
    """Pixels over one mesh; costs milliseconds to build, so keep it."""

    def __init__(
        self, mesh: SkinMesh, x: np.ndarray, y: np.ndarray, sampling: str = "point", device: str = "cpu"
    ) -> None:
        """Bind pixels to a mesh.

        Args:
            mesh: The skin.
            x: Pixel centres along x [mm], ascending; evenly spaced where ``sampling`` is "area".
            y: Pixel centres along y [mm], likewise.
            sampling: "point" (at pixel centres) or "area" (mean over the pixel's square).
            device: Warp's name of the device, for example "cuda:0".

        Raises:
            UsageError: If there is no such sampling.
        """
        if sampling not in SAMPLINGS:
            raise UsageError(f"sampling {sampling!r} of the depth map", ", ".join(SAMPLINGS), "correct map/sampling")
        self.shape = (len(x), len(y))
        self._device, self._parts = device, 1 if sampling == "point" else _GAUSS
        self._share = torch.ones(1, dtype=torch.float64, device=device)
        if sampling == "area":
            # An area mean by Gauss's rule within each pixel.
            points, weights = np.polynomial.legendre.leggauss(_GAUSS)
            x, y = (_spread(axis, points) for axis in (x, y))
            self._share = torch.as_tensor(weights / 2, device=device)
        self._x, self._y = (wp.array(axis, dtype=wp.float64, device=device) for axis in (x, y))
        self._nodes = wp.array(mesh.nodes, dtype=wp.vec3d, device=device)
        self._faces = wp.array(np.ascontiguousarray(mesh.outer), dtype=wp.int32, device=device)
        self._contact = np.unique(mesh.outer)
        still = torch.zeros(len(mesh.nodes), 3, 1, dtype=torch.float64, device=device)
        self._rest = self._height(still)

    def depth(self, u: torch.Tensor) -> torch.Tensor:
        """Return depth maps [mm], shape (b, pixels_x, pixels_y), float64.

        Args:
            u: Displacements [mm], shape (nodes, 3, b), float64 or float32; strided views are read as they are.
        """
        return self.measure(u)[0]

    def measure(self, u: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return `depth` and the share of each pixel that the skin covers [1], both (b, pixels_x, pixels_y)."""
        return self._measured(self._height(u))

    def pressed(self, u: torch.Tensor, shapes: Sequence[PressedShape]) -> torch.Tensor:
        """Return depth maps [mm], shape (b, pixels_x, pixels_y): where the face touches, those of the shape.

        Args:
            u: Displacements [mm], shape (nodes, 3, b), as of `depth`.
            shapes: The indenter in each state, and its place, (b,).
        """
        height = self._height(u)
        touching = self._share_of(u, height, np.stack([shape.touching for shape in shapes], axis=1))
        around = self._share_of(u, height, np.stack([shape.around for shape in shapes], axis=1))
        for k, shape in enumerate(shapes):
            shape.lay(self._x, self._y, height[:, :, k], touching[:, :, k], around[:, :, k])
        return self._measured(height)[0]

    def _share_of(self, u: torch.Tensor, height: torch.Tensor, marks: np.ndarray) -> torch.Tensor:
        """Return the sum of the contact nodes' hats above the samples, by marks (s, b), shape (sx, sy, b)."""
        touching = torch.zeros(len(self._nodes), marks.shape[1], dtype=torch.float64)
        touching[self._contact] = torch.as_tensor(marks).double()
        share = torch.zeros_like(height)
        self._scan(u, height, touching.to(self._device), share)
        return share

    def _measured(self, height: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        covered = (height > NOTHING / 2) & (self._rest > NOTHING / 2)
        depth = torch.where(covered, self._rest - height, 0.0)
        if self._parts == 1:
            return depth.permute(2, 0, 1).contiguous(), covered.permute(2, 0, 1).double()
        total, share = self._mean(depth), self._mean(covered.double())
        # The mean over the covered part only: a pixel on the rim would read too shallow.
        return torch.where(share > 0, total / share.clamp_min(1e-12), 0.0), share

    def _height(self, u: torch.Tensor) -> torch.Tensor:
        """Return the height of the uppermost sheet above the samples [mm], shape (samples_x, samples_y, b)."""
        size = len(self._x), len(self._y), u.shape[2]
        height = torch.full(size, NOTHING, dtype=torch.float64, device=self._device)
        none = torch.zeros(0, 0, dtype=torch.float64, device=self._device)
        self._scan(u, height, none, none[:, :, None])
        return height

    def _scan(self, u: torch.Tensor, height: torch.Tensor, touching: torch.Tensor, share: torch.Tensor) -> None:
        fields = [wp.from_torch(field) for field in (height, touching, share)]
        wp.launch(
            HIGHEST[self._device.split(":")[0]],
            dim=(len(self._faces), u.shape[2]),
            inputs=[self._nodes, self._faces, wp.from_torch(u.detach().double()), self._x, self._y, *fields],
            device=self._device,
        )

    def _mean(self, samples: torch.Tensor) -> torch.Tensor:
        """Return the weighted sum over each pixel of samples (sx, sy, b), shape (b, pixels_x, pixels_y)."""
        n = self._parts
        cells = samples.reshape(self.shape[0], n, self.shape[1], n, -1)
        return torch.einsum("ikjlb,k,l->bij", cells, self._share, self._share).contiguous()


def _spread(centers: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return ``points`` in [-1, 1] placed within each of evenly spaced pixels [mm]."""
    if len(centers) < 2 or np.ptp(np.diff(centers)) > 1e-9:
        raise UsageError(
            f"{len(centers)} pixel centres that are not evenly spaced",
            "two or more at one pitch for area means",
            "take sampling: point, or an even grid",
        )
    pitch = float(centers[1] - centers[0])
    return (centers[:, None] + 0.5 * pitch * points).ravel()
