"""Channels that are an effort of the drive are so called in the mapping, and friction is looked for accordingly."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from tacdata.discrepancy.data.recordings import course_of
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.effects import library
from tacdata.errors import FormatError
from tacdata.importing.imported_session import import_session

MAPPING = {
    "version": "1.6",
    "name": "drive",
    "files": {"log": {"path": "run_{trial}.csv", "time": {"column": "t", "unit": "s"}}},
    "sensor": {"name": "drive"},
    "position": {"file": "log", "depth": {"column": "d", "unit": "mm"}},
}


def session(folder, kind=None):
    """Import three strokes of a drive; its channel is of some kind."""
    folder.mkdir()
    for k in range(3):
        time = np.arange(0, 4, 0.02)
        depth = np.interp(time, [0.5, 1.5, 2.5, 3.5], [0, 20, 20, 0])
        rows = [f"{t:.2f},{d:.3f},{1 + 0.01 * d:.4f}" for t, d in zip(time, depth, strict=True)]
        (folder / f"run_{k}.csv").write_text("\n".join(["t,d,I", *rows]))
    channels = {"file": "log", "columns": ["I"], "unit": "A"} | ({"channels_are": kind} if kind else {})
    (folder / "mapping.yaml").write_text(yaml.safe_dump(MAPPING | {"taxels": channels}))
    return import_session(folder, folder / "mapping.yaml", folder / "session").folder


@pytest.mark.parametrize(
    ("kind", "frictions"),
    [
        (None, {"effort_friction", "seal_friction", "friction_clearance", "dry_friction"}),
        ("effort", {"effort_friction"}),
        ("response", {"seal_friction", "friction_clearance", "dry_friction"}),
    ],
)
def test_friction_takes_the_forms_that_such_channels_can_show(tmp_path, kind, frictions):
    course = course_of(session(tmp_path / "run", kind))
    response = FittedResponse(course)
    judged = {e.name for e in library() if e.called == "dry_friction" and not e.unjudgeable(course, response)}
    assert judged == frictions


def test_recordings_of_two_kinds_are_refused(tmp_path):
    folders = [session(tmp_path / kind, kind) for kind in ("effort", "response")]
    with pytest.raises(FormatError, match="recordings whose channels are: effort, response"):
        course_of(folders)
