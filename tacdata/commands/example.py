"""A first look, without a rig."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands import check
from tacdata.commands.command import START, Result
from tacdata.progress import say

ORDER = 10
PANEL = START
EXAMPLES = ("tacdata example", "tacdata example /tmp/first_look", "tacdata example mine --quiet")
PICTURE = "press.png"


def run(
    out: Annotated[Path, typer.Argument(help="New folder for the recording and its pictures.")] = Path("example"),
) -> Result:
    """Copy a small recording that ships with tacdata, check it and draw one press of it."""
    import tacdata as td
    from tacdata.example import DEEPEST
    from tacdata.extras import install_line
    from tacdata.viewers.pictures.backend import PictureBackend
    from tacdata.viewers.source import scene_at

    report = check.checked(td.example_session(out).folder, out)
    scene = scene_at(out, episode=DEEPEST)
    print(f"press {DEEPEST}: {scene.found[0]}")
    for line in scene.found[1:]:
        print(f"  {line}")
    PictureBackend(out / PICTURE).draw(scene)
    print(f"picture: {out / PICTURE}")
    say(f"next: open {out / PICTURE}, then")
    for command, purpose in (
        (f"tacdata browse {out}", "list its presses"),
        (f"tacdata view {out}", f"turn one in 3D ({install_line('view')})"),
        ("tacdata demo", f"run the whole pipeline ({install_line('all')})"),
    ):
        say(f"  {command:<{len(str(out)) + 18}}{purpose}")
    press = {"number": DEEPEST, "found": scene.found}
    return Result({"check": report.document, "press": press, "folder": out, "picture": out / PICTURE})
