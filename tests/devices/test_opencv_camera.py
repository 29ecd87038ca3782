"""What stands in for a camera: folders and files."""

import cv2
import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.devices.opencv_camera import OpencvCamera
from tacdata.errors import DeviceError

INTRINSICS = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5}
CLOCK = Clock.start(20.0)


def pictures(count):
    return [np.full((48, 64), 10 * k + 5, np.uint8) for k in range(count)]


def gather(camera, count):
    images = []
    for _ in range(100):
        images += camera.read(1.0)
        if len(images) >= count:
            break
    return images


def test_folder_in_order_at_its_pace(tmp_path):
    for k, image in enumerate(pictures(6)):
        cv2.imwrite(str(tmp_path / f"{k:03}.png"), image)
    (tmp_path / "notes.txt").write_text("no image")
    begun = CLOCK.now_ns()
    with OpencvCamera(CLOCK, str(tmp_path), INTRINSICS, rate=10.0) as camera:
        images = gather(camera, 6)
        assert camera.read(0.1) == []
    assert [int(i.image.mean()) for i in images] == [5, 15, 25, 35, 45, 55]
    assert [i.sequence for i in images] == list(range(6))
    assert (images[-1].arrival_ns - begun) * 1e-9 >= 0.5  # a sixth image at 10 Hz is never early
    assert camera.dropped == 0


def test_video_file(tmp_path):
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48), False)
    for image in pictures(5):
        writer.write(image)
    writer.release()
    with OpencvCamera(CLOCK, str(path), INTRINSICS) as camera:
        images = gather(camera, 5)
    assert camera.rate == pytest.approx(25.0)
    assert len(images) == 5
    assert abs(images[3].image.mean() - 35) < 4


def test_size_must_be_that_of_the_intrinsics(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((20, 30), np.uint8))
    with pytest.raises(DeviceError, match="30 x 20 pixels, its intrinsics are for 64 x 48"):
        OpencvCamera(CLOCK, str(tmp_path), INTRINSICS).open()


@pytest.mark.parametrize(("source", "words"), [
    ("missing.mp4", "does not exist"),
    (97, "no camera 97"),
    ("http://127.0.0.1:9/none.mjpg", "cannot be opened"),
])  # fmt: skip
def test_missing_sources(source, words):
    with pytest.raises(DeviceError, match=words):
        OpencvCamera(CLOCK, source, INTRINSICS).open()


def test_empty_folder(tmp_path):
    with pytest.raises(DeviceError, match="gave no image"):
        OpencvCamera(CLOCK, str(tmp_path), INTRINSICS).open()


def test_text_that_is_no_video(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_text("no film")
    with pytest.raises(DeviceError, match="cannot be opened"):
        OpencvCamera(CLOCK, str(path), INTRINSICS).open()
