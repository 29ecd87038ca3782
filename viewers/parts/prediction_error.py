"""Errors of a predicted depth map that a lab reads first: peak depth and place of the contact."""

from dataclasses import dataclass

import numpy as np

from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD, centroid, score_frames
from tacdata.viewers.scene.scene import DepthMaps


@dataclass(frozen=True)
class FrameError:
    """Peak and centroid of one predicted map and of its label."""

    labelled: float
    """Largest depth of the label [mm]."""
    predicted: float
    """Largest depth of the prediction [mm]."""
    centroid: float
    """Distance of the depth-weighted centroids [mm]; NaN without contact in both maps."""

    def __str__(self) -> str:
        """Return peak error and centroid error with units, on one line."""
        peak = f"peak {self.predicted - self.labelled:+.2f} mm"
        return peak if np.isnan(self.centroid) else f"{peak}, centroid {self.centroid:.2f} mm"


def frame_error(label: np.ndarray, prediction: np.ndarray, pitch: tuple[float, float]) -> FrameError:
    """Return peak and centroid error of one frame.

    Args:
        label: Depth [mm], shape (pixels_x, pixels_y).
        prediction: Depth [mm], of the same shape.
        pitch: Distance of neighbouring pixels along x and y [mm].
    """
    places = centroid(np.stack([label, prediction]), CONTACT_THRESHOLD)
    distance = float(np.linalg.norm((places[1] - places[0]) * pitch))
    return FrameError(float(label.max(initial=0.0)), float(prediction.max(initial=0.0)), distance)


def press_error(maps: tuple[DepthMaps, ...]) -> str:
    """Return the errors of the deepest frame and of the whole press on one line; empty without a label.

    Args:
        maps: Every map of the press, among them "label" and "prediction" at common times.
    """
    named = {item.name: item for item in maps}
    if "error" not in named:
        return ""
    common = named["error"].time_ns
    label, prediction = (m.values[np.searchsorted(m.time_ns, common)] for m in (named["label"], named["prediction"]))
    deepest = int(label.reshape(len(label), -1).max(axis=1).argmax())
    frame = frame_error(label[deepest], prediction[deepest], pitch(named["label"]))
    scores = score_frames(prediction, label)
    contact = scores.labelled
    text = f"deepest frame {frame.predicted:.2f} mm predicted, {frame.labelled:.2f} mm labelled ({frame})"
    if contact.any():
        # Medians, since the first and last frames of a contact have large relative errors.
        peak, rmse = np.median(scores.peak_error[contact]), np.median(scores.contact_rmse[contact])
        text += f"; {int(contact.sum())} frames in contact: median peak error {peak:.3f} mm, contact RMSE {rmse:.3f} mm"
    return text


def pitch(maps: DepthMaps) -> tuple[float, float]:
    """Return the distance of neighbouring pixels along x and y [mm]."""
    x, y = (float(np.ptp(axis) / max(len(axis) - 1, 1)) for axis in (maps.x, maps.y))
    return x, y
