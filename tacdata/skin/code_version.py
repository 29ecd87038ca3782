"""Version of the code that decides the result of a press: part of the model's version."""

from __future__ import annotations

from pathlib import Path

from tacdata import provenance, registry

UNDECIDING = tuple(
    f"tacdata.skin.{name}" for name in ("derivatives", "mesh.generation", "mesh.build", "mesh.pin", "code_version")
)
"""Code of the skin that is left out: a press needs no derivatives, and a mesh has a hash of its own."""
PLUGGABLE = ("tacdata.indenters", "tacdata.skin.materials", "tacdata.skin.adhesions")
"""Rooms whose plug-ins can decide a press."""


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
