"""The readings that `viewers.rerun.gap_recording` wrote, read back as curves."""

from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from tacdata.errors import FormatError
from tacdata.viewers.rerun.gap_recording import COLORS, TIMELINE
from tacdata.viewers.scene.scene import Curves


def read_gap_curves(path: Path) -> tuple[Curves, ...]:
    """Return one entry for each episode: its reading measured, before and after [the source's unit].

    Raises:
        FormatError: If the file is damaged.
    """
    groups: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {}
    try:
        for chunk in RrdReader(path).stream():
            parts = str(chunk.entity_path).strip("/").split("/")
            if chunk.is_static or len(parts) != 3 or parts[1] != "reading":
                continue
            batch = chunk.to_record_batch()
            time = batch[TIMELINE].cast("int64").to_numpy()
            values = batch["Scalars:scalars"].flatten().to_numpy()
            groups.setdefault(parts[0], {})[parts[2]] = (time, values)
    except Exception as error:  # any error of Rerun's reader for a damaged file
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise FormatError(f"{path} cannot be read: {reason}", "a file of tacdata revise", "revise again") from None
    curves = []
    for name, columns in sorted(groups.items()):
        if set(columns) == set(COLORS):
            time = columns["measured"][0]
            curves.append(
                Curves(name, "as recorded", tuple(COLORS), time, np.column_stack([columns[key][1] for key in COLORS]))
            )
    return tuple(curves)
