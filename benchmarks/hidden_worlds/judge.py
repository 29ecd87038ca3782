"""Judge one world: python judge.py FOLDER. It holds recordings.npz, task.json and table.npz.

Runs as a process of its own in that folder; opening the truth, or the code that made it, ends it.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

FORBIDDEN = ("truth", "worlds")
"""Folders that a judge may not look into."""


def guard(event, given):
    """Refuse to open files for the scorer alone."""
    if event == "open" and isinstance(given[0], str | bytes):
        parts = Path(given[0].decode() if isinstance(given[0], bytes) else given[0]).parts
        if any(name in parts for name in FORBIDDEN):
            raise PermissionError(f"a judge may not open {given[0]}")


def course_of(data):
    """Return recordings as the workflow takes them."""
    from tacdata.chain import Course, Tool
    from tacdata.chain.rows import rows_of

    extra = [data[name].reshape(len(data["time"]), -1) for name in ("force", "tag", "temperature") if name in data]
    channels, parts = data["readings"].shape[1], []
    for e in range(int(data["episode"].max()) + 1):
        rows, way = data["episode"] == e, data["path_episode"] == e
        values = np.column_stack([data["readings"][rows].astype(float), *(x[rows] for x in extra)])
        parts.append(rows_of(data["time"][rows], values, data["path_time"][way], data["path"][way], channels))
    values = np.concatenate([p.values for p in parts])
    episode, at, streams = np.repeat(np.arange(len(parts)), [len(p.time) for p in parts]), channels, {}
    for name, width in (("force", 1), ("tag", 3), ("temperature", 1)):
        if name in data:
            streams[name], at = values[:, at : at + width] if width > 1 else values[:, at], at + width
    if "temperature" in streams:
        good = np.flatnonzero(np.isfinite(streams["temperature"]))
        streams["temperature"] = np.interp(np.arange(len(values)), good, streams["temperature"][good])
    return Course(
        time=np.concatenate([p.time for p in parts]),
        episode=episode,
        tip=np.concatenate([p.tip for p in parts]),
        tool=data["tool"].astype(int)[episode],
        readings=values[:, :channels],
        averaged=np.concatenate([p.averaged for p in parts]),
        session=data["session"].astype(int),
        site=data["site"].astype(int),
        tools=tuple(Tool(f"sphere_{r:g}", "sphere", float(r)) for r in data["radii"]),
        names=tuple(f"episode {k}" for k in range(len(parts))),
        centers=data["centers"],
        **streams,
    )


def setting_of(folder, course, without=()):
    """Return the setting that the engine is to judge.

    Args:
        folder: The world's.
        course: Its recordings.
        without: Mechanisms that are taken out of the library.
    """
    from tacdata.chain.table_response import TableResponse
    from tacdata.discrepancy.model.fitted_response import FittedResponse
    from tacdata.discrepancy.model.setting import Setting
    from tacdata.effects import library

    if json.loads((folder / "task.json").read_text())["response"] == "fitted":
        response = FittedResponse(course)
    else:
        quiet = course.reduced.tip[:, 2] <= 0
        table = TableResponse.read(folder / "table.npz")
        response = table.idling_at(np.median(course.reduced.readings[quiet], axis=0))
    return Setting(course, response, [e for e in library() if e.called not in without])


def spec_of(folder):
    """Return the model's spec, as a lab would write it."""
    from tacdata import schemas
    from tacdata.discrepancy.model.spec import Spec

    kind = json.loads((folder / "task.json").read_text())["response"]
    response = {"kind": kind} if kind == "fitted" else {"kind": kind, "file": "table.npz"}
    version = schemas.version("model_spec")
    return Spec({"version": version, "name": "nominal", "parent": None, "response": response, "effects": []}, folder)


def answered(folder, without=()):
    """Return the verdict's document, the model's prediction before and after correction, and CPU seconds."""
    from tacdata.chain import predict
    from tacdata.discrepancy.judge import judge

    course = course_of(dict(np.load(folder / "recordings.npz")))
    begin = time.process_time()
    verdict = judge(course, spec_of(folder), without=tuple(without))
    seconds = time.process_time() - begin
    fits = verdict.conclusion.before, verdict.conclusion.after
    before, after = (predict(course, fit.response, list(fit.placed)) for fit in fits)
    rows = course.read
    said = {
        "time": course.time[rows],
        "episode": course.episode[rows],
        "before": before.signal[rows].astype(np.float32),
        "after": after.signal[rows].astype(np.float32),
        "pose": after.pose[rows].astype(np.float32),
        "nominal": before.pose[rows].astype(np.float32),
    }
    return verdict.document, said, seconds


def main(folder, options):
    """Judge and write."""
    sys.addaudithook(guard)
    method = options.pop("method", "workflow")
    if method == "workflow":
        answer, said, seconds = answered(folder, **options)
    else:
        sys.path.insert(0, str(Path(__file__).parent))
        import baselines

        course = course_of(dict(np.load(folder / "recordings.npz")))
        answer, said, seconds = baselines.answered(setting_of(folder, course), method)
    if said:
        np.savez_compressed(folder / "said.npz", **said)
    (folder / "verdict.json").write_text(json.dumps({"verdict": answer, "seconds": seconds}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), json.loads(sys.argv[2]) if len(sys.argv) > 2 else {})
