"""EEPROM settings of the emulated firmware, and the wording of its answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tacdata.virtual_rig.firmware.dialect import Firmware

DEFAULTS = {
    "$0": "10",
    "$1": "255",
    "$2": "0",
    "$3": "0",
    "$4": "0",
    "$5": "0",
    "$6": "0",
    "$10": "1",
    "$11": "0.010",
    "$12": "0.002",
    "$13": "0",
    "$20": "1",
    "$21": "0",
    "$22": "1",
    "$23": "0",
    "$24": "25.000",
    "$25": "500.000",
    "$26": "250",
    "$27": "1.000",
    "$30": "1000",
    "$31": "0",
    "$32": "0",
    "$100": "400.000",
    "$101": "400.000",
    "$102": "400.000",
    "$110": "1800.000",
    "$111": "1800.000",
    "$112": "900.000",
    "$120": "200.000",
    "$121": "200.000",
    "$122": "150.000",
    "$130": "200.000",
    "$131": "200.000",
    "$132": "60.000",
}
"""Settings of a small three-axis stage: mm, mm/min, mm/s^2, steps/mm."""
LOCKED = "[MSG:'$H'|'$X' to unlock]"
WCO_PERIOD, OV_PERIOD = {True: 30, False: 10}, {True: 20, False: 10}
"""Number of reports between two with WCO (or Ov), busy or not (Grbl's `config.h`)."""


def axis_setting(settings: Mapping[str, str], prefix: str) -> np.ndarray:
    """Return ``prefix0`` to ``prefix2``, shape (3,), for example the maximum rates for ``$11``."""
    return np.array([float(settings[f"{prefix}{axis}"]) for axis in range(3)])


def triple(values: np.ndarray, digits: int = 3) -> str:
    """Return three numbers as GRBL writes them."""
    return ",".join(f"{value + 0.0:.{digits}f}" for value in values)


def information(
    command: str,
    firmware: Firmware,
    settings: Mapping[str, str],
    offset: np.ndarray,
    startup: list[str],
    shift: np.ndarray | None = None,
    length: float = 0.0,
) -> list[str] | None:
    """Return the answer to a ``$`` command that asks for information; None for other commands.

    ``offset`` [mm], shape (3,), is the G54; ``shift`` [mm], shape (3,), the G92; ``length`` [mm] the tool's.
    """
    inches = settings["$13"] == "1"
    unit, digits = (25.4, 4) if inches else (1.0, 3)
    zero = triple(np.zeros(3), digits)
    offsets = {54: offset, 92: np.zeros(3) if shift is None else shift}
    tags = [f"[G{n}:{triple(offsets.get(n, np.zeros(3)) / unit, digits)}]" for n in (*range(54, 60), 28, 30, 92)]
    return {
        "$$": [f"{name}={value}" for name, value in settings.items()],
        "$#": [*tags, f"[TLO:{length / unit:.{digits}f}]", f"[PRB:{zero}:0]"],
        "$I": list(firmware.information),
        "$N": [f"$N{n}={line}" for n, line in enumerate(startup)],
        "$": ["[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]"],
    }.get(command)


@dataclass
class Counters:
    """When the fields that are not in every report are due again [reports]."""

    wco: int = 0
    overrides: int = 0
    offset: tuple[float, ...] = ()
    """The latest offset: a changed one is due at once."""


def report(
    settings: Mapping[str, str],
    bits: Mapping[str, int],
    state: str,
    machine: np.ndarray,
    speed: float,
    offset: np.ndarray,
    capacity: tuple[int, int],
    counters: Counters,
    override: int,
    pins: str,
    homed: bool | None = None,
) -> str:
    """Return a status report (Grbl's `report_realtime_status`).

    Args:
        settings: ``$10`` and ``$13`` select fields and unit.
        bits: The firmware's ``report_bits``.
        state: State with substate.
        machine: Machine position by the controller's count [mm], shape (3,).
        speed: Present speed [mm/s].
        offset: Work coordinate offset with G92 and the tool's length [mm], shape (3,).
        capacity: Free planner blocks and bytes of the receive buffer.
        counters: Updated.
        override: Feed override [%].
        pins: Letters of the active inputs.
        homed: Whether it was homed; None if the report does not state it.
    """
    mask, inches = int(settings["$10"]), settings["$13"] == "1"
    unit, digits = (25.4, 4) if inches else (1.0, 3)
    steps = axis_setting(settings, "$10")
    position = np.round(machine * steps) / steps - (0 if mask & 1 else offset)
    fields = [state, f"{'MPos' if mask & 1 else 'WPos'}:{triple(position / unit, digits)}"]
    contents = {name for name in ("Bf", "FS", "Pn", "WCO", "Ov") if name not in bits or mask & bits[name]}
    if "Bf" in contents:
        fields.append(f"Bf:{capacity[0]},{capacity[1]}")
    if "FS" in contents:
        fields.append(f"FS:{60 * speed / unit:.{digits - 3}f},0")
    if pins and "Pn" in contents:
        fields.append(f"Pn:{pins}")
    if counters.offset != tuple(offset):
        counters.wco, counters.offset = 0, tuple(offset)
    busy = state.split(":")[0] in ("Run", "Hold", "Jog", "Door", "Home")
    if counters.wco == 0:
        counters.wco, counters.overrides = WCO_PERIOD[busy], max(counters.overrides, 1)
        fields += [f"WCO:{triple(offset / unit, digits)}"] if "WCO" in contents else []
    elif counters.overrides == 0:
        counters.overrides = OV_PERIOD[busy]
        fields += [f"Ov:{override},100,100"] if "Ov" in contents else []
    fields += [] if homed is None else [f"H:{int(homed)}"]
    counters.wco -= 1
    counters.overrides -= counters.overrides > 0
    return f"<{'|'.join(fields)}>"
