"""Tries a mapping on the first files of a source, so that a proposal says what it makes of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import TacdataError
from tacdata.importing.pressing.presses import Refusal, centre_of, presses_of
from tacdata.importing.recording_file import ImportedPress
from tacdata.importing.source_files import file_sets
from tacdata.importing.trials import split_tables


def tried(source: Path, mapping: dict[str, Any], beside: Path) -> str:
    """Return what the first files become by a mapping, or why they become nothing, as a sentence.

    Args:
        source: The files.
        mapping: The mapping's document.
        beside: The mapping's folder.
    """
    record = {"trial": "", "name": mapping["name"]}
    try:
        sets = file_sets(source, mapping["files"])
        first = next((files for files in sets if not files.fault), sets[0])
        if first.fault:
            raise first.fault
        tables = first.tables(mapping)
        centre = centre_of(mapping, tables)
        outcomes = [
            press
            for label, rows in split_tables(tables, mapping)
            for press in presses_of(mapping, beside, rows, first.parts, {**record, "trial": label}, centre)
        ]
        presses = [outcome for outcome in outcomes if isinstance(outcome, ImportedPress)]
        if not presses:
            raise next(outcome.error for outcome in outcomes if isinstance(outcome, Refusal))
    except TacdataError as error:
        return f"as it stands, it imports nothing: {error.given}; {error.remedy}"
    depths = sorted(press.press.depth for press in presses)
    rows = [len(press.taxels.time_ns) for press in presses]
    steps = np.concatenate([np.diff(press.taxels.time_ns) for press in presses])
    rate = 1e9 / float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    deep = " to ".join(dict.fromkeys(f"{depth:.3g}" for depth in (depths[0], depths[-1])))
    whole = f"the first of {len(sets)} sets of files holds" if len(sets) > 1 else "the source holds"
    many = f"{min(rows)} to {max(rows)}" if min(rows) < max(rows) else f"{rows[0]}"
    width = presses[0].taxels.values.shape[1]
    return (
        f"tried: {whole} {_counted(len(presses), 'recording')} of {many} rows at {rate:.3g} Hz, "
        f"{_counted(width, 'channel')}, pressed {deep} mm deep"
    )


def _counted(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"
