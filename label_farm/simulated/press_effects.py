"""Effects that a verdict named, laid over the readings of simulated presses.

An effect of `tacdata/effects` acts on a single press: its loads and readings are those of the solved press,
frame by frame. The label does not change. So effects that would move the label are refused, and so are those that
grow from press to press.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata import documents
from tacdata.chain import Course, Response, predict
from tacdata.chain.course import Tool
from tacdata.effects import Effect, Parameter, Placed, load
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.simulated.plan import SimulationPlan
from tacdata.labels import Label
from tacdata.sensor import Sensor
from tacdata.transduction import Loads, Transducer

if TYPE_CHECKING:
    from tacdata.recording.episode import Episode

_STREAM = 44
"""Separates the random numbers of effects from those of presses, specimens and noise."""
_ON_LOADS = ("mechanics", "contact")
"""Stages in which an effect changes forces."""

type Value = float | tuple[float, ...]
"""A number; a range (lowest, highest); or a number for each channel."""


@dataclass(frozen=True)
class DrawnEffect:
    """An effect whose numbers are drawn for each specimen."""

    effect: Effect
    values: dict[str, Value]
    """Parameter -> a number, or a range that specimens are drawn from; one number a channel where it has its own."""

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> DrawnEffect:
        """Build it from an entry of a plan; parameters that are left out keep their default.

        Raises:
            UsageError: If no such effect is known.
            FormatError: If it means nothing for simulated presses, or a number is none of its own.
        """
        effect = load(document["effect"])
        _refuse_meaningless(effect, origin)
        parameters = {parameter.name: parameter for parameter in effect.parameters}
        if unknown := sorted(set(document["values"]) - set(parameters)):
            raise FormatError(
                f"{origin}: {effect.name} with {', '.join(unknown)}",
                f"parameters: {', '.join(parameters)}",
                "correct values; `tacdata list effects` shows them",
            )
        values = {name: _value(parameters[name], value, origin, effect) for name, value in document["values"].items()}
        return cls(effect, values)

    def placed(self, rng: np.random.Generator, channels: int) -> Placed:
        """Return the effect of one specimen.

        Raises:
            FormatError: If it has numbers for another count of channels.
        """
        sizes = {}
        for parameter in self.effect.parameters:
            value = np.asarray(self.values.get(parameter.name, parameter.default), dtype=float)
            # Two numbers of a parameter that each channel has of its own are a range, unless there are two channels.
            if value.ndim and (not parameter.per_channel or (len(value) == 2 and channels != 2)):
                value = rng.uniform(*value, size=(channels,) if parameter.per_channel else ())
            if value.ndim and len(value) != channels:
                raise FormatError(
                    f"effect {self.effect.name}: {parameter.name} for {len(value)} channels",
                    f"one number, or one for each of {channels} channels",
                    "correct the effect's values",
                )
            sizes[parameter.name] = np.broadcast_to(value, (channels,)) if parameter.per_channel else value
        return Placed(self.effect, sizes)


def effects_of(path: Path) -> list[dict[str, Any]]:
    """Return the effects that a verdict names, or that a model spec holds, as entries of a simulation plan.

    A number with a 90 % interval becomes this interval, within bounds.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is neither, or names no effect.
    """
    kind = documents.content_of(path, "verdict")
    if isinstance(kind, dict) and "response" in kind:
        spec = documents.read(path, "model_spec")
        return [{"effect": entry["effect"], "values": entry["values"]} for entry in spec["effects"]]
    verdict = documents.read(path, "verdict")
    named = [entry for entry in verdict["effects"] if entry["status"] == "named"]
    if not named:
        raise FormatError(
            f"{path}: a verdict that names no effect ({verdict['status']})",
            "a verdict with a named effect",
            "record what it asks for next, or write the effect into the plan",
        )
    return [{"effect": entry["effect"], "values": _from_verdict(entry)} for entry in named]


def drawn_effects(plan: SimulationPlan) -> tuple[DrawnEffect, ...]:
    """Return the effects of a plan.

    Raises:
        UsageError: If one is not known, or given twice.
        FormatError: If one means nothing for simulated presses, or a number is none of its own.
    """
    origin, entries = f"plan {plan.name}", plan.document.get("effects", [])
    names = [entry["effect"] for entry in entries]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise UsageError(
            f"{origin}: effect {twice[0]} given twice",
            "each effect once",
            "give it in the plan or by --effects, not in both",
        )
    return tuple(DrawnEffect.from_document(entry, origin) for entry in entries)


def with_effects(plan: SimulationPlan, entries: list[dict[str, Any]]) -> SimulationPlan:
    """Return a plan with further effects."""
    return replace(plan, document={**plan.document, "effects": [*plan.document.get("effects", []), *entries]})


def readings_with(
    effects: tuple[Placed, ...], episode: Episode, label: Label, specimen: Sensor, ideal: np.ndarray
) -> np.ndarray:
    """Return the readings of a press with effects [counts], shape (n, taxels).

    Args:
        effects: Of its specimen.
        episode: The press.
        label: Its label; stays as it is.
        specimen: Whose board reads.
        ideal: Readings without effects [counts], shape (n, taxels).
    """
    if not effects:
        return ideal
    return predict(_course(episode, label), SolvedPressResponse(label, specimen), effects).signal


def specimen_effects(plan: SimulationPlan, sensor: Sensor, seed: int, specimen: int) -> tuple[Placed, ...]:
    """Return the effects of a specimen, drawn from the seed and its number alone.

    Raises:
        UsageError: As of `drawn_effects`.
        FormatError: Likewise; and if one changes forces, and the board reads more than forces.
    """
    rng = np.random.default_rng([seed, _STREAM, specimen])
    placed = tuple(effect.placed(rng, sensor.taxels.count) for effect in drawn_effects(plan))
    on_loads = [one.effect.name for one in placed if one.stage in _ON_LOADS]
    if on_loads and sensor.transduction and _reads_more_than_force(Transducer.of(sensor)):
        raise FormatError(
            f"effect {on_loads[0]} on a {sensor.transduction.principle}, which reads more of the skin than force",
            "a transduction that reads forces alone: the effect says what becomes of forces",
            "leave the effect out, or describe another transduction",
        )
    return placed


class SolvedPressResponse(Response):
    """The loads of one solved press: those of its own frames, and by depth alone while loading for others."""

    def __init__(self, label: Label, specimen: Sensor) -> None:
        """Keep the press's loads."""
        self._transducer, self._label = Transducer.of(specimen), label
        self._force = np.asarray(label.force[:, 2], dtype=float)
        self._load = np.asarray(label.taxel_force, dtype=float)
        depth = label.tip[:, 2]
        rising = slice(0, int(depth.argmax()) + 1)
        self._depth, first = np.unique(np.maximum(depth[rising], 0.0), return_index=True)
        self._by_depth = np.column_stack([self._load, self._force])[rising][first]

    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the load on each channel [N], shape (n, channels); 0 without contact."""
        return self._load if self._is_own(pose) else self._at(pose)[:, :-1]

    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the normal force [N], shape (n,)."""
        return self._force if self._is_own(pose) else self._at(pose)[:, -1]

    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return the readings of loads [counts], shape (n, channels)."""
        closure, area = np.zeros_like(load), np.zeros_like(load)
        # The idle readings are asked for with loads of 0, which have neither closure nor area.
        if len(load) == len(self._load) and load.any():
            closure, area = (np.asarray(v, float) for v in (self._label.taxel_closure, self._label.taxel_area))
        return self._transducer.read(Loads(load, closure, area)).counts

    def _is_own(self, pose: np.ndarray) -> bool:
        return np.array_equal(pose, self._label.tip)

    def _at(self, pose: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(pose[:, 2], self._depth, column) for column in self._by_depth.T])


def _course(episode: Episode, label: Label) -> Course:
    frames, press = len(label.time_ns), episode.press
    none = np.zeros(1, dtype=np.int64)
    return Course(
        time=(label.time_ns - label.time_ns[0]) / 1e9,
        episode=np.zeros(frames, dtype=np.int64),
        tip=label.tip,
        tool=np.zeros(frames, dtype=np.int64),
        readings=np.zeros(label.taxel_force.shape),
        averaged=np.ones(frames),
        session=none,
        site=none,
        tools=(Tool(press.indenter_name, press.indenter.shape, float("nan")),),
        names=(str(episode.number),),
        centers=episode.sensor.taxels.centers,
        force=np.asarray(label.force[:, 2], float),
    )


def _refuse_meaningless(effect: Effect, origin: str) -> None:
    reason = remedy = ""
    if "signal" not in effect.moves:
        reason, remedy = "it changes no reading of a taxel", "leave it out"
    elif "label" in effect.moves:
        reason = "a simulated skin is pressed where its label says, and has its specimen's shape"
        remedy = "leave it out; what the skin is like is said by the sensor file"
    elif effect.grows_with or effect.follows_clock:
        reason, remedy = "it grows over many presses, and each simulated press stands alone", "give noise/drift instead"
    elif effect.group == "temperature":
        reason, remedy = "simulated presses have no temperature", "leave it out"
    if reason:
        raise FormatError(
            f"{origin}: effect {effect.name} ({effect.title}): {reason}",
            "effects on forces and readings within a press: relaxation, hysteresis, delays, crosstalk",
            remedy,
        )


def _value(parameter: Parameter, size: float | list[float], origin: str, effect: Effect) -> Value:
    numbers = np.atleast_1d(np.asarray(size, dtype=float))
    where = f"{origin}: effect {effect.name}: {parameter.name}"
    if not (np.isfinite(numbers).all() and (parameter.low <= numbers).all() and (numbers <= parameter.high).all()):
        raise FormatError(
            f"{where} = {size}", f"{parameter.low:g} to {parameter.high:g} {parameter.unit}", "correct it"
        )
    if np.ndim(size) == 0:
        return float(numbers[0])
    if not parameter.per_channel and (len(numbers) != 2 or numbers[0] > numbers[1]):
        raise FormatError(f"{where} = {size}", "a number, or [lowest, highest]", "correct it")
    return tuple(numbers.tolist())


def _from_verdict(entry: dict[str, Any]) -> dict[str, Any]:
    parameters = {parameter.name: parameter for parameter in load(entry["effect"]).parameters}
    values: dict[str, Any] = {}
    for name, estimate in entry["parameters"].items():
        parameter = parameters[name]
        values[name] = estimate["value"]
        if "interval" in estimate and not parameter.per_channel:
            values[name] = np.clip(estimate["interval"], parameter.low, parameter.high).tolist()
    return values


def _reads_more_than_force(transducer: Transducer) -> bool:
    light = np.full((1, transducer.taxels), 0.05)  # N, mm and mm^2 at once: a light touch
    slopes = transducer.derivatives(Loads(light, light, light))
    return bool(np.any(slopes.closure) or np.any(slopes.area))
