"""The parts of a scene as columns of a Rerun recording.

Two timelines: `host_time` (estimated sample time on the host's clock) and `device_frame` (the board's
counter).
"""

import re
from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr

from tacdata.viewers.rerun.bar_table import bar_table
from tacdata.viewers.rerun.timelines import DEVICE, DEVICE_TIME, ELAPSED, HOST
from tacdata.viewers.scene.color_scale import HUES, ColorScale, taxel_colors
from tacdata.viewers.scene.scene import (
    Bars,
    Body,
    CameraView,
    Cloud,
    Curves,
    DepthMaps,
    MotionTrail,
    Scene,
    SkinSurface,
    Span,
    TaxelArray,
)
from tacdata.viewers.scene.shading import body_normals, cube_axes, normals

# PuOr is not among Rerun's colour maps; this one has a middle too and was made for any colour vision.
COLORMAPS = {"viridis": rr.components.Colormap.Viridis, "PuOr": rr.components.Colormap.CyanToYellow}
AXIS_COLORS = (HUES[5], HUES[2], HUES[4])
"""x, y, z of a cube: vermilion, green, sky blue."""
BODY_COLOR, OUTLINE_COLOR, TIP_COLOR = (170, 178, 189, 150), (140, 140, 140), (255, 255, 255)


def entity(group: str, name: str) -> str:
    """Return where the part of a group is written: Rerun wants neither spaces nor signs in paths."""
    return f"{group}/{re.sub(r'[^A-Za-z0-9_/.-]+', '_', name)}"


def heat_map_of(array: TaxelArray) -> str:
    """Return the entity of an array's picture."""
    return entity("heat_map", array.name) if array.name else "heat_map"


def marks_of(name: str) -> str:
    """Return the entity of the marks over a map: the board's pixels are not those of the others."""
    return "maps/marks_board" if name == "board" else "maps/marks"


class RerunParts:
    """Writes a scene's parts into one recording."""

    def __init__(self, recording: rr.RecordingStream, scene: Scene) -> None:
        self._recording, self._scene = recording, scene

    def write(self) -> None:
        """Write everything."""
        scene = self._scene
        self._static("about", rr.TextDocument(scene.summary, media_type=rr.MediaType.MARKDOWN))
        self._static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        self._footprint()
        for array in scene.arrays:
            self._taxels(array)
        for curves in (*scene.curves, *((scene.tip,) if scene.tip else ())):
            self._curves(curves)
        for maps in scene.maps:
            self._maps(maps)
        if scene.maps and scene.footprint is not None:
            # Maps of one grid share their marks: the first of them wins, as it is written into the dictionary last.
            for maps in {marks_of(layer.name): layer for layer in reversed(scene.maps)}.values():
                self._map_marks(maps)
        for surface in scene.surfaces:
            self._surface(surface)
        for body in scene.bodies:
            self._body(body)
        for camera in scene.cameras:
            self._camera(camera)
        for trail in scene.trails:
            self._trail(trail)
        for cloud in scene.clouds:
            self._cloud(cloud)
        for bars in scene.bars:
            self._bars(bars)
        for page in scene.pages:
            self._static(f"pages/{page.name}", rr.EncodedImage(contents=page.png, media_type="image/png"))
        self._spans("phase", self._scene.phases)
        self._spans("notes", self._scene.notes)

    def _static(self, path: str, *parts: rr.AsComponents) -> None:
        self._recording.log(path, *parts, static=True)

    def _columns(self, path: str, time_ns: np.ndarray, columns: Iterable) -> None:
        if not len(time_ns):
            return
        if not self._scene.on_host_clock:
            # Times of verdicts and predictions have no date.
            elapsed = [rr.TimeColumn(ELAPSED, duration=1e-9 * time_ns)]
            self._recording.send_columns(path, indexes=elapsed, columns=columns)
            return
        indexes = [
            rr.TimeColumn(HOST, timestamp=time_ns.astype("datetime64[ns]")),
            rr.TimeColumn(DEVICE, sequence=self._scene.frame_at(time_ns)),
        ]
        if len(self._scene.device_ns):
            indexes.append(rr.TimeColumn(DEVICE_TIME, duration=1e-9 * self._scene.device_at(time_ns)))
        self._recording.send_columns(path, indexes=indexes, columns=columns)

    def _curves(self, curves: Curves) -> None:
        array = next((a for a in self._scene.arrays if a.values.shape[1] == len(curves.labels) > 6), None)
        if array is not None:
            # Neighbouring taxels have neighbouring colours, so that a curve shows its place.
            colors = taxel_colors(array.columns, array.rows)
        else:
            colors = np.array([HUES[k % len(HUES)] for k in range(len(curves.labels))], dtype=np.uint8)
        names = [f"{label} [{curves.unit}]" for label in curves.labels]
        self._static(entity("curves", curves.name), rr.SeriesLines(names=names, colors=colors, widths=1.5))
        columns = rr.Scalars.columns(scalars=np.asarray(curves.values, dtype=np.float64))
        self._columns(entity("curves", curves.name), curves.time_ns, columns)

    def _image(self, path: str, time_ns: np.ndarray, pictures: np.ndarray, scale: ColorScale) -> None:
        """Write pictures, shape (n, height, width), that keep their values; the first row is on top."""
        pictures = np.ascontiguousarray(pictures, dtype=np.float32)
        height, width = pictures.shape[1:]
        fixed = rr.DepthImage.from_fields(
            format=rr.components.ImageFormat(width=width, height=height, color_model="L", channel_datatype="F32"),
            colormap=COLORMAPS[scale.colormap],
            depth_range=(scale.low, scale.high),
            meter=1.0,
            magnification_filter="Nearest",
        )
        self._static(path, fixed)
        buffers = pictures.reshape(len(pictures), -1).view(np.uint8)
        self._columns(path, time_ns, rr.DepthImage.columns(buffer=buffers))

    def _maps(self, maps: DepthMaps) -> None:
        self._image(entity("maps", maps.name), maps.time_ns, maps.pictures, maps.scale)

    def _map_marks(self, maps: DepthMaps) -> None:
        """Write the taxels and the nominal tip, where there are any, as marks over the pictures of a grid of pixels."""
        marks = marks_of(maps.name)
        for array in self._scene.arrays[:1]:
            fixed = rr.Points2D(maps.pixels(array.centers), radii=[0.12], colors=[OUTLINE_COLOR])
            self._static(f"{marks}/taxels", fixed)
        tip = self._scene.tip
        if tip is not None:
            self._static(f"{marks}/tip", rr.Points2D.from_fields(radii=[0.4], colors=[TIP_COLOR]))
            columns = rr.Points2D.columns(positions=maps.pixels(tip.values))
            self._columns(f"{marks}/tip", tip.time_ns, columns)

    def _taxels(self, taxels: TaxelArray) -> None:
        if len(taxels.time_ns):
            self._image(heat_map_of(taxels), taxels.time_ns, taxels.grid[:, ::-1], taxels.scale)
        if taxels.name or not len(taxels.time_ns):
            return  # a finger's board moves; its signal is shown flat
        names = [f"taxel {k}" for k in range(len(taxels.centers))]
        fixed = rr.Points3D.from_fields(
            positions=taxels.centers, radii=[taxels.radius], labels=names, show_labels=False
        )
        self._static("world/taxels", fixed)
        count = np.full(len(taxels.values), len(taxels.centers))
        colors = rr.Points3D.columns(colors=taxels.scale.rgb(taxels.values).reshape(-1, 3)).partition(count)
        self._columns("world/taxels", taxels.time_ns, colors)

    def _footprint(self) -> None:
        if self._scene.footprint is None:
            return
        low, high = self._scene.footprint
        box = rr.Boxes3D(
            mins=[low], sizes=[high - low], colors=[OUTLINE_COLOR], radii=[0.02], fill_mode="MajorWireframe"
        )
        self._static("world/footprint", box)

    def _surface(self, surface: SkinSurface) -> None:
        path, vertices = entity("world/skin", surface.name), surface.vertices
        count = np.full(len(vertices), vertices.shape[1])
        flat = vertices.reshape(-1, 3)
        colors = surface.colors.reshape(-1, 3)
        self._static(path, rr.Mesh3D.from_fields(triangle_indices=surface.faces))
        columns = rr.Mesh3D.columns(
            vertex_positions=flat, vertex_colors=colors, vertex_normals=normals(surface).reshape(-1, 3)
        )
        self._columns(path, surface.time_ns, columns.partition(count))

    def _body(self, body: Body) -> None:
        path = f"world/{body.name}"
        mesh = rr.Mesh3D(
            vertex_positions=body.vertices,
            triangle_indices=body.faces,
            albedo_factor=BODY_COLOR,
            vertex_normals=body_normals(body),
        )
        self._static(path, mesh)
        if body.axes:
            arrows = rr.Arrows3D(vectors=body.axes * np.eye(3), colors=AXIS_COLORS, radii=[0.03 * body.axes])
            self._static(f"{path}/axes", arrows)
        if body.quaternion.ndim == 1:
            self._static(path, rr.Transform3D.from_fields(quaternion=rr.Quaternion(xyzw=body.quaternion)))
            self._columns(path, body.time_ns, rr.Transform3D.columns(translation=body.position))
        else:
            columns = rr.Transform3D.columns(translation=body.position, quaternion=body.quaternion)
            self._columns(path, body.time_ns, columns)

    def _trail(self, trail: MotionTrail) -> None:
        color = HUES[trail.hue % len(HUES)]
        full, pale = (110, 50) if trail.faint else (255, 90)
        for name, doubtful, rgba in (("seen", False, (*color, full)), ("bridged", True, (*color, pale))):
            strips = trail.strips(doubtful)
            if strips:
                self._static(f"world/paths/{trail.name}/{name}", rr.LineStrips3D(strips, colors=[rgba]))

    def _cloud(self, cloud: Cloud) -> None:
        path = f"contact/{cloud.name}"
        self._static(path, rr.Points3D.from_fields(radii=[cloud.radius]))
        colors = cloud.scale.rgb(cloud.values)
        columns = rr.Points3D.columns(positions=cloud.position, colors=colors).partition(cloud.count)
        self._columns(path, cloud.time_ns, columns)

    def _bars(self, bars: Bars) -> None:
        # Rerun's own bars carry no names; a table with bars of letters has both.
        self._static(f"bars/{bars.name}", rr.TextDocument(bar_table(bars), media_type=rr.MediaType.MARKDOWN))

    def _camera(self, camera: CameraView) -> None:
        path = f"cameras/{camera.name}"
        pinhole = rr.Pinhole(
            image_from_camera=camera.matrix,
            width=camera.width,
            height=camera.height,
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=2 * camera.cube_side,
        )
        self._static(f"{path}/image", pinhole)
        if camera.images:
            columns = rr.EncodedImage.columns(blob=list(camera.images), media_type=["image/jpeg"] * len(camera.images))
            self._columns(f"{path}/image", camera.image_ns, columns)
        self._axes(f"{path}/cube", camera)
        for finger in camera.fingers:
            self._axes(f"{path}/{finger.name}", finger)

    def _axes(self, path: str, camera: CameraView) -> None:
        if len(camera.cube_ns):
            origins, vectors, count = cube_axes(camera)
            self._static(path, rr.Arrows3D.from_fields(radii=[0.04 * camera.cube_side]))
            colors = np.tile(AXIS_COLORS, (len(origins) // 3, 1))
            columns = rr.Arrows3D.columns(origins=origins, vectors=vectors, colors=colors).partition(count)
            self._columns(path, camera.cube_ns, columns)

    def _spans(self, entity_path: str, phases: Sequence[Span]) -> None:
        if not phases:
            return
        # An empty state ends the phase before, where no other follows at once.
        changes = {span.end_ns: "" for span in phases} | {span.start_ns: span.name for span in phases}
        times = np.array(sorted(changes), dtype=np.int64)
        columns = rr.StateChange.columns(state=[changes[t] for t in times.tolist()])
        names = list(dict.fromkeys(span.name for span in phases))
        colors = [(*HUES[k % len(HUES)], 255) for k in range(len(names))]
        self._static(entity_path, rr.StateConfiguration(values=names, labels=names, colors=colors))
        self._columns(entity_path, times, columns)
