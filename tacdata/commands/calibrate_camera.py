"""Estimate a camera's intrinsics from images of a ChArUco board, or draw the board."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import RECORD, Result
from tacdata.errors import UsageError
from tacdata.progress import say, suggest

if TYPE_CHECKING:
    from tacdata.tags.board import Board
    from tacdata.tags.calibration.view_picker import ViewPicker

ORDER = 70
PANEL = RECORD
EXAMPLES = (
    "tacdata calibrate-camera --board board.yaml --draw board.pdf",
    "tacdata calibrate-camera --board board.yaml --source images --out camera.yaml",
    "tacdata calibrate-camera --board board.yaml --source 0 --out camera.yaml",
)


def run(
    board: Annotated[Path, typer.Option(help="Board file (YAML); with --draw it is written and must not exist.")],
    source: Annotated[str | None, typer.Option(help="Folder of images, video, camera index or stream URL.")] = None,
    out: Annotated[Path | None, typer.Option(help="Calibration to write (YAML), with a picture next to it.")] = None,
    draw: Annotated[Path | None, typer.Option(help="Draw a board to print here (.pdf or .png) and stop.")] = None,
    columns: Annotated[int, typer.Option(help="Squares across, with --draw.")] = 11,
    rows: Annotated[int, typer.Option(help="Squares down, with --draw.")] = 7,
    square: Annotated[float, typer.Option(help="Side of a square [mm], with --draw.")] = 24.0,
    marker: Annotated[float, typer.Option(help="Side of a marker [mm], with --draw.")] = 17.0,
    dictionary: Annotated[str, typer.Option(help="Dictionary of the markers, with --draw.")] = "5X5_100",
    paper: Annotated[str, typer.Option(help="a4, a3 or letter, with --draw.")] = "a4",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT [px] asked of a live camera.")] = "1280x720",
    views: Annotated[int, typer.Option(min=8, max=200, help="Views wanted of a live camera or video.")] = 30,
    model: Annotated[str, typer.Option(help="auto, k1k2p1p2, k1k2p1p2k3 or rational.")] = "auto",
) -> Result:
    """Estimate a camera's intrinsics from images, a video or a live camera; --draw makes the board."""
    from tacdata.tags.board import read_board

    if draw:
        shape = {"columns": columns, "rows": rows, "square": square, "marker": marker, "dictionary": dictionary}
        _draw(draw, board, shape, paper)
        return Result({"board": board, "picture": draw})
    if source is None or out is None:
        raise UsageError("neither --draw nor --source with --out", "one of them", "see tacdata calibrate-camera --help")
    from tacdata.tags.calibration.intrinsics import MODELS

    if model not in ("auto", *MODELS):
        raise UsageError(f"model {model!r}", f"auto, {', '.join(MODELS)}", "choose one of them")
    picture = out.with_suffix(".png")
    for path in (out, picture):
        if path.exists():
            raise UsageError(f"{path} exists", "a new file; calibrations are not overwritten", "choose another --out")
    pattern = read_board(board)
    is_live = source.isdigit() or "://" in source
    picker = _watch(source, pattern, size, views) if is_live else _look_through(Path(source), pattern, views)
    return _calibrate(picker, pattern, source, model, out, picture)


def _calibrate(picker: ViewPicker, board: Board, source: str, model: str, target: Path, picture: Path) -> Result:
    import cv2
    import yaml

    from tacdata import documents, provenance
    from tacdata.tags.calibration.intrinsics import LEAST_VIEWS, calibrate
    from tacdata.tags.calibration.picture import draw_calibration

    say(f"{picker.seen} images, the board in {picker.with_board}, {len(picker.views)} views taken")
    if odd := picker.check_board(LEAST_VIEWS):
        print(f"note: {odd}")
    calibration = calibrate(picker.views, board, picker.size or (0, 0), model)
    date = datetime.now(UTC).isoformat(timespec="seconds")
    document = calibration.document(board, source, provenance.code_version(), date)
    documents.write(target, document, "camera_calibration")
    picture.write_bytes(cv2.imencode(".png", draw_calibration(calibration))[1].tobytes())
    for used in calibration.views:
        if used.reason:
            print(f"dropped {used.view.name}: {used.reason}")
    for remark in calibration.remarks:
        print(f"note: {remark}")
    spread = calibration.spread
    print(
        f"fx {calibration.matrix[0, 0]:.2f} +- {spread[0]:.2f}, fy {calibration.matrix[1, 1]:.2f} +- {spread[1]:.2f}, "
        f"cx {calibration.matrix[0, 2]:.2f} +- {spread[2]:.2f}, cy {calibration.matrix[1, 2]:.2f} +- {spread[3]:.2f} px"
    )
    used_views = sum(not used.reason for used in calibration.views)
    print(
        f"{calibration.model}; rms {calibration.rms:.3f} px over {used_views} views, "
        f"{calibration.held_out_rms:.3f} px on views held out; corners in {calibration.coverage:.0%} of the image"
    )
    print(f"written to {target} and {picture}")
    say("next: put this into the camera's entry of the rig file\n")
    say(yaml.safe_dump({"intrinsics": calibration.intrinsics}, sort_keys=False, default_flow_style=None).rstrip())
    return Result(document)


def _draw(target: Path, board: Path, shape: dict[str, int | float | str], paper: str) -> None:
    from PIL import Image

    from tacdata import documents
    from tacdata.tags.board import DPI, Board, draw_board, printable

    if target.suffix.lower() not in (".pdf", ".png"):
        raise UsageError(f"--draw {target}", "a file ending in .pdf or .png", "choose another name")
    for path in (target, board):
        if path.exists():
            raise UsageError(f"{path} exists", "a new file", "choose another name")
    drawing = printable(Board.from_document({"version": "1.0", **shape}, "--draw"))
    # Black and white: grey edges of a marker would be printed as dots.
    sheet = Image.fromarray(draw_board(drawing, paper)).convert("1", dither=Image.Dither.NONE)
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.suffix.lower() == ".pdf":
        sheet.save(target, resolution=DPI)
    else:
        sheet.save(target, dpi=(DPI, DPI))
    documents.write(board, drawing.document, "calibration_board")
    print(f"{target} is to be printed at 100 %; measure its squares and correct square and marker in {board}")
    suggest("calibrate-camera --board", board, "--source IMAGES --out camera.yaml")


def _look_through(source: Path, board: Board, views: int) -> ViewPicker:
    """Take a folder's images all, and of a video the still ones that show something new."""
    from tacdata.tags.calibration.view_picker import ViewPicker, images_of

    picker = ViewPicker(board, still=not source.is_dir())
    for name, image in images_of(source):
        picker.take(image, name)
        if picker.still and len(picker.views) >= views:
            break
    return picker


def _watch(source: str, board: Board, size: str, views: int) -> ViewPicker:
    """Watch a live camera until there are enough views, or Ctrl-C."""
    from tacdata.clock import Clock
    from tacdata.devices.opencv_camera import OpencvCamera
    from tacdata.tags.calibration.intrinsics import coverage_of
    from tacdata.tags.calibration.view_picker import ViewPicker

    parts = size.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and int(part) > 0 for part in parts):
        raise UsageError(f"size {size!r}", "WIDTHxHEIGHT, for example 1280x720", "correct --size")
    shape = {"width": int(parts[0]), "height": int(parts[1])}
    picker = ViewPicker(board)
    say("Show the board to every part of the image, tilted to all sides, and hold it still. Ctrl-C ends.")
    with OpencvCamera(Clock.start(), source, shape) as camera:
        try:
            while len(picker.views) < views:
                images = camera.read(1.0)
                # The two latest tell whether it is held still; older ones would only add delay.
                for image in images[-2:]:
                    if picker.take(image.image, f"image {image.sequence}"):
                        share = coverage_of(picker.views, (shape["width"], shape["height"]))
                        say(f"  view {len(picker.views)} of {views}, {share:.0%} of the image")
        except KeyboardInterrupt:
            print()
    return picker
