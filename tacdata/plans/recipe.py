"""A plan in short form: blocks of sites x depths x speeds x holds x repeats, expanded to presses."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, schemas
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.plans.plan import Plan
from tacdata.plans.sites import sites
from tacdata.sensor import Sensor

COPIED = ("rest", "recovery", "overshoot", "strokes", "stroke", "purpose")
"""Entries of a block that hold for all of its presses."""


def write_out(recipe: dict[str, Any], sensor: Sensor, origin: str, seed: int = 0) -> dict[str, Any]:
    """Return the plan's document (`schemas/plan.schema.json`) of a recipe (`plan_recipe.schema.json`).

    Within a block the repeats of one press follow each other. Then holds vary fastest, then speeds, depths, approach
    directions, sites, tilts and yaws. ``order: random`` shuffles the block.

    Blocks keep their order, but presses of one indenter, yaw and tilt are brought together, so that each is mounted
    once. ``grouped: false`` switches that off.

    Args:
        recipe: The recipe's document.
        sensor: The skin.
        origin: Names the recipe in errors.
        seed: Seed of random sites and orders.

    Raises:
        FormatError: If the recipe breaks its schema, or a press misses the skin or pierces it.
    """
    documents.check(recipe, "plan_recipe", origin)
    # A stream of its own: random sites do not repeat the draws of other plans with this seed.
    rng = np.random.default_rng([seed, 11])
    presses: list[dict[str, Any]] = []
    for number, block in enumerate(recipe["blocks"]):
        presses += _block(block, sensor, rng, f"{origin}: blocks/{number}")
    if recipe.get("grouped", True):
        mountings = list(dict.fromkeys(_mounting(press) for press in presses))
        # Python's sort is stable, so the order within a mounting stays.
        presses.sort(key=lambda press: mountings.index(_mounting(press)))
    document = {
        "version": schemas.version("plan"),
        "name": recipe["name"],
        "purpose": recipe.get("purpose", ""),
        "indenters": recipe["indenters"],
        "motion": recipe["motion"],
        "presses": presses,
    }
    Plan.from_document(document, origin).check_against(sensor)
    return document


def read_recipe(path: StrPath) -> dict[str, Any]:
    """Read a recipe file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged.
    """
    path = Path(path)
    return documents.read(path, "plan_recipe")


def _mounting(press: dict[str, Any]) -> tuple[Any, ...]:
    return press["indenter"], *(press.get(angle, 0.0) for angle in ("yaw", "tilt_x", "tilt_y"))


def _block(block: dict[str, Any], sensor: Sensor, rng: np.random.Generator, origin: str) -> list[dict[str, Any]]:
    places = sites(block["at"], sensor, rng, origin)
    if not len(places):
        raise FormatError(f"{origin}: at: no site", "one or more", "correct the block's at")
    indenters = [block["indenter"]] if isinstance(block["indenter"], str) else block["indenter"]
    copied = {key: block[key] for key in COPIED if key in block}
    entries = []
    for indenter, yaw, tilt, place, side, depth, speed, hold in product(
        indenters,
        block.get("yaws", [0.0]),
        block.get("tilts", [[0.0, 0.0]]),
        places.tolist(),
        block.get("approach_from", [None]),
        block["depths"],
        block.get("speeds", [None]),
        block.get("holds", [None]),
    ):
        x, y = (round(float(value), 3) for value in place)
        entry = {"indenter": indenter, "x": x, "y": y, "yaw": float(yaw)}
        entry |= {name: float(lean) for name, lean in zip(("tilt_x", "tilt_y"), tilt, strict=True) if lean}
        optional = {"approach_from": side, "speed": speed, "hold": hold}
        entry |= {"depth": depth, **{k: v for k, v in optional.items() if v is not None}, **copied}
        entries += [{**entry, "repeat": repeat} for repeat in range(block.get("repeats", 1))]
    if block.get("order") == "random":
        entries = [entries[k] for k in rng.permutation(len(entries))]
    return entries
