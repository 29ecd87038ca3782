"""What the verbs made, as entries: datasets, networks, verdicts, revisions, health pages, and others."""

import json
from pathlib import Path

from tacdata import documents
from tacdata.dataset.format.metadata import MAIN
from tacdata.discrepancy.heading import sentence
from tacdata.health.advice import ALL_WELL, FIRST, NOTHING
from tacdata.studio.entry import COMMAND, LabEntry, command, local_minute, pages_in
from tacdata.viewers.kinds.predictions import CHECKPOINT

ERRORS = {"pixel_rmse": "pixel RMSE", "peak_error": "peak error"}
"""Errors of a network that an entry names: key in its scores -> words."""


def dataset_entry(root: Path, folder: Path) -> LabEntry:
    """Return the entry of a dataset."""
    name, info = folder.relative_to(root), json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))
    episodes, frames = int(info["total_episodes"]), int(info["total_frames"])
    ours = (folder / MAIN).is_file()
    commands = (command("browse", name, "--web"), command("train", name, "--out", f"{name}-network"))
    return _entry(
        root,
        folder,
        "Datasets",
        f"{episodes:,} episodes, {frames:,} frames" + ("" if ours else "; not packed by tacdata"),
        facts=(f"{frames / info['fps'] / 60:.1f} min at {info['fps']:g} Hz",),
        commands=(*commands, command("card", name)) if ours else (command("view", name, "--web"),),
    )


def network_entry(root: Path, folder: Path) -> LabEntry:
    """Return the entry of a training run, or of predictions alone."""
    name, file = folder.relative_to(root), folder / "scores" / "scores.json"
    if not file.is_file():
        trained = (folder / CHECKPOINT).is_file()
        words, next_step = (
            ("not evaluated", command("evaluate", name)) if trained else ("predictions", command("view", name, "--web"))
        )
        return _entry(root, folder, "Networks", words, commands=(next_step,))
    scores = documents.read(file, "scores")
    table = scores["contact_frames"]
    medians = [f"{words} {table[key]['median']:.3f} mm" for key, words in ERRORS.items() if key in table]
    return _entry(
        root,
        folder,
        "Networks",
        f"{scores['checkpoint']['name']}: {', '.join(medians)} (medians of frames in contact)",
        facts=(f"{scores['frames']['in_contact']:,} test frames", f"of {Path(scores['dataset']['path']).name}"),
        commands=(command("report", name, "--out", f"{name}-report.html"), command("view", name, "--web")),
        pages=pages_in(root, folder, folder / "scores"),
    )


def verdict_entry(root: Path, folder: Path) -> LabEntry:
    """Return the entry of a verdict."""
    name, verdict = folder.relative_to(root), documents.read(folder / "verdict.json", "verdict")
    recordings = verdict.get("heading", {}).get("recordings", ())
    next_steps = COMMAND.findall("\n".join(verdict["next"]))
    return _entry(
        root,
        folder,
        "Verdicts",
        sentence(verdict["why"])[0],
        "good" if verdict["status"] == "named" else "",
        (verdict["status"], *(f"of {Path(path).name}" for path in recordings)),
        (*next_steps, command("view", name, "--web")),
    )


def revision_entry(root: Path, folder: Path) -> LabEntry:
    """Return the entry of a revision."""
    name, revision = folder.relative_to(root), documents.read(folder / "revision.json", "revision")
    added, gap = ", ".join(revision["added"]), (revision["gap"] or {}).get("sealed")
    words = f"{added} added to the model" if added else "nothing added to the model"
    if gap:
        words += f"; gap of sealed episodes {gap['before']:.3g} before, {gap['after']:.3g} after (1 is noise alone)"
    return _entry(root, folder, "Revisions", words, "good" if added else "", commands=(command("view", name, "--web"),))


def health_entry(root: Path, folder: Path) -> LabEntry:
    """Return the entry of a unit's health."""
    health = documents.read(folder / "health.json", "health")
    first, visits = health["advice"][0], health["visits"]
    words = ALL_WELL if first["do"] == NOTHING else first["do"]
    return _entry(
        root,
        folder,
        "Health",
        f"{health['unit']['sensor']}: {words} ({first['why']})",
        "good" if first["do"] in (NOTHING, FIRST) else "bad",
        (f"{len(visits)} visits", *(f"latest {visit['session']}" for visit in visits[-1:])),
        pages=tuple(page for page in pages_in(root, folder) if Path(page).stem == "health"),
    )


def other_entry(root: Path, folder: Path, noun: str) -> LabEntry:
    """Return the entry of something that `tacdata view` opens, by its noun."""
    return _entry(root, folder, "Others", noun, commands=(command("view", folder.relative_to(root), "--web"),))


def _entry(
    root: Path,
    folder: Path,
    section: str,
    words: str,
    tone: str = "",
    facts: tuple[str, ...] = (),
    commands: tuple[str, ...] = (),
    pages: tuple[str, ...] | None = None,
) -> LabEntry:
    changed = folder.stat().st_mtime
    return LabEntry(
        section,
        folder.relative_to(root).as_posix(),
        words,
        tone,
        facts,
        date=local_minute(changed),
        commands=commands,
        pages=pages_in(root, folder) if pages is None else pages,
        order=changed,
    )
