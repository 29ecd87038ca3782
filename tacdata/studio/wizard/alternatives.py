"""The answers to an open question, each as a change of the choices."""

from dataclasses import dataclass
from typing import Any

from tacdata.importing.mapping import Mapping
from tacdata.importing.proposing.question import Question
from tacdata.studio.wizard.choices import UNITS


@dataclass(frozen=True)
class Alternative:
    """One answer."""

    label: str
    change: dict[str, Any]
    """Choice -> its value; with ``column``, values of that column's assignment."""
    ask: str = ""
    """Choice whose number is typed, and its unit; empty: nothing is typed."""


def alternatives(question: Question, mapping: Mapping) -> tuple[Alternative, ...]:
    """Return the answers to a question; () where it is answered by a role or in the mapping's file."""
    file = question.file or (mapping.position.file if mapping.position else "")

    def of_columns(key: str, values: dict[str, Any]) -> tuple[Alternative, ...]:
        columns = [[file, name] for name in question.columns]
        return tuple(Alternative(label, {"columns": columns, key: value}) for label, value in values.items())

    rule = mapping.trials
    cut = {"gap": rule.gap, "press_above": rule.press_above}
    answers = {
        "sign": lambda: of_columns("scale", {"turn the sign": -1.0, "leave the sign": 1.0}),
        "unit": lambda: of_columns("unit", {unit: unit for unit in ("mm", "um", "m", "cm", "in")}),
        "clock": lambda: of_columns("unit", {unit: unit for unit in UNITS["time"]}),
        "zero": lambda: (
            Alternative("count from there", {"offset": question.value}),
            Alternative("zero is the skin", {"offset": 0.0}),
            Alternative("the lowest of each trial", {"offset": 0.0, "zero": "lowest"}),
        ),
        "contact": lambda: (
            Alternative("highest of each trial", {"contact": None}),
            Alternative("the machine's zero", {"contact": 0.0}),
            Alternative("at the height", {}, "contact [mm]"),
        ),
        "trials": lambda: (
            Alternative("cut there", {"trials": {key: value for key, value in cut.items() if value is not None}}),
            Alternative("one recording a file", {"trials": {}}),
        ),
        "rate": lambda: tuple(
            Alternative(f"{rate:g} Hz", {"rates": {question.file: rate}})
            for rate in dict.fromkeys((question.value, 10.0, 50.0, 100.0, 1000.0))
        ),
        "date": lambda: tuple(
            Alternative(label, {"formats": {question.file: layout}})
            for label, layout in (("month first", question.word), ("day first", _day_first(question.word)))
        ),
        "specimen": lambda: (
            Alternative("they are specimens", {"specimen": question.word}),
            Alternative("they are not", {"specimen": ""}),
        ),
    }
    return answers[question.topic]() if question.topic in answers else ()


def _day_first(layout: str) -> str:
    """Return a layout of dates with day and month in each other's place."""
    return layout.replace("%m", "%_").replace("%d", "%m").replace("%_", "%d")
