"""Renders a cube with AprilTags as a camera sees it: a grey image by ray casting, with shading, blur and noise.

It shares no code with the pose estimation, so that each can test the other. Conventions are those of
``tacdata/tags/README.md``: camera x right, y down, z forward; whole pixel coordinates at pixel centres; each tag
upright as OpenCV draws it, with cube z up on the side faces and cube y up on the top face.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.noise_stretch import NoiseStretch

# outward normal and image-right direction of each face, cube frame; right x up = normal
FACES = {
    "+x": ((1, 0, 0), (0, 1, 0)),
    "-x": ((-1, 0, 0), (0, -1, 0)),
    "+y": ((0, 1, 0), (-1, 0, 0)),
    "-y": ((0, -1, 0), (1, 0, 0)),
    "+z": ((0, 0, 1), (1, 0, 0)),
    "-z": ((0, 0, -1), (1, 0, 0)),
}
LIGHT = np.array([-0.4, -0.7, -0.6]) / np.linalg.norm([-0.4, -0.7, -0.6])
"""Direction from the cube towards the lamp, camera frame: above, left, behind the camera."""
WHITE, BLACK, BACKGROUND = 225.0, 28.0, 120.0
"""Grey values [1 of 255] of paper and ink under full light, and of the bench."""
AMBIENT = np.float32(0.55)
"""Share of ambient light [1]."""
MOMENTS = 9
"""Poses rendered during the exposure of a moving cube [count]."""
CELL = 24
"""Texels per tag cell."""


def render_cube(
    pose_camera_cube: np.ndarray,
    intrinsics: dict[str, Any],
    cube: dict[str, Any],
    rng: np.random.Generator | NoiseStretch,
) -> np.ndarray:
    """Return a grey image, uint8, shape (height, width).

    Args:
        pose_camera_cube: Cube frame in the camera frame, homogeneous, shape (4, 4), translation in [m]. The
            cube's origin is its centre.
        intrinsics: ``width``, ``height`` [px], ``fx``, ``fy``, ``cx``, ``cy`` [px] and, if any,
            ``distortion`` (OpenCV order), as in a rig file.
        cube: ``side`` and ``tag`` [mm] and ``ids`` by face, as in a rig file. Faces without id are blank.
        rng: Source of the noise.
    """
    return render_scene([(pose_camera_cube, cube)], intrinsics, rng)


def render_scene(
    cubes: Sequence[tuple[np.ndarray, dict[str, Any]]],
    intrinsics: dict[str, Any],
    rng: np.random.Generator | NoiseStretch,
    look: Look | None = None,
) -> np.ndarray:
    """Return a grey image of several cubes, uint8, shape (height, width).

    Args:
        cubes: Pose [m] and cube [mm], as for `render_cube`, of each.
        intrinsics: The camera.
        rng: Source of the noise.
        look: Optics, light and obstacles.
    """
    look = look or Look()
    width, height = intrinsics["width"], intrinsics["height"]
    image = (_bench(width, height) if look.background is None else look.background).astype(np.float32)
    boxes = [
        box
        # The farthest first: nearer cubes cover it.
        for pose, cube in sorted(cubes, key=lambda item: -float(item[0][2, 3]))
        if (box := _compose(image, pose, intrinsics, cube, look)) is not None
    ]
    return expose(image, boxes if look.background is None else [(0, 0, width, height)], look, rng)


def expose(
    image: np.ndarray, boxes: list[tuple[int, int, int, int]], look: Look, rng: np.random.Generator | NoiseStretch
) -> np.ndarray:
    """Turn a sharp scene into a camera's image, uint8: blur, light, noise.

    Args:
        image: The scene's grey values, float32, shape (height, width).
        boxes: Left, top, right, bottom [px] of the objects; only there the blur is computed.
        look: Optics, light and obstacles.
        rng: Source of the noise.
    """
    import cv2

    height, width = image.shape
    _put_before(image, look)
    image *= _light(width, height, look)
    margin = int(np.ceil(4 * look.blur)) + 1
    # Blurred from a copy: where two boxes overlap, nothing is blurred twice.
    sharp = image.copy()
    for left, top, right, bottom in [(0, 0, width, height)] if look.covers or look.shadow else boxes:
        rows, columns = slice(max(top - margin, 0), bottom + margin), slice(max(left - margin, 0), right + margin)
        image[rows, columns] = cv2.GaussianBlur(sharp[rows, columns], (0, 0), look.blur)
    image += look.noise * rng.standard_normal((height, width), dtype=np.float32)
    picture = cv2.convertScaleAbs(np.maximum(image, 0.0))
    if look.jpeg is None:
        return picture
    coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, look.jpeg])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))


def _compose(
    image: np.ndarray, pose: np.ndarray, intrinsics: dict[str, Any], cube: dict[str, Any], look: Look
) -> tuple[int, int, int, int] | None:
    """Draw one cube into a sharp image; return the box [px] around it, or None if it is out of view."""
    import cv2

    poses = _through_exposure(pose, look)
    boxes = [box for each in poses if (box := _box(each, intrinsics, cube["side"] / 1000)) is not None]
    if not boxes:
        return None
    corners = np.array(boxes)
    (left, top), (right, bottom) = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
    box = (int(left), int(top), int(right), int(bottom))
    # At most 1.5 million rays: a near cube would need many more.
    fine = max(2, min(look.rays, int(np.sqrt(1.5e6 / ((right - left) * (bottom - top))))))
    lens = Lens(box, fine, intrinsics)
    grey, share = np.zeros((2, bottom - top, right - left), np.float32)
    for each in poses:
        canvas = np.full(((bottom - top) * fine, (right - left) * fine), -1.0, np.float32)
        for face in FACES:
            _draw(canvas, face, each, cube, lens)
        hit = (canvas >= 0).astype(np.float32)
        size = (int(right - left), int(bottom - top))
        grey += cv2.resize(np.maximum(canvas, 0), size, interpolation=cv2.INTER_AREA)
        share += cv2.resize(hit, size, interpolation=cv2.INTER_AREA)
    # Where only some rays of a pixel hit, what lies behind shows through.
    part = image[top:bottom, left:right]
    part += (grey - share * part) / len(poses)
    return box


def _through_exposure(pose: np.ndarray, look: Look) -> list[np.ndarray]:
    """Return the poses, shape (4, 4) [m], of a cube during the exposure."""
    import cv2

    if not (np.any(look.shift) or np.any(look.turn)):
        return [pose]
    poses = []
    for when in (np.arange(MOMENTS) + 0.5) / MOMENTS - 0.5:
        sample = pose.copy()
        sample[:3, :3] = cv2.Rodrigues(when * np.array(look.turn, float))[0] @ pose[:3, :3]
        sample[:3, 3] += when * np.array(look.shift)
        poses.append(sample)
    return poses


def _put_before(image: np.ndarray, look: Look) -> None:
    """Draw an occluder of the cubes, and a shadow, with smooth edges."""
    import cv2

    for polygon, is_shadow in [*((p, False) for p in look.covers), *(((look.shadow, True),) if look.shadow else ())]:
        mask = np.zeros(image.shape, np.uint8)
        # `fillPoly` takes whole numbers with fractional bits: sixteenths of a pixel.
        places = np.round(np.array(polygon) * 16).astype(np.int32)
        cv2.fillPoly(mask, [places], 255, cv2.LINE_AA, shift=4)
        share = mask / np.float32(255)
        image += share * ((-0.55 * image) if is_shadow else (look.cover - image))


def _light(width: int, height: int, look: Look) -> np.ndarray:
    """Return the brightness [1], float32, shape (1, width)."""
    return look.gain * (1 - look.fall * np.linspace(0, 1, width, dtype=np.float32)[None])


class Lens:
    """Rays (x, y, 1) of the fine pixels of a box."""

    def __init__(self, box: tuple[int, int, int, int], fine: int, intrinsics: dict[str, Any]) -> None:
        import cv2

        matrix, distortion = _camera(intrinsics)
        # Fine pixel j of pixel i has its centre at i - 1/2 + (j + 1/2) / fine.
        offset = 0.5 / fine - 0.5
        to_pixel = np.array([[1 / fine, 0, box[0] + offset], [0, 1 / fine, box[1] + offset], [0, 0, 1]])
        self.to_ray = np.linalg.inv(matrix) @ to_pixel
        """Without distortion, shape (3, 3)."""
        self.rays: np.ndarray | None = None
        """With distortion: every fine pixel's ray, float32, shape (3, rows, columns)."""
        if np.any(distortion):
            rows, columns = (box[3] - box[1]) * fine, (box[2] - box[0]) * fine
            v, u = np.mgrid[:rows, :columns].astype(float)
            pixels = np.stack([u, v], axis=-1) / fine + to_pixel[:2, 2]
            # OpenCV's five iterations leave errors up to a tenth of a pixel at the corners of a wide lens.
            until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-7)
            flat = pixels.reshape(-1, 1, 2)
            bent = cv2.undistortPointsIter(flat, matrix, distortion, np.eye(3), np.eye(3), until)
            bent = bent.reshape(rows, columns, 2)
            self.rays = np.stack([bent[..., 0], bent[..., 1], np.ones((rows, columns))]).astype(np.float32)

    def paint(self, canvas: np.ndarray, texture: np.ndarray, to_texture: np.ndarray) -> None:
        """Paint a plane's texture where rays hit it; ``to_texture`` maps rays to texels, shape (3, 3)."""
        import cv2

        border = cv2.BORDER_TRANSPARENT
        if self.rays is None:
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            size = canvas.shape[::-1]
            cv2.warpPerspective(texture, to_texture @ self.to_ray, size, canvas, flags, borderMode=border)
        else:
            u, v, w = np.tensordot(to_texture.astype(np.float32), self.rays, 1)
            w[w == 0] = np.float32(1e-30)  # a ray along the plane never hits it
            cv2.remap(texture, u / w, v / w, cv2.INTER_LINEAR, canvas, borderMode=border)


def _draw(canvas: np.ndarray, face: str, pose: np.ndarray, cube: dict[str, Any], lens: Lens) -> None:
    """Paint one face onto the fine canvas, if it faces the camera."""
    normal, right = (np.array(v, float) for v in FACES[face])
    rotation, side = pose[:3, :3], cube["side"] / 1000
    outward = rotation @ normal
    centre = pose[:3, 3] + outward * side / 2
    if outward @ centre >= 0:
        return
    texture = _texture(cube["ids"].get(face, -1), cube["tag"] / cube["side"])
    if face in cube.get("turned", ()):  # glued on upside down
        texture = np.ascontiguousarray(texture[::-1, ::-1])
    size = len(texture)
    # Columns: the texture's axes (right, down) and its centre; its inverse takes a ray to the face's plane.
    plane = np.stack([rotation @ right * side, rotation @ np.cross(right, normal) * side, centre], axis=-1)
    texels = np.array([[size, 0, size / 2 - 0.5], [0, size, size / 2 - 0.5], [0, 0, 1]])
    light = AMBIENT + (1 - AMBIENT) * max(0.0, float(outward @ LIGHT))
    lens.paint(canvas, light * texture, texels @ np.linalg.inv(plane))


@cache
def _texture(tag_id: int, fraction: float) -> np.ndarray:
    """Return a face's grey values, float32, square: the tag on white paper; id -1 is a blank face.

    Args:
        tag_id: Number in the family tag36h11.
        fraction: Side of the black square over side of the face [1].
    """
    import cv2

    size = round(8 * CELL / fraction)
    texels = (np.arange(size) + 0.5) / size
    cells = np.floor((texels - 0.5) / fraction * 8 + 4).astype(int)
    bits = np.full((10, 10), 255, np.uint8)
    if tag_id >= 0:
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        bits[1:9, 1:9] = cv2.aruco.generateImageMarker(family, tag_id, 8, borderBits=1)
    index = np.clip(cells + 1, 0, 9)
    return np.where(bits[np.ix_(index, index)] > 0, WHITE, BLACK).astype(np.float32)


@cache
def _bench(width: int, height: int) -> np.ndarray:
    """Return the background, float32, shape (height, width): a bench with a darker rear and soft stains."""
    import cv2

    stains = np.random.default_rng(0).normal(0.0, 12.0, (9, 16)).astype(np.float32)
    bench = cv2.resize(stains, (width, height), interpolation=cv2.INTER_CUBIC)
    return bench + np.linspace(BACKGROUND - 40, BACKGROUND, height, dtype=np.float32)[:, None]


def _box(pose: np.ndarray, intrinsics: dict[str, Any], side: float) -> tuple[int, int, int, int] | None:
    """Return left, top, right, bottom [px] of the box around a cube, or None if it is out of view."""
    corners = side / 2 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = corners @ pose[:3, :3].T + pose[:3, 3]
    if points[:, 2].min() < 1e-3:
        return None
    pixels = _project(points, intrinsics)
    margin = 2
    low = np.floor(pixels.min(axis=0)).astype(int) - margin
    high = np.ceil(pixels.max(axis=0)).astype(int) + margin
    left, top = np.maximum(low, 0)
    right, bottom = np.minimum(high, [intrinsics["width"], intrinsics["height"]])
    return (int(left), int(top), int(right), int(bottom)) if right > left and bottom > top else None


def _camera(intrinsics: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the camera matrix, shape (3, 3) [px], and the distortion coefficients."""
    matrix = np.array(
        [[intrinsics["fx"], 0, intrinsics["cx"]], [0, intrinsics["fy"], intrinsics["cy"]], [0, 0, 1]], float
    )
    return matrix, np.array(intrinsics.get("distortion", ()), float)


def _project(points: np.ndarray, intrinsics: dict[str, Any]) -> np.ndarray:
    """Return pixels, shape (n, 2), of points in the camera frame [m], shape (n, 3)."""
    import cv2

    matrix, distortion = _camera(intrinsics)
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, distortion)[0][:, 0]
