"""From a verdict to a folder: the new model, the gap, the labels, the evidence card, the next plan."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.discrepancy.data.recordings import course_of
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.run import VERDICT, recording_hash
from tacdata.effects import Placed
from tacdata.errors import UsageError
from tacdata.label_farm.labelling import FarmSettings
from tacdata.recording.session import FILE
from tacdata.revision.additions import Addition, additions, of_verdict, placed_of, suspects
from tacdata.revision.comparison import Comparison
from tacdata.revision.corrected import write_corrected
from tacdata.revision.episodes import Sealed, sealed
from tacdata.revision.evidence import table
from tacdata.revision.evidence.card import card
from tacdata.revision.evidence.curves import EpisodeCurves, curves
from tacdata.revision.evidence.gap import GapReduction, ResidualChange, gap, noise_of
from tacdata.revision.evidence.picture import draw
from tacdata.revision.evidence.worst_slice import sealed_slices
from tacdata.revision.labels.confirm import Confirmed, confirm, touches_fem
from tacdata.revision.labels.realised import TipError, tip_error
from tacdata.revision.labels.relabel import Moved, moves_labels, paths_moved, relabelled
from tacdata.revision.labels.retrain import Recipe, Retrained, retrained
from tacdata.revision.next_presses.recommend import recommend
from tacdata.skin.mesh.build import MeshSettings
from tacdata.surrogate.pressed import pressed

REVISION, SPEC, CARD, PICTURE, TABLE, CSV, CORRECTED, LABELS = (
    "revision.json",
    "spec.json",
    "card.html",
    "gap.png",
    "gap.md",
    "gap.csv",
    "corrected.csv",
    "labels",
)
"""Names of the folder's files."""

KIND = "recording "
"""Prefix of a verdict's recordings among its parents."""
NETWORKS = "networks"
"""Folder of the datasets and networks of both models."""
Note = Callable[[str], None]


@dataclass(frozen=True)
class RevisionOptions:
    """Steps besides the card."""

    relabel: FarmSettings | None = None
    """How to make labels again; None to report only how far the tip moves."""
    store: Path | None = None
    """Store of solved paths; by default each session's own."""
    confirm: int = 0
    """Presses to solve by finite elements where the revision moves the loads most."""
    suspected: bool = False
    """Whether effects that are not named are added, too."""
    corrected: bool = False
    """Whether to write the recordings as corrected by the effects."""
    presses: int = 4
    """Different presses of the next plan."""
    retrain: Recipe | None = None
    """How to train networks before and after; None for no training."""
    truth: Path | None = None
    """File of the tip's true path (`tacdata.revision.labels.realised.COLUMNS`); otherwise a tag or gauge is used."""


@dataclass(frozen=True)
class Revised:
    """Result of a revision."""

    document: dict[str, Any]
    """`schemas/revision.schema.json`."""
    folder: Path
    shown: tuple[EpisodeCurves, ...] = ()
    """The sealed episodes in which the effects change most."""


def revise(
    judged: Path,
    recordings: list[Path],
    spec: Spec,
    out: Path,
    wishes: RevisionOptions | None = None,
    note: Note = lambda text: None,
) -> Revised:
    """Do everything that follows a verdict.

    Args:
        judged: Folder that `tacdata discrepancy` wrote.
        recordings: The recordings of the verdict.
        spec: The model spec of the verdict.
        out: Folder to create.
        wishes: Steps besides the card.
        note: Called with a line of progress.

    Raises:
        UsageError: If ``out`` exists, or the verdict was reached from other recordings or another model.
        FormatError: If the file is no verdict.
    """
    asked = wishes or RevisionOptions()
    if out.exists():
        raise UsageError(f"{out} exists", "a new folder; nothing is overwritten", "choose another --out")
    verdict = documents.read(judged / VERDICT, "verdict")
    _same(verdict, spec, judged, recordings)
    status, moving = verdict["status"], moves_labels(placed_of(additions(verdict)))
    if asked.retrain is not None and asked.relabel is None and moving:
        raise UsageError(
            "--retrain without --relabel: the effect moves labels, and a network needs the new ones",
            "both",
            "add --relabel",
        )
    note("reading")
    added = of_verdict(verdict) if asked.suspected else additions(verdict)
    answer = placed_of(added or of_verdict(verdict))
    held = Comparison(course_of(recordings), spec, tuple(answer))
    out.mkdir(parents=True)
    note("gap, with the parameters fitted without the sealed episodes")
    # The gap uses parameters fitted without the sealed episodes; the model that is written has the verdict's own.
    chosen = sealed(held.course, verdict)
    change = gap(held, answer, chosen, noise_of(verdict, held), note) if answer else None
    slices = sealed_slices(held, change, chosen.numbers) if change else []
    after = _added(verdict, judged, spec, added, out) if added else None
    corrected = write_corrected(held, held.after(answer), out / CORRECTED) if asked.corrected and added else None
    parents = {"verdict": provenance.content_hash(verdict), "spec": spec.content_hash}
    document = {
        "version": schemas.version("revision"),
        "verdict": parents["verdict"],
        "status": status,
        "added": [a.placed.effect.name for a in added],
        "suspected": [] if asked.suspected else [a.placed.effect.name for a in suspects(verdict)],
        "remarks": [a.remark for a in added if a.remark],
        "spec": {"before": spec.content_hash, "after": after},
        "gap": _gap(change, slices),
        "labels": [],
        "tips": [],
        "retrained": None,
        "confirmed": [],
        "corrected": None if corrected is None else {"file": CORRECTED, **corrected},
        "next": {"plan": None, "presses": [], "remark": ""},
        "provenance": provenance.stamp("tacdata revise", parents, {"confirm": asked.confirm}),
    }
    shown = _pictures(document, verdict, held, answer, change, chosen, out, note)
    _write(document, verdict, out)
    if added:
        document |= _about_labels(recordings, held, answer, out, asked, note)
    document["tips"] = [{"session": s, **asdict(t)} for s, t in _tips(recordings, answer, asked, note)]
    _write(document, verdict, out)
    document["next"] = recommend(recordings, held, verdict, out, asked.presses, note)
    if document["retrained"]:  # the picture shows the networks, too
        shown = _pictures(document, verdict, held, answer, change, chosen, out, note)
    _write(document, verdict, out)
    return Revised(document, out, shown)


def _about_labels(
    recordings: list[Path], held: Comparison, answer: list[Placed], out: Path, asked: RevisionOptions, note: Note
) -> dict[str, Any]:
    """Return the effects' influence on labels and networks, and their comparison with finite elements."""
    moved = _labels(recordings, answer, out, asked, note)
    confirmed = _confirmed(recordings, held, answer, asked, note)
    trained = _retrained(recordings, held, answer, out, asked, note)
    return {
        "labels": [
            {"session": s, **_finite(asdict(m)), "failed": {str(k): v for k, v in m.failed.items()}} for s, m in moved
        ],
        "retrained": None if trained is None else {**asdict(trained), "metrics": list(trained.metrics)},
        "confirmed": [{**_finite(asdict(c)), "place": list(c.place)} for c in confirmed],
    }


def _same(verdict: dict[str, Any], spec: Spec, judged: Path, recordings: list[Path]) -> None:
    parents = verdict["provenance"].get("parents", {})
    told = {name.removeprefix(KIND): digest for name, digest in parents.items() if name.startswith(KIND)}
    given = {recording_hash(path): path for path in recordings if path.exists()}
    if told and set(told.values()) != set(given):
        other = [str(path) for digest, path in given.items() if digest not in told.values()]
        raise UsageError(
            f"{judged} was reached from other recordings than {', '.join(other or map(str, recordings))}",
            f"those that it was reached from, unchanged: {', '.join(told)}",
            "name them, or run `tacdata discrepancy` with the ones that there are",
        )
    known = verdict["provenance"].get("parents", {}).get("spec")
    major, minor = schemas.version("model_spec").split(".")
    versions = [f"{major}.{k}" for k in range(int(minor) + 1)]
    same = {provenance.content_hash({**spec.document, "version": version}) for version in versions}
    if known is not None and known not in same | {spec.content_hash}:
        raise UsageError(
            f"{judged} was reached from another model ({known[:12]}… instead of {spec.content_hash[:12]}…)",
            "the model spec that `tacdata discrepancy` was given",
            "name it with --spec, or leave --spec out as then",
        )


def _sessions(recordings: list[Path]) -> list[Path]:
    return [p for p in recordings if (p / FILE).is_file()]


def _labels(
    recordings: list[Path], answer: list[Placed], out: Path, asked: RevisionOptions, note: Note
) -> list[tuple[str, Moved]]:
    if not moves_labels(answer):
        return []
    found = []
    for session in _sessions(recordings):
        note(f"labels of {session.name}")
        if asked.relabel is None:
            found.append((session.name, paths_moved(session, answer)))
        else:
            folder = out / LABELS / session.name
            told = relabelled(session, answer, folder, asked.relabel, asked.store, _told(note, session.name))
            found.append((session.name, told))
    return found


def _tips(
    recordings: list[Path], answer: list[Placed], asked: RevisionOptions, note: Note
) -> list[tuple[str, TipError]]:
    if not answer or not any(p.stage == "kinematics" for p in answer):
        return []
    note("where the tip truly was")
    told = [(session.name, tip_error(session, answer, asked.truth)) for session in _sessions(recordings)]
    return [(name, error) for name, error in told if error is not None]


def _retrained(
    recordings: list[Path], held: Comparison, answer: list[Placed], out: Path, asked: RevisionOptions, note: Note
) -> Retrained | None:
    if asked.retrain is None:
        return None
    sessions = _sessions(recordings)
    labels = {s: out / LABELS / s.name for s in sessions} if moves_labels(answer) else {}
    return retrained(sessions, labels, held, answer, out / NETWORKS, asked.retrain, lambda t: note(f"networks, {t}"))


def _told(note: Note, name: str) -> Callable[[str, int, int], None]:
    return lambda stage, done, of: note(f"labels of {name}: {stage} {done} of {of}")


def _confirmed(
    recordings: list[Path], held: Comparison, answer: list[Placed], asked: RevisionOptions, note: Note
) -> list[Confirmed]:
    given = held.spec.document["response"]
    if asked.confirm < 1 or given["kind"] != "table" or not touches_fem(answer):
        return []
    note("finite elements, where the revision moves the loads most")
    mesh = _mesh(held.spec.folder / given["file"])
    what = pressed(recordings)

    def progress(done: int, of: int, left: float) -> None:
        note(f"finite elements: {done} of {of}, about {left:.0f} s left")

    return confirm(held, answer, what.sensor, what.reaches, asked.confirm, mesh, progress)


def _mesh(path: Path) -> MeshSettings:
    """Return the mesh of a table; the default one if it is not stated."""
    import numpy as np

    with np.load(path, allow_pickle=False) as data:
        told = json.loads(str(data["provenance"])) if "provenance" in data else {}
    values: dict[str, Any] = told.get("parameters", {}).get("mesh") or {}
    if values:
        values["focus"] = tuple(values["focus"]) if values["focus"] else None
    return MeshSettings(**values)


def _added(verdict: dict[str, Any], judged: Path, spec: Spec, added: list[Addition], out: Path) -> str:
    """Write the new version of the model, with its evidence; return its hash."""
    errors = [
        {name: float(p["error"]) for name, p in a.entry["parameters"].items() if p["error"] is not None} for a in added
    ]
    names = [n for n in verdict["provenance"].get("parents", {}) if n != "spec"]
    evidence = f"{judged.name}/{VERDICT} sha256 {provenance.content_hash(verdict)}, from {', '.join(names)}"
    document = spec.with_effects(placed_of(added), errors, evidence)
    given = document["response"]
    if "file" in given:
        import os

        document = {**document, "response": {**given, "file": os.path.relpath(spec.folder / given["file"], out)}}
    documents.write(out / SPEC, document, "model_spec")
    return provenance.content_hash(document)


def _gap(change: GapReduction | None, slices: list[ResidualChange]) -> dict[str, Any] | None:
    if change is None:
        return None
    changes = {"sealed": change.total, "worst": change.worst}
    return {
        "unseen": change.unseen,
        "predicted": change.predicted,
        **{n: asdict(c) for n, c in changes.items()},
        "closed": _or_none(change.total.closed),
        "interval": [_or_none(v) for v in change.interval],
        "floor": 1.0,
        "elsewhere": [asdict(c) for c in change.elsewhere],
        "slices": [asdict(c) for c in slices],
    }


def _or_none(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {k: _or_none(v) if isinstance(v, float) else v for k, v in values.items()}


def _pictures(
    document: dict[str, Any],
    verdict: dict[str, Any],
    held: Comparison,
    answer: list[Placed],
    change: GapReduction | None,
    chosen: Sealed,
    out: Path,
    note: Note,
) -> tuple[EpisodeCurves, ...]:
    if change is None:
        return ()
    note("picture, table")
    shown = curves(held, change, chosen.numbers)
    names = " and ".join(p.effect.title.lower() for p in answer)
    networks = (document["retrained"] or {}).get("metrics", ())
    draw(f"{verdict['status']}: {names}", shown, change, out / PICTURE, networks)
    return tuple(shown)


def _write(document: dict[str, Any], verdict: dict[str, Any], out: Path) -> None:
    """Write the document, the tables and the card."""
    documents.write(out / REVISION, document, "revision")
    if document["gap"]:
        documents.write_text(out / TABLE, table.markdown(document))
        documents.write_text(out / CSV, table.as_csv(document))
    picture = out / PICTURE
    documents.write_text(out / CARD, card(document, verdict, picture if picture.is_file() else None))
