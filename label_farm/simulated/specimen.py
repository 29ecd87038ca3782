"""Draws the specimens of one design: their skins, and the parameters of their boards."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.label_farm.simulated.plan import SpecimenSpread
from tacdata.sensor import Sensor
from tacdata.transduction import Transducer

if TYPE_CHECKING:
    from tacdata.skin.mesh.skin_mesh import SkinMesh

_STREAM = 42
"""Separates the random numbers of specimens from those of presses and noise."""
_FARTHEST = 2.0
"""Largest distance of a drawn value from its mean, over the standard deviation [1]."""
_INCOMPRESSIBLE = 0.495
"""Largest Poisson's ratio that is drawn [1]."""
_SKIN = {
    "thickness": ("skin", "thickness"),
    "youngs_modulus": ("material", "youngs_modulus"),
    "poisson_ratio": ("material", "poisson_ratio"),
    "friction": ("contact", "friction"),
}
"""Spread in the sensor file -> the entry that it is of. The others are of registration and of indenters."""


def draw_specimen(sensor: Sensor, spread: SpecimenSpread, seed: int, number: int) -> Sensor:
    """Return specimen ``number`` of a design: a sensor with values of its own, and no spread any more.

    A skin's thickness, modulus, Poisson's ratio and friction are drawn by the sensor file's uncertainty.
    Registration is not drawn: places are random already, and labels are of the place that was pressed.

    Raises:
        FormatError: If the sensor file has no transduction, or lacks a parameter that is to vary.
    """
    transducer = Transducer.of(sensor)
    rng = np.random.default_rng([seed, _STREAM, number])
    document = sensor.document
    document.pop("uncertainty", None)
    document["name"] = f"{sensor.name}-specimen-{number}"
    for name, (part, entry) in _SKIN.items():
        drawn = _normal(rng)  # drawn in any case, so that the other draws do not depend on which parameters vary
        if spread.skin and name in sensor.uncertainty:
            document[part][entry] = _kept(name, document[part][entry] + sensor.uncertainty[name] * drawn)
    stated = document["transduction"]
    count = sensor.taxels.count
    shared = 1 + spread.shared_gain * _normal(rng)
    stated["gain"] = [
        round(v, 4) for v in (transducer.gain * shared * (1 + spread.gain * _normal(rng, count))).tolist()
    ]
    stated["offset"] = [round(v, 2) for v in (transducer.offset + spread.offset * _normal(rng, count)).tolist()]
    values = {**vars(transducer.principle), **stated.get("parameters", {})}
    # Sorted, so that draws do not depend on the order of a file's entries.
    for name, share in sorted(spread.parameters.items()):
        if name not in values:
            raise FormatError(
                f"specimens/parameters: {name}",
                f"parameters of {stated['principle']}: {', '.join(values)}",
                "name one of these, or leave it out",
            )
        value = np.asarray(values[name], dtype=float) * (1 + share * _normal(rng))
        stated.setdefault("parameters", {})[name] = value.round(6).tolist()
    return Sensor.from_document(document, document["name"])


def stretched(mesh: SkinMesh, thickness: float, target: float) -> SkinMesh:
    """Return the mesh of a slab as one of another thickness [mm]: heights above the protrusions are scaled.

    A new mesh would differ at random, in more than the thickness.
    """
    nodes = mesh.nodes.copy()
    slab = nodes[:, 2] > 0
    nodes[slab, 2] *= target / thickness
    return replace(mesh, nodes=nodes)


def differences(specimen: Sensor, design: Sensor) -> dict[str, Any]:
    """Return the differences of a specimen from the design, for its record."""
    varied, common = specimen.document, design.document
    skin = {
        name: varied[part][entry] for name, (part, entry) in _SKIN.items() if varied[part][entry] != common[part][entry]
    }
    return {"name": specimen.name, **skin, "transduction": varied["transduction"]}


def _normal(rng: np.random.Generator, count: int | None = None) -> Any:
    return np.clip(rng.standard_normal(count), -_FARTHEST, _FARTHEST)


def _kept(name: str, value: float) -> float:
    value = max(value, 0.0) if name == "friction" else value
    return round(float(min(value, _INCOMPRESSIBLE) if name == "poisson_ratio" else value), 5)
