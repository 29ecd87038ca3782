"""Files of a lab: CSV files, and a mapping of their columns."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml


@dataclass(frozen=True)
class Files:
    """The folder of one data set."""

    folder: Path
    name: str

    def table(self, file, columns, separator=",", decimal="."):
        """Write columns to a file below raw/: name -> (values of shape (rows,), how a number is written)."""
        target = self.folder / "raw" / file
        target.parent.mkdir(parents=True, exist_ok=True)
        values, forms = zip(*columns.values(), strict=True)
        lines = [separator.join(columns)]
        for row in zip(*values, strict=True):
            text = separator.join(form % value for form, value in zip(forms, row, strict=True))
            lines.append(text.replace(".", decimal))
        target.write_text("\n".join(lines) + "\n")

    def mapping(self, unit, taxels, parts, columns="ch*", name=None, to="mapping.yaml"):
        """Write a mapping.

        Args:
            unit: Of readings.
            taxels: Which of its files holds them.
            parts: files, position and whatever else this lab has.
            columns: Of readings.
            name: Of the sensor; the data set's, if left out.
            to: Name of the mapping.
        """
        name = name or self.name
        document = {
            "version": "1.1",
            "name": name,
            "source": "made up",
            "sensor": {"name": name},
            "taxels": {"file": taxels, "columns": columns, "unit": unit},
            "indenter": {"shape": "sphere", "radius": 4.0},
            **parts,
        }
        (self.folder / to).write_text(yaml.safe_dump(document, sort_keys=False))


def stamps(rng, seconds, rate, jitter, lost=0.0):
    """Return when rows come [s], shape (rows,): at a rate [Hz], steps that jitter and a share that is lost [1]."""
    steps = (1 + jitter * rng.standard_normal(int(seconds * rate) + 2)) / rate
    at = np.cumsum(np.maximum(steps, 0.2 / rate))
    at = at[at < seconds]
    return at[rng.random(len(at)) >= lost]


def encoder(rng, depths):
    """Return depths as an encoder reads them [mm]: noise of 0.5 um, steps of 1 um."""
    return np.round((depths + 0.0005 * rng.standard_normal(len(depths))) / 0.001) * 0.001


def channels(said, form="%.4f", name="ch"):
    """Return columns of readings of shape (rows, channels)."""
    return {f"{name}{i}": (values, form) for i, values in enumerate(said.T)}
