"""The sensor as immutable data, read from its file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, registry, schemas
from tacdata.display import Displayed
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.sensor.adhesion import Adhesion
from tacdata.sensor.material import Material
from tacdata.sensor.skin import Skin
from tacdata.sensor.transduction import Transduction

SHIPPED = "tacprint"
"""Name of the sensor that ships."""


@dataclass(frozen=True)
class Taxels:
    """The taxel array. Taxel k = i + columns * j is at x = pitch_x (i - (columns-1)/2), y likewise with j."""

    columns: int
    """Taxels along x."""
    rows: int
    """Taxels along y."""
    pitch_x: float
    """Column spacing [mm]."""
    pitch_y: float
    """Row spacing [mm]."""
    rate: float = 30.0
    """Nominal frame rate [Hz]."""

    @property
    def count(self) -> int:
        """Number of taxels."""
        return self.columns * self.rows

    @property
    def centers(self) -> np.ndarray:
        """Taxel centres [mm], shape (count, 2), sensor frame, x running fastest."""
        x = self.pitch_x * (np.arange(self.columns) - (self.columns - 1) / 2)
        y = self.pitch_y * (np.arange(self.rows) - (self.rows - 1) / 2)
        return np.stack(np.meshgrid(x, y, indexing="xy"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class ContactProperties:
    """Contact properties: friction, bonding, board, adhesion."""

    friction: float
    """Coulomb coefficient between indenter and skin [1]."""
    bonded: tuple[str, ...]
    """Faces fixed to the support: "sides", "bottom" (the underside between protrusions), "rim" (its border)."""
    board: bool = False
    """True if a rigid board carries the protrusions' tips, at z = -skin.protrusion_tip (unilateral contact)."""
    rim_width: float = 1.0
    """Width of the underside's border that "rim" fixes [mm]."""
    adhesion: Adhesion | None = None
    """Adhesion of the outer face to the indenter; None without."""

    @property
    def document(self) -> dict[str, Any]:
        """The contact as its part of the sensor's document; unused entries are left out."""
        values: dict[str, Any] = {**asdict(self), "bonded": list(self.bonded)}
        if "rim" not in self.bonded:
            del values["rim_width"]
        if self.adhesion is None:
            del values["adhesion"]
        return values


@dataclass(frozen=True)
class DepthMap:
    """The label's pixel grid, centred on the array: array[i, j] has i along x and j along y."""

    pixels_x: int
    """Pixels along x."""
    pixels_y: int
    """Pixels along y."""
    pixel_pitch: float
    """Side of a pixel [mm]."""
    depth_max: float
    """D_max of the label scaling [mm]."""
    sampling: str = "point"
    """How a pixel gets its value: "point" (at its centre) or "area" (mean over its square)."""

    @property
    def document(self) -> dict[str, Any]:
        """The map as its part of the sensor's document; default sampling is left out."""
        return {k: v for k, v in asdict(self).items() if (k, v) != ("sampling", "point")}

    @property
    def shape(self) -> tuple[int, int]:
        """Array shape (pixels_x, pixels_y)."""
        return self.pixels_x, self.pixels_y

    @property
    def x(self) -> np.ndarray:
        """Pixel centres along x [mm], shape (pixels_x,)."""
        return self.pixel_pitch * (np.arange(self.pixels_x) - (self.pixels_x - 1) / 2)

    @property
    def y(self) -> np.ndarray:
        """Pixel centres along y [mm], shape (pixels_y,)."""
        return self.pixel_pitch * (np.arange(self.pixels_y) - (self.pixels_y - 1) / 2)


@dataclass(frozen=True, repr=False)
class Sensor(Displayed):
    """One taxel skin. Frame: x along columns, y along rows, z outward, origin at the array's centre on z = 0.

    Example:
        >>> import tacdata as td
        >>> sensor = td.read_sensor("tacprint")
        >>> document = sensor.document
        >>> document["skin"]["thickness"] = 3.0
        >>> thinner = td.Sensor.from_document(document, "my sensor")
        >>> thinner.content_hash == sensor.content_hash  # its labels are other ones
        False
    """

    name: str
    taxels: Taxels
    skin: Skin
    material: Material
    contact: ContactProperties
    map: DepthMap
    assumptions: dict[str, str]
    """Field path -> why the value is an assumption."""
    source: str = ""
    transduction: Transduction | None = None
    """Transduction from loads to counts; None if the file has none."""
    uncertainty: dict[str, float] = field(default_factory=dict)
    """Standard deviations of the skin model's parameters, in their units; empty if the file has none."""

    @property
    def document(self) -> dict[str, Any]:
        """The sensor as its file's document (`schemas/sensor.schema.json`)."""
        document = {"version": schemas.version("sensor"), **asdict(self), "material": self.material.document}
        del document["transduction"]
        if not self.uncertainty:
            del document["uncertainty"]
        if self.transduction:
            document["transduction"] = self.transduction.document
        # These leave out what is at its default, so that hashes of older files stay valid.
        for name in ("skin", "contact", "map"):
            document[name] = getattr(self, name).document
        return document

    def description(self) -> Iterator[str]:
        """Yield the sensor: array, skin, material, map."""
        taxels, skin, material, grid = self.taxels, self.skin, self.material, self.map
        pitch = f"{taxels.pitch_x:g} × {taxels.pitch_y:g} mm"
        yield f"Sensor {self.name}: {taxels.columns} × {taxels.rows} taxels, {pitch} apart, {taxels.rate:g} Hz"
        yield f"skin {skin.size_x:g} × {skin.size_y:g} mm, {skin.thickness:g} mm thick"
        yield f"{material.law}, E {material.youngs_modulus:g} MPa, Poisson's ratio {material.poisson_ratio:g}"
        yield f"depth maps of {grid.pixels_x} × {grid.pixels_y} pixels, {grid.pixel_pitch:g} mm apart"
        if self.assumptions:
            yield f"{len(self.assumptions)} values are assumptions (`assumptions` has the reasons)"

    @cached_property
    def content_hash(self) -> str:
        """Hash of every value that can change a label; without names, remarks, uncertainties and transduction."""
        # A surface counts by its content: a renamed file makes the same labels.
        document = {**self.document, "skin": self.skin.identity}
        return provenance.content_hash({k: document[k] for k in ("taxels", "skin", "material", "contact", "map")})

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str, folder: Path | None = None) -> Sensor:
        """Build a sensor from a parsed file.

        Args:
            document: The file's document.
            origin: Names it in errors.
            folder: Folder that the name of a surface file is relative to.

        Raises:
            UsageError: If a surface file is not found.
            FormatError: If the document breaks the schema or its parts contradict each other.
        """
        documents.check(document, "sensor", origin)
        contact = dict(document["contact"])
        contact["bonded"] = tuple(contact["bonded"])
        if "adhesion" in contact:
            contact["adhesion"] = Adhesion(**contact["adhesion"])
        sensor = cls(
            name=document["name"],
            taxels=Taxels(**document["taxels"]),
            skin=Skin.from_document(document["skin"], origin, folder),
            material=Material.from_document(document["material"], origin),
            contact=ContactProperties(**contact),
            map=DepthMap(**document["map"]),
            assumptions=dict(document["assumptions"]),
            source=document.get("source", ""),
            transduction=(
                Transduction.from_document(document["transduction"], Taxels(**document["taxels"]).count, origin)
                if "transduction" in document
                else None
            ),
            uncertainty=dict(document.get("uncertainty", {})),
        )
        _check_consistency(sensor, origin)
        return sensor


def _check_consistency(sensor: Sensor, origin: str) -> None:
    taxels, skin = sensor.taxels, sensor.skin
    for axis, count, pitch, size in (
        ("x", taxels.columns, taxels.pitch_x, skin.size_x),
        ("y", taxels.rows, taxels.pitch_y, skin.size_y),
    ):
        # The outermost protrusions must stand whole on the skin.
        needed = (count - 1) * pitch + 2 * skin.protrusion_radius
        if needed > size:
            raise FormatError(
                f"{origin}: {count} taxels along {axis} need {needed:g} mm, the skin is {size:g} mm",
                f"an array that fits the footprint along {axis}",
                f"enlarge skin/size_{axis} or reduce taxels/pitch_{axis}",
            )
        if count > 1 and 2 * skin.protrusion_radius > pitch:
            raise FormatError(
                f"{origin}: protrusions of radius {skin.protrusion_radius:g} mm overlap at {pitch:g} mm along {axis}",
                f"a radius of at most {pitch / 2:g} mm",
                "reduce skin/protrusion_radius",
            )
    skin.check(origin, sensor.contact.board)
    _check_contact(sensor, origin)


def _check_contact(sensor: Sensor, origin: str) -> None:
    contact = sensor.contact
    # A free body has no equilibrium under a press.
    if not contact.bonded and not contact.board:
        raise FormatError(
            f"{origin}: nothing holds the skin (no bonded face, no board)",
            "at least one bonded face, or a board",
            "set contact/bonded or contact/board",
        )
    if contact.board and "bottom" in contact.bonded:
        raise FormatError(
            f"{origin}: contact/bonded holds the underside in place and contact/board lets the protrusions carry it",
            "a bonded bottom or a board, not both",
            "take bottom out of contact/bonded, or set contact/board: false",
        )
    smallest = min(sensor.skin.size_x, sensor.skin.size_y) / 2
    if "rim" in contact.bonded and contact.rim_width >= smallest:
        raise FormatError(
            f"{origin}: contact/rim_width {contact.rim_width:g} mm covers the whole underside",
            f"less than {smallest:g} mm",
            "reduce contact/rim_width, or bond the bottom",
        )
    if contact.board and not sensor.skin.protrusion_radius:
        raise FormatError(
            f"{origin}: a board carries protrusions, and protrusion_radius is 0 mm",
            "a positive protrusion_radius with a board, or board: false",
            "for a plain slab on a support, bond its bottom",
        )


def read_sensor(path: StrPath) -> Sensor:
    """Read a sensor file, or the one that ships by its name ``tacprint``; the plug-ins that it names are available.

    Raises:
        UsageError: If it does not exist, or its folder of plug-ins.
        FormatError: If it is damaged or contradicts itself.

    Example:
        >>> import tacdata as td
        >>> sensor = td.read_sensor("examples/own_sensor.yaml")
        >>> sensor.name, sensor.taxels.columns, sensor.taxels.rows
        ('flat_pad', 4, 4)
        >>> sensor.taxels.centers[0]  # of the first taxel, mm
        array([-7.5, -7.5])
    """
    path = Path(path)
    if str(path) == SHIPPED and not path.exists():
        return default_sensor()
    document = documents.read(path, "sensor")
    if "plugins" in document:
        # Before the sensor is built, as its material or principle may be a plug-in.
        registry.add_folder(path.parent / document["plugins"])
    return Sensor.from_document(document, str(path), path.parent)


def default_sensor() -> Sensor:
    """Return the sensor of the paper (`tacdata/sensor/tacprint.yaml`).

    Example:
        >>> from tacdata.sensor import default_sensor
        >>> sensor = default_sensor()
        >>> sensor.taxels.count, sensor.map.shape
        (24, (35, 26))
        >>> sensor.skin.thickness  # mm
        3.3
        >>> round(sensor.material.shear_modulus, 3)  # MPa
        0.102
    """
    file = f"{SHIPPED}.yaml"
    return Sensor.from_document(documents.parsed((files("tacdata.sensor") / file).read_text(), file), file)
