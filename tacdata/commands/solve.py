"""Solve one press with the skin model, from a case file."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from tacdata import progress
from tacdata.commands.command import DATA, Result

ORDER = 95
PANEL = DATA
EXAMPLES = (
    "tacdata solve case.yaml",
    "tacdata solve case.yaml --out solved --picture",
    "tacdata solve case.yaml --json",
)


def run(
    case: Annotated[Path, typer.Argument(help="Case file (schemas/case.schema.json).")],
    out: Annotated[Path, typer.Option(help="Folder for NAME.json (forces), NAME.parquet (displacements).")] = Path("."),
    picture: Annotated[bool, typer.Option("--picture", help="Also draw the deepest state into NAME.png.")] = False,
) -> Result:
    """Solve one press with the skin model: displacements, forces, readings and their error, as files."""
    from tacdata import documents
    from tacdata.cases.case import read_case, solve_case
    from tacdata.warp_runtime import report_modules

    console = progress.console()
    problem = read_case(case)
    with (
        console.status(f"{problem.name}: meshing and factorizing") as status,
        report_modules(
            lambda count, about: status.update(f"{problem.name}: compiling kernels, {count} of about {about} modules")
        ),
    ):
        report = solve_case(problem, out, lambda depth: status.update(f"{problem.name}: {depth:g} mm solved"), picture)
    answer = documents.read(report, "case_result")
    mesh = answer["mesh"]
    console.print(
        f"mesh: {mesh['elements']:.0f} elements, radius ratio {mesh['worst_ratio']:.2f} at worst, "
        f"{mesh['median_ratio']:.2f} in the median (1 is best), volume {100 * mesh['volume_error']:+.2f} %"
    )
    for remark in answer["remarks"]:
        print(f"warning: {remark}", file=sys.stderr)
    print(report)
    return Result(answer)
