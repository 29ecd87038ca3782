"""Visits of a unit of the virtual rig, and labels that predict given readings."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "docs"))

from example_folder import dent
from unit_visits import PLAN, SENSOR, Fault, record, unit, visited

from tacdata.labels import write_label
from tacdata.plans import Plan
from tacdata.recording import read_episode, read_session

SEED = 501
"""Of the unit."""

__all__ = ["PLAN", "SEED", "SENSOR", "Fault", "Plan", "label", "record", "some", "unit", "visited"]


def label(folder, counts=None):
    """Label a session; ``counts`` makes predicted readings of an episode's own, and gives none where it is missing."""
    for path in read_session(folder).episodes:
        episode = read_episode(path)
        made = dent(episode)
        if counts:
            made = replace(made, taxel_counts=counts(episode.taxels.counts).astype(np.float32))
        write_label(folder / "labels" / f"{path.stem}.parquet", made)
    return folder


def some(rows, **changes):
    """Return the health plan with some of its presses, each changed."""
    document = {**PLAN.document, "presses": [{**PLAN.document["presses"][k], **changes} for k in rows]}
    return Plan.from_document(document, "some")
