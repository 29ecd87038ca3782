"""Tags in photographs with published corners (AprilRobotics/apriltag test data; NASA/KSC, CC BY-SA 2.0)."""

import os
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tacdata.tags import detect_tags

DATA = Path(os.environ.get("TACDATA_SHARED_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
PHOTOS = DATA / "apriltag_photos" / "april_robotics"

pytestmark = pytest.mark.skipif(
    not PHOTOS.is_dir(), reason="no apriltag_photos/april_robotics in $TACDATA_SHARED_DATA or ../shared/data"
)


def listed(path):
    """Ids and corners [px, AprilTag's convention] that a photograph's list states."""
    for line in path.read_text().splitlines():
        numbers = [float(n) for n in re.findall(r"-?\d+\.?\d*", line)]
        if len(numbers) == 9:
            yield int(numbers[0]), np.array(numbers[1:]).reshape(4, 2)


def test_published_tags_are_found_and_none_invented():
    wanted = found = invented = 0
    offsets = []
    for path in sorted(PHOTOS.glob("*.jpg")):
        image = cv2.imread(str(path))
        tags = detect_tags(image)
        expected = list(listed(path.with_suffix(".txt")))
        used = set()
        for number, corners in expected:
            # The list counts from pixel corners, tacdata from pixel centres.
            away = [np.abs(t.corners + 0.5 - corners).max() if t.id == number else np.inf for t in tags]
            nearest = int(np.argmin(away))
            if away[nearest] < 1.0:
                used.add(nearest)
                offsets.append(away[nearest])
        wanted += len(expected)
        found += len(used)
        invented += len(tags) - len(used)
    assert wanted == 47
    assert found >= 46
    assert invented == 0
    assert np.median(offsets) < 0.05 and max(offsets) < 0.5
