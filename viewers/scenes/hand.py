"""The scene of a demonstration or of a robot's targets: fingers in the world, in mm."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.compensation import contact_depth
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.demonstrations.touch import baseline
from tacdata.replay.targets import FingertipTargets
from tacdata.sensor import Sensor
from tacdata.viewers.parts import camera_view, hand_summary, signals
from tacdata.viewers.parts.maps import DEPTH_FLOOR, thinned
from tacdata.viewers.scene import thinning
from tacdata.viewers.scene.color_scale import ColorScale, scale_of
from tacdata.viewers.scene.scene import Body, Cloud, Curves, DepthMaps, MotionTrail, Scene

PAD = (18.0, 14.0, 3.0)
"""Size at which a fingertip without a sensor description is drawn [mm]."""
AXES = 12.0
"""Length of a fingertip's axes [mm]."""


def demonstration_scene(
    title: str,
    demonstration: Demonstration | None,
    recorded: DemoRecording | None = None,
    images: Iterable[tuple[str, int, bytes]] = (),
    remarks: tuple[str, ...] = (),
) -> Scene:
    """Return the scene of a demonstration.

    Args:
        title: Heading.
        demonstration: Its tracks, if it was worked up.
        recorded: The recording, if it is there.
        images: Camera name, time of exposure [ns] and JPEG image.
        remarks: Further remarks.
    """
    scene = Scene(title, "", np.zeros(0, np.int64), np.zeros(0, np.int64), kind="hand")
    if recorded is not None:
        scene = _with_recording(scene, recorded, images)
    if demonstration is not None:
        scene = _with_tracks(scene, demonstration)
    return replace(scene, summary=hand_summary.of_demonstration(title, demonstration, recorded, remarks))


def targets_scene(
    title: str, targets: FingertipTargets, count: int = 0, joints: dict[str, np.ndarray] | None = None
) -> Scene:
    """Return a robot's targets: observed and wanted places of the fingers.

    Args:
        title: Heading.
        targets: The targets of one demonstration.
        count: Number of further demonstrations in its folder.
        joints: Joint values by name [rad or m], shape (n,), NaN where a target cannot be reached.
    """
    time, trails, bodies, curves = targets.time_ns, [], [], []
    for k, name in enumerate(targets.fingers):
        goal, observed = 1000 * targets.position[:, k], 1000 * targets.seen[:, k]
        trails.append(MotionTrail(f"{name}/seen", observed, targets.gap[:, k], k, faint=True))
        trails.append(MotionTrail(f"{name}/target", goal, targets.gap[:, k], k))
        bodies.append(pad(name, time, goal, targets.quaternion[:, k], None))
        gap = _marked(targets.gap[:, k])
        curves.append(Curves(f"target/{name}", "mm", ("x", "y", "z"), time, goal, gap))
        shift = np.linalg.norm(goal - observed, axis=1)[:, None]
        curves.append(Curves(f"moved/{name}", "mm", ("by touch",), time, shift, gap))
    if np.isfinite(targets.depth).any():
        curves.insert(0, Curves("predicted depth", "mm", targets.fingers, time, targets.depth))
    if joints:
        curves.append(Curves("joints", "rad or m", tuple(joints), time, np.column_stack(list(joints.values()))))
    return Scene(
        title,
        hand_summary.of_targets(title, targets, count, joints),
        time,
        np.arange(len(time)),
        curves=tuple(map(signals.thinned, curves)),
        trails=tuple(trails),
        bodies=tuple(bodies),
        kind="hand",
    )


def _with_recording(scene: Scene, recorded: DemoRecording, images: Iterable[tuple[str, int, bytes]]) -> Scene:
    arrays, curves = [], []
    for name, stream in recorded.taxels.items():
        if not len(stream.sample_ns):
            continue
        change = stream.counts - baseline(stream)
        sensor = recorded.rig.sensors[name]
        arrays.append(signals.taxel_array(sensor, stream.sample_ns, change, name))
        labels = signals.taxel_labels(sensor)
        curves.append(Curves(f"taxels/{name}", "counts", labels, stream.sample_ns, change))
        curves.append(signals.delays(name, stream.sample_ns, stream.arrival_ns))
    board = next((s for s in recorded.taxels.values() if len(s.sample_ns)), None)
    cameras = camera_view.hand_views(recorded, images)
    time = board.sample_ns if board else np.array(sorted({t for c in cameras for t in c.cube_ns}), np.int64)
    return replace(
        scene,
        frame_ns=time,
        frame=np.arange(len(time)),
        arrays=tuple(arrays),
        cameras=cameras,
        curves=tuple(map(signals.thinned, curves)),
    )


def _with_tracks(scene: Scene, demonstration: Demonstration) -> Scene:
    time, curves, maps, clouds = demonstration.time_ns, [], [], []
    felt = {name: track for name, track in demonstration.tracks.items() if track.depth is not None}
    # One scale for all fingers, so that their colours compare.
    highest = max((float(np.nan_to_num(t.depth).max()) for t in felt.values() if t.depth is not None), default=0.0)
    scale = scale_of(np.array([highest]), "mm", floor=DEPTH_FLOOR)
    if felt:
        depth = np.column_stack([contact_depth(t.depth) for t in felt.values() if t.depth is not None])
        curves.append(Curves("predicted depth", "mm", tuple(felt), time, depth))
    for name, track in demonstration.tracks.items():
        gap = _marked(track.gap)
        curves.append(Curves(f"fingertip/{name}", "mm", ("x", "y", "z"), time, 1000 * track.position, gap))
        curves.append(Curves(f"spread/{name}", "mm", ("position",), time, 1000 * spread(track)[:, None], gap))
        sensor = demonstration.sensors.get(name)
        if sensor is not None and name in felt:
            finger_maps = depth_of(name, sensor, time, track, scale)
            maps.append(finger_maps)
            clouds.append(contact(finger_maps, track, time))
    return replace(
        scene,
        frame_ns=scene.frame_ns if len(scene.frame_ns) else time,
        frame=scene.frame if len(scene.frame) else np.arange(len(time)),
        curves=tuple(map(signals.thinned, curves)) + scene.curves,
        maps=tuple(maps),
        clouds=tuple(clouds),
        trails=tuple(
            MotionTrail(n, 1000 * t.position, t.gap, k) for k, (n, t) in enumerate(demonstration.tracks.items())
        ),
        bodies=tuple(
            pad(n, time, 1000 * t.position, t.quaternion, demonstration.sensors.get(n))
            for n, t in demonstration.tracks.items()
        ),
    )


def _marked(gap: np.ndarray) -> np.ndarray:
    """Return where a path is bridged, shape (n,), or an empty array if nowhere."""
    return gap if gap.any() else gap[:0]


def spread(track: FingerTrack) -> np.ndarray:
    """Return the standard deviation of the position, mean over the axes [m], shape (n,)."""
    return np.sqrt(np.trace(track.covariance[:, 3:, 3:], axis1=1, axis2=2) / 3)


def depth_of(name: str, sensor: Sensor, time_ns: np.ndarray, track: FingerTrack, scale: ColorScale) -> DepthMaps:
    """Return a finger's predicted maps, at most `thinning.MAPS` of them; without reading 0."""
    depth, x, y = np.nan_to_num(np.asarray(track.depth, np.float32)), sensor.map.x, sensor.map.y
    title = f"{name}: predicted depth, 0 to {scale.high:g} mm"
    return thinned((DepthMaps(f"predicted {name}", x, y, time_ns, depth, scale, title),))[0]


def contact(maps: DepthMaps, track: FingerTrack, time_ns: np.ndarray) -> Cloud:
    """Return where a finger's skin is pressed in by more than 0.1 mm, in the world.

    The fingertip's frame has x along the finger and z out of the pad; the sensor's axes are taken as parallel to it,
    its outer face as the plane through the fingertip.
    """
    rows = np.searchsorted(time_ns, maps.time_ns)
    valid = np.isfinite(track.position[rows]).all(axis=1)
    touched = (maps.values > DEPTH_FLOOR) & np.reshape(valid, (-1, 1, 1))
    frame, i, j = np.nonzero(touched)
    depth = maps.values[touched]
    # A pad's z points outwards: pressed skin lies below its plane.
    local = np.column_stack([maps.x[i], maps.y[j], -depth])
    placed = np.zeros((0, 3))
    if len(frame):
        placed = Rotation.from_quat(track.quaternion[rows[frame]]).apply(local) + 1000 * track.position[rows[frame]]
    return Cloud(track.finger, maps.time_ns, touched.sum(axis=(1, 2)), placed, depth, maps.scale, 0.25)


def pad(name: str, time_ns: np.ndarray, place: np.ndarray, quaternion: np.ndarray, sensor: Sensor | None) -> Body:
    """Return a fingertip as a plate whose outer face is at its origin.

    Args:
        name: The finger.
        time_ns: Times [ns], shape (n,).
        place: Fingertip [mm], shape (n, 3); times without one are left out.
        quaternion: From the fingertip's frame, xyzw [1], shape (n, 4).
        sensor: Its skin, if it is known.
    """
    x, y, z = (sensor.skin.size_x, sensor.skin.size_y, sensor.skin.thickness) if sensor else PAD
    corners = np.array([[a, b, c] for c in (-z, 0.0) for b in (-y / 2, y / 2) for a in (-x / 2, x / 2)])
    sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    # Corners stand once for each side, so that a side is shaded as flat.
    vertices = corners[np.array(sides).reshape(-1)]
    first = 4 * np.arange(6)[:, None]
    faces = np.concatenate([first + np.array(corner) for corner in ((0, 1, 2), (0, 2, 3))])
    rows = np.flatnonzero(np.isfinite(place).all(axis=1))
    rows = rows[thinning.evenly(len(rows), thinning.ARRAYS)]
    return Body(name, vertices, faces, quaternion[rows], time_ns[rows], place[rows], AXES)
