"""Latest readings, tip and phase of a recording that is being written."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.plans import Press
from tacdata.recording.files import topics
from tacdata.recording.files.growing_file import GrowingFile
from tacdata.recording.files.taxel_arrays import taxel_frames
from tacdata.rig import registration_for
from tacdata.schemas import tacdata_pb2 as pb
from tacdata.sensor import Sensor

IDLE = 10
"""First frames of a recording, whose mean is zero [frames]: the tip is above the skin."""


class LiveValues:
    """Follows the newest recording; only what was appended is read."""

    def __init__(self) -> None:
        self._file: GrowingFile | None = None

    def of(self, path: Path) -> dict[str, Any] | None:
        """Return the latest values of a recording; None before its first frame.

        Returns:
            ``columns`` of the array; ``change``: readings less their zero [counts]; ``tip``: x, y and depth in the
            sensor's frame [mm], None before the first report; ``phase``: rest, approach, press, hold, release or empty.

        Raises:
            UsageError: If the recording has ended.
            FormatError: If it is no recording.
        """
        if self._file is None or self._file.records.path != path:
            self.close()
            self._file = GrowingFile(path)
        self._file.update()
        records = self._file.records
        frames = records.columns_of(topics.TAXELS).data
        documents = [records.attachments.get(f"{name}.json") for name in ("sensor", "rig", "press")]
        if not frames or None in documents:
            return None
        sensor, rig, press = (json.loads(document.data) for document in documents if document is not None)
        counts = taxel_frames([*frames[:IDLE], frames[-1]]).counts
        reports, phases = records.columns_of(topics.STATUS).data, records.columns_of(topics.PHASE).data
        tip = None
        if reports:
            at = pb.CncStatus.FromString(reports[-1]).position
            pose = registration_for(rig, Press.from_document(press, str(path)).indenter_name)
            tip = pose.to_sensor(np.array([[at.x, at.y, at.z]]))[0].tolist()
        return {
            "columns": Sensor.from_document(sensor, str(path)).taxels.columns,
            "change": (counts[-1] - counts[:-1].mean(axis=0)).tolist(),
            "tip": tip,
            "phase": pb.Phase.FromString(phases[-1]).name if phases else "",
        }

    def close(self) -> None:
        """Close the file that is followed."""
        if self._file is not None:
            self._file.close()
        self._file = None
