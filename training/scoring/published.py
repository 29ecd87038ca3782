"""Figures of the paper, shown with our own; nothing is computed from them."""

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

LABEL_DEPTH = {"mean": 0.110, "sd": 0.016, "count": 78}
"""Centre depth of the labels over the depth trials [mm]."""

LABEL_POSITION = {
    0.3: {"all": {"mean": 0.338, "sd": 0.227, "count": 40}},
    0.4: {"all": {"mean": 0.279, "sd": 0.201, "count": 40}, "not_truncated": {"mean": 0.247, "sd": 0.159, "count": 37}},
    0.5: {"all": {"mean": 0.265, "sd": 0.186, "count": 40}},
}
"""Position of the labels by threshold [mm]; medians and 95th percentiles are not printed."""

WEARING = {"lowest": 0.827, "highest": 0.904, "mean": 0.861, "sd": 0.022, "participants": 12, "trials": 57}
"""Centroid-aligned IoU of a triangular indenter: participants' means, and their mean and deviation [1]."""

SUCCESS = {
    "contact only": {"all": (15, 40), "edge": (4, 20), "adjustments": None},
    "raw taxels": {"all": (27, 40), "edge": (9, 20), "adjustments": (1.07, 1.36), "adjustments_edge": (2.56, 1.01)},
    "dense depth": {"all": (35, 40), "edge": (17, 20), "adjustments": (2.14, 1.24), "adjustments_edge": (2.71, 1.21)},
}
"""Exp. 3: successes of trials; adjustments of successful trials, mean and deviation."""
