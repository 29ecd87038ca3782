"""What the paper reports, for standing beside our own figures; nothing is computed from it."""

from __future__ import annotations

TABLE_1 = {
    "pixel_rmse": {"median": 0.077, "p90": 0.205, "mean": 0.101, "sd": 0.076},
    "peak_error": {"median": 0.095, "p90": 0.484, "mean": 0.188, "sd": 0.258},
    "contact_rmse": {"median": 0.172, "p90": 0.446, "mean": 0.223, "sd": 0.161},
    "centroid_error": {"median": 0.531, "p90": 2.617, "mean": 1.213, "sd": 2.379},
    "iou": {"median": 0.883, "p90": 0.949, "mean": 0.829, "sd": 0.169},
}
"""Table 1: agreement with simulation-generated labels [mm, px, 1]."""

PHYSICAL = {
    "centre_depth": {"mean": 0.085, "sd": 0.057, "count": 40},
    "position": {"mean": 0.250, "sd": 0.208, "count": 37},
    "position_all": {"mean": 0.285, "sd": 0.240, "count": 40},
}
"""Exp. 1, predictions from measured inputs against the prescribed contact [mm]."""

LABELS = {
    "centre_depth": {"mean": 0.110, "sd": 0.016, "count": 78},
    "position": {"mean": 0.247, "sd": 0.159, "count": 37},
    "position_all": {"mean": 0.279, "sd": 0.201, "count": 40},
}
"""Labels against the prescribed contact, region above 0.4 mm [mm]."""
