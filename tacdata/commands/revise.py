"""Revise a model by a verdict: add the effect, relabel, show the gap, plan presses."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata import progress
from tacdata.commands.command import FIND, Result
from tacdata.progress import say, suggest

ORDER = 20
PANEL = FIND
EXAMPLES = (
    "tacdata revise verdict session --out revised",
    "tacdata revise verdict session --out revised --suspected --corrected",
    "tacdata revise verdict session --out revised --presses 8",
)


def run(
    verdict: Annotated[Path, typer.Argument(help="Folder that tacdata discrepancy wrote.")],
    recordings: Annotated[list[Path], typer.Argument(help="The recordings or sessions that it was given.")],
    out: Annotated[Path, typer.Option(help="New folder for spec.json, card.html, gap.rrd, next.yaml.")],
    spec: Annotated[Path | None, typer.Option(help="The model spec that it was given, if one was.")] = None,
    relabel: Annotated[bool, typer.Option("--relabel", help="Make the labels again that the effect moves.")] = False,
    store: Annotated[Path | None, typer.Option(help="Folder of solved presses; else SESSION/labels/store.")] = None,
    uncertainty: Annotated[bool, typer.Option(help="Labels with their spreads, as tacdata label has them.")] = True,
    confirm: Annotated[
        int, typer.Option(min=0, help="Presses to solve by finite elements where the effect matters most.")
    ] = 0,
    suspected: Annotated[
        bool, typer.Option("--suspected", help="Add the best explanation, too, where nothing is named; marked so.")
    ] = False,
    corrected: Annotated[
        bool, typer.Option("--corrected", help="Write the recordings without the effects: corrected.csv.")
    ] = False,
    presses: Annotated[int, typer.Option(min=1, help="Different presses of the next plan.")] = 4,
    retrain: Annotated[
        bool, typer.Option("--retrain", help="Train a network on the data before and one on those after; score both.")
    ] = False,
    epochs: Annotated[int, typer.Option(min=1, help="Passes of each training.")] = 10,
    network: Annotated[str, typer.Option(help="A file name in training/networks.")] = "paper",
    truth: Annotated[
        Path | None,
        typer.Option(help="CSV of the tip's true path, if one is known: time_ns, x, y, depth [mm]; else the tag's."),
    ] = None,
    factory: Annotated[str, typer.Option(hidden=True, help="What builds the model: module:name.")] = "",
) -> Result:
    """Add the named effects of a verdict to the model, show the gap before and after, and plan the next presses."""
    from tacdata.discrepancy.model.spec import read_spec
    from tacdata.label_farm.labelling import FarmSettings
    from tacdata.label_farm.presses.model import FACTORY
    from tacdata.revision.evidence.table import in_words
    from tacdata.revision.labels.retrain import Recipe
    from tacdata.revision.revise import CARD, SPEC, RevisionOptions, revise
    from tacdata.viewers.rerun.gap_recording import write

    console = progress.console()
    farm = FarmSettings(factory=factory or FACTORY, uncertainty=uncertainty) if relabel else None
    with console.status("reading") as status:
        recipe = Recipe(epochs, network) if retrain else None
        wishes = RevisionOptions(farm, store, confirm, suspected, corrected, presses, recipe, truth)
        done = revise(verdict, recordings, read_spec(spec), out, wishes, status.update)
        if done.shown:
            status.update("Rerun file")
            write(done.shown, out / "gap.rrd", done.document["status"])
    document = done.document
    gap = document["gap"]
    if gap:
        sealed = gap["sealed"]
        print(
            f"sealed episodes: {sealed['episodes']}; residual {sealed['before']:.3g} before, {sealed['after']:.3g} "
            "after; 1 is the noise floor"
        )
        for change in gap["elsewhere"]:
            print(f"  left out, {change['name']}: {change['before']:.3g} before, {change['after']:.3g} after")
        # A good mean can hide one slice that became worse.
        worst = max(gap["slices"], key=lambda c: c["after"])
        print(f"  worst of them after, {worst['name']}: {worst['before']:.3g} before, {worst['after']:.3g} after")
    for entry in document["labels"]:
        print(
            f"{entry['session']}: {entry['paths']} of {entry['episodes']} paths move, {entry['path_rms']:.4f} mm rms, "
            f"{entry['path_most']:.4f} mm at most"
        )
        if entry["labels"]:
            print(
                f"  {entry['labels']} labels made again: {entry['rms']:.4f} mm rms, {entry['most']:.4f} mm at most; "
                f"{entry['solved']} paths solved, {entry['found']} found in the store"
            )
    for t in document["tips"]:
        print(
            f"{t['session']}: tip {t['before']:.4f} mm off before, {t['after']:.4f} after (rms in contact, against "
            f"{t['against']}); {t['better']} of {t['episodes']} episodes better, {t['worse']} worse; "
            f"in addition a constant {t['constant_before']:.4f} mm before, {t['constant_after']:.4f} after"
        )
    if document["retrained"]:
        print(in_words(document["retrained"]))
        for m in document["retrained"]["metrics"]:
            pair = ("–" if m[side] is None else f"{m[side]:.4g}" for side in ("before", "after"))
            print(f"  {m['title']} [{m['unit']}]: {' before, '.join(pair)} after")
    for c in document["confirmed"]:
        outcome = f"{100 * c['difference']:.1f} % off" if c["solved"] else "no equilibrium"
        print(f"finite elements, {c['tool']} {c['depth']:.3f} mm deep: {outcome}")
    if document["added"]:
        print(f"added: {', '.join(document['added'])} in {out / SPEC}")
    for words in (document["next"]["remark"], *document["next"]["presses"]):
        if words:
            say(f"next: {words}")
    for remark in document["remarks"]:
        print(remark)
    if document["suspected"]:
        print(f"not added, as they are only suspected: {', '.join(document['suspected'])}")
    for what, change in (document["corrected"] or {}).items():
        print(f"corrected {what}: {change if what != 'file' else out / change}")
    if (document["next"]["plan"] or "").endswith(".csv"):
        say(f"next: press as in {out / document['next']['plan']}, and import the new files")
    elif document["next"]["plan"]:
        suggest("record --rig RIG --plan", out / document["next"]["plan"], "--out SESSION")
    print(f"card: {out / CARD}")
    return Result(document)
