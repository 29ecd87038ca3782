"""Which code of the skin decides what a press gives: its version is part of the model's."""

from __future__ import annotations

from tacdata import provenance

UNDECIDING = tuple(
    f"tacdata.skin.{name}" for name in ("derivatives", "mesh.generation", "mesh.build", "mesh.pin", "code_version")
)
"""Code of the skin that is left out: a press needs no derivatives, and a mesh has a hash of its own."""


def code_versions() -> dict[str, str]:
    """Return the versions of the code of the skin and of the indenters, which are part of it by their shapes."""
    return {
        "code": provenance.code_hash("tacdata.skin", without=UNDECIDING),
        "indenters": provenance.code_hash("tacdata.indenters"),
    }
