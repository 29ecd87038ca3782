"""What stands in for a camera: folders and files."""

import cv2
import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.devices.opencv_camera import OpencvCamera, _decoded
from tacdata.errors import DeviceError, UsageError

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


@pytest.mark.parametrize(
    ("source", "words"),
    [("missing.mp4", "does not exist"), (97, "no camera 97"), ("http://127.0.0.1:9/none.mjpg", "cannot be opened")],
)
def test_missing_sources(source, words):
    with pytest.raises(DeviceError, match=words):
        OpencvCamera(CLOCK, source, INTRINSICS).open()


def test_empty_folder(tmp_path):
    with pytest.raises(DeviceError, match="holds no image"):
        OpencvCamera(CLOCK, str(tmp_path), INTRINSICS).open()


def test_text_that_is_no_video(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_text("no film")
    with pytest.raises(DeviceError, match="cannot be opened"):
        OpencvCamera(CLOCK, str(path), INTRINSICS).open()


def numbered(folder, count, ending=".png"):
    for k, image in enumerate(pictures(count), start=1):
        cv2.imwrite(str(folder / f"image-{k}{ending}"), image)


def test_numbers_in_names_count_as_numbers(tmp_path):
    numbered(tmp_path, 11)
    with OpencvCamera(CLOCK, str(tmp_path), INTRINSICS, rate=100.0) as camera:
        assert [int(i.image.mean()) for i in gather(camera, 11)] == [10 * k + 5 for k in range(11)]


def test_a_jpeg_is_handed_on_as_it_came(tmp_path):
    numbered(tmp_path, 3, ".jpg")
    with OpencvCamera(CLOCK, str(tmp_path), INTRINSICS, rate=100.0) as camera:
        images = gather(camera, 3)
    assert [i.jpeg for i in images] == [(tmp_path / f"image-{k}.jpg").read_bytes() for k in (1, 2, 3)]
    film = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48), True)
    for image in pictures(5):
        writer.write(cv2.merge([image] * 3))
    writer.release()
    with OpencvCamera(CLOCK, str(film), INTRINSICS) as camera:
        images = gather(camera, 5)
    assert all(i.jpeg.startswith(b"\xff\xd8") and i.jpeg.endswith(b"\xff\xd9") for i in images)
    assert all((cv2.imdecode(np.frombuffer(i.jpeg, np.uint8), 1) == i.image).all() for i in images)
    assert [i.device_ns for i in images] == [k * 40_000_000 for k in range(5)], "the film's own times"
    other = tmp_path / "film.mp4"
    writer = cv2.VideoWriter(str(other), cv2.VideoWriter.fourcc(*"mp4v"), 25.0, (64, 48), True)
    for image in pictures(5):
        writer.write(cv2.merge([image] * 3))
    writer.release()
    with OpencvCamera(CLOCK, str(other), INTRINSICS) as camera:
        images = gather(camera, 5)
    assert len(images) == 5 and not any(i.jpeg for i in images)


def test_a_file_can_begin_again(tmp_path):
    numbered(tmp_path, 2)
    with OpencvCamera(CLOCK, str(tmp_path), INTRINSICS, rate=100.0, loop=True) as camera:
        assert [int(i.image.mean()) for i in gather(camera, 5)][:5] == [5, 15, 5, 15, 5]


def test_a_broken_image_in_a_folder_is_named(tmp_path):
    numbered(tmp_path, 3)
    (tmp_path / "image-2.png").write_bytes((tmp_path / "image-2.png").read_bytes()[:40])
    with (
        OpencvCamera(CLOCK, str(tmp_path), INTRINSICS, rate=100.0) as camera,
        pytest.raises(DeviceError, match=r"image-2\.png cannot be read"),
    ):
        assert len(gather(camera, 1)) == 1, "what came before is handed out first"
        for _ in range(50):
            camera.read(1.0)


def test_a_later_image_of_another_size_is_refused(tmp_path):
    numbered(tmp_path, 2)
    cv2.imwrite(str(tmp_path / "image-3.png"), np.zeros((20, 30), np.uint8))
    with (
        OpencvCamera(CLOCK, str(tmp_path), INTRINSICS, rate=100.0) as camera,
        pytest.raises(DeviceError, match="image 2: 30 x 20 pixels"),
    ):
        for _ in range(50):
            camera.read(1.0)


def test_damaged_jpegs_are_counted_and_many_are_a_fault():
    good = cv2.imencode(".jpg", np.full((48, 64), 90, np.uint8))[1].tobytes()
    assert _decoded(good + b"\0" * 50).jpeg == good, "a padded buffer is cut"
    assert _decoded(good[:200]).image is None and _decoded(b"").image is None
    # Motion JPEG may leave its Huffman tables out: OpenCV fills them in, other readers would not.
    start = good.index(b"\xff\xc4")
    assert b"\xff\xc4" not in _decoded(good[:start]).jpeg
    camera = OpencvCamera(CLOCK, "http://127.0.0.1/x", INTRINSICS)
    feed = iter([_decoded(good), *[_decoded(good[:200])] * 3, _decoded(good), *[_decoded(b"")] * 20])
    camera._open_source = lambda: (lambda: next(feed, None), lambda: None)
    with camera, pytest.raises(DeviceError, match="damaged images in a row"):
        for _ in range(50):
            camera.read(1.0)
    assert camera.damaged >= 3 and camera._sequence == 2


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"backend": "gstream"}, "v4l2"),
        ({"fourcc": "JPEG2"}, "four letters"),
        ({"exposure": -3}, "exposure"),
        ({"exposure": "long"}, "exposure"),
    ],
)
def test_settings_that_mean_nothing_are_refused(setting, words):
    with pytest.raises(UsageError, match=words):
        OpencvCamera(CLOCK, 0, INTRINSICS, **setting)


class Capture:
    """What OpenCV does with a camera, as far as settings go."""

    def __init__(self, backend, fixed=()):
        self.values, self.backend, self.fixed = {}, backend, fixed

    def getBackendName(self):
        return self.backend

    def set(self, key, value):
        if key in self.fixed:
            return False
        self.values[key] = value
        return True

    def get(self, key):
        return self.values.get(key, 0.0)


def test_what_a_camera_is_asked_for():
    camera = OpencvCamera(CLOCK, 0, INTRINSICS, rate=60.0, exposure=5.0, gain=2.0)
    capture = Capture("V4L2", fixed=(cv2.CAP_PROP_FPS,))
    camera._set_up(capture)
    assert capture.values[cv2.CAP_PROP_FOURCC] == cv2.VideoWriter.fourcc(*"MJPG")
    assert capture.values[cv2.CAP_PROP_FRAME_WIDTH] == 64 and capture.values[cv2.CAP_PROP_FRAME_HEIGHT] == 48
    assert capture.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1 and capture.values[cv2.CAP_PROP_EXPOSURE] == 50
    assert capture.values[cv2.CAP_PROP_BUFFERSIZE] == 1
    assert camera.notes == ["camera 0: rate 60 asked, 0 given"]
    assert camera._ask_for_jpeg(capture) and capture.values[cv2.CAP_PROP_CONVERT_RGB] == 0
    windows = Capture("DSHOW")
    camera._set_up(windows)
    assert windows.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 0.25
    assert windows.values[cv2.CAP_PROP_EXPOSURE] == pytest.approx(-7.64, abs=0.01)
    assert not camera._ask_for_jpeg(windows), "this back-end decodes"
