"""Write a press plan: a shipped one, or a recipe of one's own written out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tacdata.commands.command import RECORD, Result
from tacdata.errors import UsageError
from tacdata.progress import suggest

if TYPE_CHECKING:
    from tacdata.plans import Plan
    from tacdata.recording.motion.plan_time import PlanTime
    from tacdata.sensor import Sensor

ORDER = 20
PANEL = RECORD
EXAMPLES = (
    "tacdata plan training --presses 200 --out plan.yaml",
    "tacdata plan health --out health.yaml --picture plan.png",
    "tacdata plan diagnostic --indenter sphere_2 --out diagnostic.yaml",
)


def run(
    what: Annotated[
        str, typer.Argument(metavar="[NAME|FILE]", help="A shipped plan (tacdata list shipped), a recipe, or a plan.")
    ] = "training",
    out: Annotated[Path | None, typer.Option(help="Plan file to write (YAML); must not exist.")] = None,
    presses: Annotated[int | None, typer.Option(min=1, help="How many presses (training: 24 if not given).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same plan.")] = 0,
    indenter: Annotated[
        list[str] | None, typer.Option(help="Specimen to use; repeat for several. Default: the plan's own.")
    ] = None,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file; default: the paper's.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Picture of sites and depths to write (PNG).")] = None,
) -> Result:
    """Write a press plan (training, evaluation, diagnostic, or a recipe of yours), with a summary and a picture."""
    from tacdata import documents
    from tacdata.plans import Plan
    from tacdata.recording.motion.plan_time import plan_time
    from tacdata.sensor import default_sensor, read_sensor

    for path in (out, picture):
        if path and path.exists():
            raise UsageError(f"{path} exists", "a new file; nothing is overwritten", "choose another name")
    skin = read_sensor(sensor) if sensor else default_sensor()
    document, is_plan = _document(what, skin, presses, seed, indenter)
    plan = Plan.from_document(document, what)
    plan.check_against(skin)
    if out:
        documents.write(out, document, "plan")
    # A plan's file may be named alone, for its summary.
    elif not (picture or is_plan):
        raise UsageError(
            f"nowhere to write the plan {what}", "--out FILE, --picture FILE or both", "add --out plan.yaml"
        )
    expected = plan_time(plan)
    print(_summary(plan, skin, expected))
    if picture:
        from tacdata.viewers.pictures.plan import draw

        draw(plan, skin, expected.press_seconds, picture)
        print(f"picture: {picture}")
    if out:
        print(f"{len(plan.presses)} presses with {', '.join(document['indenters'])} in {out}")
    if written := out or (Path(what) if is_plan else None):
        suggest("record --rig RIG --plan", written, "--out SESSION")
    return Result({"plan": document, "expected": expected, "written": out, "picture": picture})


def _document(
    what: str, skin: Sensor, presses: int | None, seed: int, indenter: list[str] | None
) -> tuple[dict[str, Any], bool]:
    """Return the plan's document, and whether it was read unchanged from a plan's file."""
    from tacdata.plans.recipe import write_out
    from tacdata.plans.shipped.shipped_plan import PlanOptions, shipped_plan

    path = Path(what)
    if not (path.suffix in (".yaml", ".yml", ".json") or path.is_file()):
        return shipped_plan(what, skin, PlanOptions(presses, tuple(indenter) if indenter else None, seed)), False
    if presses is not None or indenter:
        raise UsageError(
            f"--presses or --indenter with the file {what}", "neither: both are in the file", "leave them out"
        )
    document = _read(path)
    return (write_out(document, skin, what, seed), False) if "blocks" in document else (document, True)


def _read(path: Path) -> dict[str, Any]:
    """Read a plan or a recipe, whichever it is."""
    from tacdata import documents
    from tacdata.plans.recipe import read_recipe

    content = documents.content_of(path, "plan")
    has_blocks = isinstance(content, dict) and "blocks" in content
    return read_recipe(path) if has_blocks else documents.read(path, "plan")


def _summary(plan: Plan, skin: Sensor, expected: PlanTime) -> str:
    from tacdata.plans.beside_skin import tip_aside
    from tacdata.recording.motion.plan_time import SECONDS_PER_MOUNTING, USUAL_LIMITS

    presses = plan.presses
    x, y, depth = ([getattr(p, axis) for p in presses] for axis in ("x", "y", "depth"))
    speeds, holds = [p.speed for p in presses], [p.hold for p in presses]
    kinds = dict.fromkeys(p.purpose for p in presses if p.purpose)
    minutes, mounting = expected.seconds / 60, expected.mountings * SECONDS_PER_MOUNTING / 60
    lines = [
        f"plan {plan.name}: {len(presses)} presses at {len(set(zip(x, y, strict=True)))} sites of {skin.name}",
        f"  x {min(x):g} to {max(x):g} mm, y {min(y):g} to {max(y):g} mm, depth {min(depth):g} to {max(depth):g} mm",
        f"  speed {min(speeds):g} to {max(speeds):g} mm/s, hold {min(holds):g} to {max(holds):g} s",
        *(f"  {sum(p.purpose == kind for p in presses):4d}  {kind}" for kind in kinds),
        f"time: about {minutes:.0f} min of pressing at {USUAL_LIMITS.acceleration[0]:g} mm/s^2, and "
        f"{expected.mountings} mounting{'s' * (expected.mountings > 1)}, about {mounting:.0f} min",
    ]
    shapes = {p.indenter_name: p.indenter for p in presses}
    lines += [f"note: {name}: {remark}" for name, shape in shapes.items() if (remark := tip_aside(shape))]
    return "\n".join(lines)
