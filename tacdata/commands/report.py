"""Put the scores of training runs on one HTML page."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import LEARN, Result
from tacdata.errors import UsageError
from tacdata.progress import say

ORDER = 30
PANEL = LEARN
EXAMPLES = (
    "tacdata report network --out report.html",
    "tacdata report pattern history --out report.html",
    "tacdata report network --dataset unseen --out unseen.html",
)


def run(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Folders of training runs, or folders of such.")],
    out: Annotated[Path, typer.Option(help="HTML file to write; must not exist.")],
    dataset: Annotated[
        Path | None, typer.Option(help="Dataset folder; default: the one that each network was trained on.")
    ] = None,
    trials: Annotated[
        Path | None,
        typer.Option(help="Dataset of the paper's trials; they are evaluated with the first run's network."),
    ] = None,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most.")] = None,
) -> Result:
    """Write one self-contained HTML page: tables, best, median and worst cases, splits, reliability.

    Runs of one network and recipe that differ in their seed are put together, mean ± SD.
    """
    from tacdata import documents
    from tacdata.dataset.reader import read_dataset
    from tacdata.training.frames.data import frames_of, read_frames
    from tacdata.training.frames.frames import Frames
    from tacdata.training.inference import checkpoint
    from tacdata.training.reports.protocol_sheet import markdown
    from tacdata.training.reports.report_page import Scored, page
    from tacdata.training.scoring.evaluate import evaluate
    from tacdata.training.scoring.protocols import protocols

    if out.exists():
        raise UsageError(f"{out} exists", "a new file; nothing is overwritten", "choose another --out")
    if trials:
        read_dataset(trials).check_measured("the paper's trials")
    trained = [checkpoint.load(folder) for folder in _folders(runs)]
    by_folder: dict[Path, Frames] = {}
    scored = []
    for network in trained:
        place = dataset or Path(network.document["dataset"]["path"])
        if dataset is None and not place.is_dir():
            raise UsageError(
                f"the dataset {place} of {network.path} is not there", "a dataset folder", "give --dataset"
            )
        # Runs of one dataset share its frames: they take most of the memory.
        frames = by_folder.setdefault(place, read_frames(place)) if place not in by_folder else by_folder[place]
        folder = network.path.parent
        scored.append(Scored(network.settings.title, evaluate(network, frames, device, threads), frames, folder))
        say(f"scored {folder}")
    sheet = markdown(protocols(frames_of(read_dataset(trials)), trained[0])) if trials else ""
    documents.write_text(out, page(scored, sheet))
    print(f"report: {out}")
    return Result({"runs": [{"title": run.name, **run.evaluation.document} for run in scored], "report": out})


def _folders(paths: list[Path]) -> list[Path]:
    """Return the runs: those named, and those in folders that hold runs."""
    from tacdata.training.inference.checkpoint import BEST

    runs = []
    for path in paths:
        inside = sorted(best.parent for best in path.glob(f"*/{BEST}")) if path.is_dir() else []
        runs += inside if inside and not (path / BEST).is_file() else [path]
    return runs
