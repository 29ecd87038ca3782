"""From a verdict to a folder: the new model, the gap, the labels, the evidence card, the next plan."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

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
from tacdata.revision.episodes import sealed
from tacdata.revision.evidence import table
from tacdata.revision.evidence.card import card
from tacdata.revision.evidence.curves import curves
from tacdata.revision.evidence.gap import GapReduction, ResidualChange, gap, noise_of
from tacdata.revision.evidence.worst_slice import sealed_slices
from tacdata.revision.labels.confirm import confirm, touches_fem
from tacdata.revision.labels.realised import tip_error
from tacdata.revision.labels.relabel import Moved, moves_labels, paths_moved, relabelled
from tacdata.revision.labels.retrain import Recipe, retrained
from tacdata.revision.next_presses.recommend import recommend
from tacdata.skin.mesh.build import MeshSettings
from tacdata.surrogate.pressed import pressed
from tacdata.viewers.scene.episode_curves import EpisodeCurves

REVISION, SPEC, CARD, TABLE, CSV = "revision.json", "spec.json", "card.html", "gap.md", "gap.csv"
CORRECTED, LABELS = "corrected.csv", "labels"
"""Names of the folder's files."""

KIND = "recording "
"""Prefix of a verdict's recordings among its parents."""
SHOWN = 8
"""Episodes whose curves the card shows, at most."""
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


@threadpool_limits.wrap(limits=1, user_api="blas")  # as in a verdict (tacdata.discrepancy.judge)
def revise(
    judged: Path,
    recordings: list[Path],
    spec: Spec,
    target: Path,
    wishes: RevisionOptions | None = None,
    note: Note = lambda text: None,
) -> Revised:
    """Do everything that follows a verdict.

    Args:
        judged: Folder that `tacdata discrepancy` wrote.
        recordings: The recordings of the verdict.
        spec: The model spec of the verdict.
        target: Folder to create.
        wishes: Steps besides the card.
        note: Called with a line of progress.

    Raises:
        UsageError: If ``target`` exists, or the verdict was reached from other recordings or another model.
        FormatError: If the file is no verdict.
    """
    options = wishes or RevisionOptions()
    if target.exists():
        raise UsageError(f"{target} exists", "a new folder; nothing is overwritten", "choose another --out")
    verdict = documents.read(judged / VERDICT, "verdict")
    _same(verdict, spec, judged, recordings)
    status, moving = verdict["status"], moves_labels(placed_of(additions(verdict)))
    if options.retrain is not None and options.relabel is None and moving:
        raise UsageError(
            "--retrain without --relabel: the effect moves labels, and a network needs the new ones",
            "both",
            "add --relabel",
        )
    note("reading")
    added = of_verdict(verdict) if options.suspected else additions(verdict)
    # Where nothing is added, the gap is shown for the effects that are only suspected.
    answer = placed_of(added or of_verdict(verdict))
    comparison = Comparison(course_of(recordings), spec, tuple(answer))
    target.mkdir(parents=True)
    note("gap, with the parameters fitted without the sealed episodes")
    # The gap uses parameters fitted without the sealed episodes; the model that is written has the verdict's own.
    seal = sealed(comparison.course, verdict)
    change = gap(comparison, answer, seal, noise_of(verdict, comparison), note) if answer else None
    slices = sealed_slices(comparison, change, seal.numbers) if change else []
    new_hash = _added(verdict, judged, spec, added, target) if added else None
    corrected = None
    if options.corrected and added:
        corrected = {"file": CORRECTED, **write_corrected(comparison, comparison.after(answer), target / CORRECTED)}
    parents = {"verdict": provenance.content_hash(verdict), "spec": spec.content_hash}
    document = {
        "version": schemas.version("revision"),
        "verdict": parents["verdict"],
        "status": status,
        "added": [a.placed.effect.name for a in added],
        "suspected": [] if options.suspected else [a.placed.effect.name for a in suspects(verdict)],
        "remarks": [a.remark for a in added if a.remark],
        "spec": {"before": spec.content_hash, "after": new_hash},
        "gap": _gap(change, slices),
        "labels": [],
        "tips": [],
        "retrained": None,
        "confirmed": [],
        "corrected": corrected,
        "next": {"plan": None, "presses": [], "remark": ""},
        "provenance": provenance.stamp("tacdata revise", parents, {"confirm": options.confirm}),
    }
    note("curves, table")
    shown = tuple(curves(comparison, change, seal.numbers, SHOWN)) if change else ()
    # After every stage, so that an interrupted revision leaves what it has.
    _write(document, verdict, shown, target)
    steps = _Steps(recordings, comparison, answer, target, options, note)
    if added:
        document |= {"labels": steps.labels(), "confirmed": steps.confirmed(), "retrained": steps.retrained()}
    document["tips"] = steps.tips()
    _write(document, verdict, shown, target)
    document["next"] = recommend(recordings, comparison, verdict, target, options.presses, note)
    _write(document, verdict, shown, target)
    return Revised(document, target, shown)


@dataclass(frozen=True)
class _Steps:
    """Steps after the gap, each an entry of the revision's document."""

    recordings: list[Path]
    comparison: Comparison
    answer: list[Placed]
    target: Path
    options: RevisionOptions
    note: Note

    @property
    def sessions(self) -> list[Path]:
        return [p for p in self.recordings if (p / FILE).is_file()]

    def labels(self) -> list[dict[str, Any]]:
        entries = []
        for session in self.sessions if moves_labels(self.answer) else ():
            self.note(f"labels of {session.name}")
            shift = self._shift(session)
            failed = {str(k): reason for k, reason in shift.failed.items()}
            entries.append({"session": session.name, **_finite(asdict(shift)), "failed": failed})
        return entries

    def _shift(self, session: Path) -> Moved:
        settings, store = self.options.relabel, self.options.store
        if settings is None:
            return paths_moved(session, self.answer)

        def progress(stage: str, done: int, of: int) -> None:
            self.note(f"labels of {session.name}: {stage} {done} of {of}")

        return relabelled(session, self.answer, self.target / LABELS / session.name, settings, store, progress)

    def tips(self) -> list[dict[str, Any]]:
        if not any(p.stage == "kinematics" for p in self.answer):
            return []
        self.note("where the tip truly was")
        errors = [(session.name, tip_error(session, self.answer, self.options.truth)) for session in self.sessions]
        return [{"session": name, **asdict(error)} for name, error in errors if error is not None]

    def retrained(self) -> dict[str, Any] | None:
        if self.options.retrain is None:
            return None
        labels = {s: self.target / LABELS / s.name for s in self.sessions} if moves_labels(self.answer) else {}
        model, folder, recipe = (self.comparison, self.answer), self.target / NETWORKS, self.options.retrain
        trained = retrained(self.sessions, labels, *model, folder, recipe, lambda t: self.note(f"networks, {t}"))
        return {**asdict(trained), "metrics": list(trained.metrics)}

    def confirmed(self) -> list[dict[str, Any]]:
        spec, count = self.comparison.spec, self.options.confirm
        response = spec.document["response"]
        if count < 1 or response["kind"] != "table" or not touches_fem(self.answer):
            return []
        self.note("finite elements, where the revision moves the loads most")
        mesh, what = _mesh(spec.folder / response["file"]), pressed(self.recordings)

        def progress(done: int, of: int, remaining: float) -> None:
            self.note(f"finite elements: {done} of {of}, about {remaining:.0f} s left")

        solved = confirm(self.comparison, self.answer, what.sensor, what.reaches, count, mesh, progress)
        return [{**_finite(asdict(press)), "place": list(press.place)} for press in solved]


def _same(verdict: dict[str, Any], spec: Spec, judged: Path, recordings: list[Path]) -> None:
    parents = verdict["provenance"].get("parents", {})
    parent_digests = {name.removeprefix(KIND): digest for name, digest in parents.items() if name.startswith(KIND)}
    # A path that is gone has no content to compare; `course_of` reports it.
    digests = {recording_hash(path): path for path in recordings if path.exists()}
    # By content: recordings may have been moved since.
    if parent_digests and set(parent_digests.values()) != set(digests):
        strangers = [str(path) for digest, path in digests.items() if digest not in parent_digests.values()]
        raise UsageError(
            f"{judged} was reached from other recordings than {', '.join(strangers or map(str, recordings))}",
            f"those that it was reached from, unchanged: {', '.join(parent_digests)}",
            "name them, or run `tacdata discrepancy` with the ones that there are",
        )
    spec_hash = parents.get("spec")
    major, minor = schemas.version("model_spec").split(".")
    # The number of an earlier minor version makes no other model.
    versions = [f"{major}.{k}" for k in range(int(minor) + 1)]
    same = {provenance.content_hash({**spec.document, "version": version}) for version in versions}
    if spec_hash is not None and spec_hash not in same | {spec.content_hash}:
        raise UsageError(
            f"{judged} was reached from another model ({spec_hash[:12]}… instead of {spec.content_hash[:12]}…)",
            "the model spec that `tacdata discrepancy` was given",
            "name it with --spec, or leave --spec out as then",
        )


def _mesh(path: Path) -> MeshSettings:
    """Return the mesh of a table; the default one if it is not stated."""
    with np.load(path, allow_pickle=False) as data:
        stamp = json.loads(str(data["provenance"])) if "provenance" in data else {}
    values: dict[str, Any] = stamp.get("parameters", {}).get("mesh") or {}
    if values:
        values["focus"] = tuple(values["focus"]) if values["focus"] else None
    return MeshSettings(**values)


def _added(verdict: dict[str, Any], judged: Path, spec: Spec, added: list[Addition], target: Path) -> str:
    """Write the new version of the model, with its evidence; return its hash."""
    errors = [
        {name: float(p["error"]) for name, p in a.entry["parameters"].items() if p["error"] is not None} for a in added
    ]
    names = [n for n in verdict["provenance"].get("parents", {}) if n != "spec"]
    evidence = f"{judged.name}/{VERDICT} sha256 {provenance.content_hash(verdict)}, from {', '.join(names)}"
    document = spec.with_effects(placed_of(added), errors, evidence)
    response = document["response"]
    # Relative to the new folder: both can be moved together.
    if "file" in response:
        file = os.path.relpath(spec.folder / response["file"], target)
        document = {**document, "response": {**response, "file": file}}
    documents.write(target / SPEC, document, "model_spec")
    return provenance.content_hash(document)


def _gap(change: GapReduction | None, slices: list[ResidualChange]) -> dict[str, Any] | None:
    if change is None:
        return None
    return {
        "unseen": change.unseen,
        "predicted": change.predicted,
        "sealed": asdict(change.total),
        "worst": asdict(change.worst),
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


def _write(document: dict[str, Any], verdict: dict[str, Any], shown: tuple[EpisodeCurves, ...], target: Path) -> None:
    """Write the document, the tables and the card."""
    documents.write(target / REVISION, document, "revision")
    if document["gap"]:
        documents.write_text(target / TABLE, table.markdown(document))
        documents.write_text(target / CSV, table.as_csv(document))
    documents.write_text(target / CARD, card(document, verdict, shown))
