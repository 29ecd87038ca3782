"""Find which physical effect a model of a sensor lacks."""

import time
from pathlib import Path
from typing import Annotated

import typer

from tacdata import progress
from tacdata.commands.command import FIND, Result
from tacdata.errors import TacdataError, UsageError

ORDER = 10
PANEL = FIND
EXAMPLES = (
    "tacdata discrepancy session --out verdict",
    "tacdata discrepancy tuesday --reference monday --out changed",
    "tacdata discrepancy session --spec spec.json --out verdict",
)


def run(
    recordings: Annotated[
        list[Path], typer.Argument(help="Recordings (.mcap) or session folders; several sessions in one verdict.")
    ],
    out: Annotated[Path, typer.Option(help="New folder: verdict.html, .json, .txt, .png, residuals.parquet, a spec.")],
    spec: Annotated[
        Path | None,
        typer.Option(help="Model spec (schemas/model_spec.schema.json); else a response fitted to the recordings."),
    ] = None,
    reference: Annotated[
        list[Path] | None,
        typer.Option(help="Session of the same machine when healthy, as the model: what differs, with its size."),
    ] = None,
    stop_after: Annotated[
        str, typer.Option(help="Last step: gate (is there a gap), locate (where), fit (what fits best), decide (all).")
    ] = "decide",
    fem: Annotated[
        bool, typer.Option("--fem", help="Start from finite elements: tacdata surrogate first, into OUT-base.")
    ] = False,
) -> Result:
    """Find where recordings and a model disagree, and name the missing effect, or say why not."""
    # A spec can name healthy sessions, too; then it is the same comparison.
    healthy = reference or _healthy(spec)
    if healthy:
        return _compared(recordings, healthy, out, spec if reference else None, fem)
    import tacdata as td
    import tacdata.warp_runtime

    console = progress.console()
    if fem:
        spec = _solved(recordings, spec, out)
    begun = time.monotonic()
    with console.status("reading") as status:

        def show(words: str) -> None:
            status.update(words)
            console.print(f"{time.monotonic() - begun:5.0f} s  {words}")

        verdict = td.judge(recordings, out, spec=spec, stop_after=stop_after, progress=show)
    print("base: " + ("a response fitted to these recordings" if spec is None else str(spec)))
    print(verdict.text, end="")
    if len(recordings) > 1:
        print(_between(recordings))
    console.print(f"written: {verdict.folder}")
    return Result(verdict.document)


def _solved(recordings: list[Path], spec: Path | None, target: Path) -> Path:
    """Solve the presses of the recordings; return the spec that starts from it."""
    from tacdata.commands import surrogate

    if spec is not None or target.exists():
        raise UsageError(
            f"--fem with --spec {spec}" if spec is not None else f"{target} exists",
            "one base, and a new folder",
            "leave one of them out" if spec is not None else "choose another --out",
        )
    base = target.with_name(f"{target.name}-base")
    surrogate.run(recordings, base, None, False, None, "cpu", 1, False)
    return base / "spec.json"


def _healthy(spec: Path | None) -> list[Path]:
    """Return the healthy machine's sessions that a spec names as its response; none for other specs."""
    from tacdata.discrepancy.model.spec import read_spec

    # Also without --spec: that is a fitted response, which names no sessions.
    response = read_spec(spec).document["response"]
    if spec is None or response["kind"] != "recordings":
        return []
    return [spec.parent / name for name in response["sessions"]]


def _compared(recordings: list[Path], healthy: list[Path], target: Path, spec: Path | None, fem: bool) -> Result:
    """Compare with a healthy machine, print and write it."""
    from tacdata.reference.run import compare, write

    if spec is not None or fem:
        raise UsageError(
            "--reference with --fem" if fem else f"--reference with --spec {spec}", "one model", "leave one of them out"
        )
    if target.exists():
        raise UsageError(f"{target} exists", "a new folder", "choose another --out")
    with progress.console().status("comparing with the healthy machine"):
        compared = compare(recordings, healthy)
    print(compared.text, end="")
    write(compared, target)
    print(f"written: {target}")
    return Result(compared.document)


def _between(recordings: list[Path]) -> str:
    """Return in a sentence whether the first session differs from the others."""
    from tacdata.reference.report import sentence
    from tacdata.reference.run import compare

    remainder, first = recordings[1:], recordings[0]
    named = f"sessions: {', '.join(map(str, remainder))} with {first} as the reference"
    try:
        # Only a remark below the verdict, so a session that cannot be compared does not end the verb.
        compared = compare(remainder, [first])
    except TacdataError as error:
        return f"{named}: not compared, {error.given}"
    return f"{named}: {sentence(compared.found, compared.heading.unit)}"
