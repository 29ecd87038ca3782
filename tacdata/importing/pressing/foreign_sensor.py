"""Describes a foreign sensor as a `Sensor`; unknown values are stand-ins and marked as such."""

from pathlib import Path

from tacdata import schemas
from tacdata.errors import FormatError
from tacdata.importing.mapping import ForeignSensor
from tacdata.sensor import Sensor, read_sensor

UNKNOWN = "not said by the source; a stand-in"


def foreign_sensor(entry: str | ForeignSensor, folder: Path, channels: int, rate: float) -> tuple[Sensor, list[str]]:
    """Return the sensor of an import, and its assumed values.

    Args:
        entry: A sensor file's path relative to the mapping, or the known properties.
        folder: Folder of the mapping.
        channels: Channels in the data.
        rate: Their measured rate [Hz].

    Raises:
        FormatError: If the sensor has another number of channels than the data.
    """
    if isinstance(entry, str):
        sensor = read_sensor(folder / entry)
        if sensor.taxels.count != channels:
            raise FormatError(
                f"{channels} channels in the data, {sensor.taxels.count} taxels in {entry}",
                "the same number",
                "correct taxels/columns in the mapping, or the sensor file",
            )
        return sensor, []
    columns, rows = entry.columns, entry.rows
    if columns is not None and columns * rows != channels:
        raise FormatError(
            f"sensor of {columns} x {rows} channels, {channels} in the data",
            f"columns times rows = {channels}",
            "correct sensor or taxels/columns in the mapping",
        )
    stand_ins: dict[str, str] = {} if columns else {"taxels/columns": f"{UNKNOWN}: all channels in one row"}

    def value(known: float | None, path: str, otherwise: float) -> float:
        if known is None:
            stand_ins[path] = UNKNOWN
        return float(otherwise if known is None else known)

    columns = columns or channels
    pitch_x, pitch_y = value(entry.pitch_x, "taxels/pitch_x", 1.0), value(entry.pitch_y, "taxels/pitch_y", 1.0)
    size_x = value(entry.size_x, "skin/size_x", (columns + 1) * pitch_x)
    size_y = value(entry.size_y, "skin/size_y", (rows + 1) * pitch_y)
    document = {
        "version": schemas.version("sensor"),
        "name": entry.name,
        "source": "imported",
        "taxels": {"columns": columns, "rows": rows, "pitch_x": pitch_x, "pitch_y": pitch_y, "rate": rate},
        "skin": {"size_x": size_x, "size_y": size_y, "thickness": value(entry.thickness, "skin/thickness", 3.0)},
        "material": {
            "law": "neo_hookean",
            "youngs_modulus": value(entry.youngs_modulus, "material/youngs_modulus", 0.3),
            "poisson_ratio": value(entry.poisson_ratio, "material/poisson_ratio", 0.45),
        },
        "contact": {"friction": 0.2, "bonded": ["bottom"]},
        "map": {"pixels_x": 32, "pixels_y": 32, "pixel_pitch": max(size_x, size_y) / 32, "depth_max": 3.0},
        "assumptions": {**stand_ins, "material/law": UNKNOWN, "contact": UNKNOWN, "map": UNKNOWN},
    }
    sensor = Sensor.from_document(document, f"sensor {entry.name}")
    return sensor, [f"{path}: {why}" for path, why in sensor.assumptions.items()]
