"""Versions of a skin model and of its code, found without the solver's libraries."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from tacdata import provenance, registry
from tacdata.sensor import Sensor
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.solve.settings import ModelSettings

UNDECIDING = tuple(
    f"tacdata.skin.{name}" for name in ("derivatives", "mesh.generation", "mesh.build", "mesh.pin", "code_version")
)
"""Code of the skin that is left out: a press needs no derivatives, and a mesh has a hash of its own."""
PLUGGABLE = ("tacdata.indenters", "tacdata.skin.materials", "tacdata.skin.adhesions")
"""Rooms whose plug-ins can decide a press."""


def model_identity(
    sensor: Sensor, settings: ModelSettings, mesh: SkinMesh, companion: SkinMesh | None
) -> dict[str, str]:
    """Return everything that decides a model's result: hashes of sensor, meshes and code, and the settings."""
    # The companion decides the stated error, and starts of loading: another one gives other bits.
    coarse = {"companion": companion.content_hash} if settings.error_estimate and companion else {}
    values = asdict(settings)
    if not settings.alone:
        # Results without it are those of releases that did not have it.
        del values["alone"]
    return {
        "sensor": sensor.content_hash,
        "mesh": mesh.content_hash,
        **coarse,
        "settings": provenance.content_hash(values),
        **code_versions(),
    }


def code_versions() -> dict[str, str]:
    """Return the versions of the code of the skin and of the indenters, which are part of it by their shapes."""
    return {
        "code": provenance.code_hash("tacdata.skin", without=UNDECIDING),
        "indenters": provenance.code_hash("tacdata.indenters"),
        **_plug_ins(),
    }


def _plug_ins() -> dict[str, str]:
    """Return the version of the plug-ins that can decide a press; nothing where there are none."""
    sources: list[Path] = [path for room in PLUGGABLE for path in registry.plug_ins(room).values()]
    return {"plug_ins": provenance.content_hash([provenance.file_hash(path) for path in sources])} if sources else {}
