"""Differences between emulated firmwares: texts, buffers and behaviour."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Firmware:
    """Texts, buffer sizes and behaviour of one firmware."""

    welcome: str
    """First line after power-on and every reset."""
    information: tuple[str, ...]
    """Answer to ``$I``."""
    planner_blocks: int
    """Number of moves in its queue."""
    rx_bytes: int
    """Receive buffer [bytes]."""
    line_bytes: int
    """Longest line without blanks [bytes]; beyond it ``error:11``."""
    dwell_step: float
    """Pauses are rounded up to multiples of this, and ``?`` is only answered between them [s]."""
    alarm_pause: float
    """Time without any input or output after an ALARM line [s]."""
    answers_in_critical_alarm: bool
    """Whether ``?`` is answered after a limit alarm, before the reset."""
    refuses_after_error: bool
    """Whether a refused G-code line makes it refuse all others until an empty or ``$`` line."""
    prepared: float
    """Motion that is cut into steps already; a hold brakes after it [s]."""
    asks_only_at_rest: bool = True
    """Whether ``$#``, ``$I`` and ``$N`` are refused in check mode, and ``$$`` is not."""
    names_length: bool = False
    """Whether ``$G`` lists the tool's length."""
    stop_byte: int = 0
    """Byte that halts motion and empties every queue; 0 for none."""
    report_bits: dict[str, int] = field(default_factory=dict)
    """Fields of a status report that only a bit of ``$10`` brings -> that bit's value; the others always come."""
    answers_questions_in_critical_alarm: bool = False
    """Whether ``$I``, ``$$``, ``$#``, ``$G`` and ``$N`` are answered then; every other line gets ``error:79``."""
    scales: bool = False
    """Whether it knows G51, which scales the coordinates of G53 lines, too."""
    lock: int = 1
    """Bit of ``$22`` that locks it when it is switched on."""
    tells_homing: bool = False
    """Whether a report with all fields states that it was homed."""
    changed: dict[str, str] = field(default_factory=dict)
    """Settings whose defaults differ."""

    @property
    def identity(self) -> str:
        """Name, version and options, as its record of state has them (`schemas/machine_state.schema.json`)."""
        answers = dict(line[1:-1].split(":", 1) for line in self.information)
        return " ".join(answers[tag] for tag in ("FIRMWARE", "VER", "OPT") if tag in answers)


GRBL = Firmware(
    "Grbl 1.1h ['$' for help]",
    ("[VER:1.1h.20190830:virtual]", "[OPT:V,15,128]"),
    planner_blocks=15,
    rx_bytes=128,
    line_bytes=79,
    dwell_step=0.05,
    alarm_pause=0.5,
    answers_in_critical_alarm=False,
    refuses_after_error=False,
    prepared=0.045,
    report_bits={"Bf": 2, "alarm": 0},
)
"""Grbl 1.1h on an ATmega328p (`config.h`, `protocol.c`, `report.c` of that version)."""

GRBLHAL = Firmware(
    "GrblHAL 1.1f ['$' or '$HELP' for help]",
    (
        "[VER:1.1f.20250401:]",
        "[OPT:VNMSL,100,1024,3,0]",
        "[AXS:3:XYZ]",
        "[NEWOPT:ENUMS,RT+,REBOOT]",
        "[FIRMWARE:grblHAL]",
        "[SIGNALS:HSEP]",
        "[NVS STORAGE:*EEPROM 2K]",
        "[DRIVER:virtual]",
        "[PLUGIN:none v0.1]",
        "[PLUGIN:another v0.2]",
    ),
    planner_blocks=100,
    rx_bytes=1024,
    line_bytes=256,
    dwell_step=0.001,
    alarm_pause=0.1,
    answers_in_critical_alarm=True,
    refuses_after_error=True,
    prepared=0.09,
    stop_byte=0x19,
    names_length=True,
    asks_only_at_rest=False,
    scales=True,
    answers_questions_in_critical_alarm=True,
    report_bits={"Bf": 2, "FS": 8, "Pn": 16, "WCO": 32, "Ov": 64, "alarm": 1024},
    lock=4,
    tells_homing=True,
    changed={"$10": "511", "$22": "5", "$481": "0"},
)
"""grblHAL (`report.c`, `protocol.c` of its core)."""

NAMES = {"Grbl": GRBL, "grblHAL": GRBLHAL}
