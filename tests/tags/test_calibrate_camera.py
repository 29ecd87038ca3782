"""`tacdata calibrate-camera` as a person uses it."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import yaml
from board_images import BOARD, TRUTH, images
from PIL import Image
from typer.testing import CliRunner

from tacdata import cli, documents
from tacdata.errors import FormatError, TacdataError
from tacdata.tags.board import read_board
from tacdata.tags.calibration.board_view import find_board
from tacdata.tags.calibration.view_picker import ViewPicker, images_of
from tacdata.tags.camera import PinholeCamera


@cache
def shots():
    """Twelve images of the board, drawn once."""
    return list(images(12))


def calibrate(*options):
    return CliRunner().invoke(cli.application(), ["calibrate-camera", *map(str, options)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Images of the board, one without it, and the board's file."""
    root = tmp_path_factory.mktemp("images")
    (root / "taken").mkdir()
    for k, image in enumerate(shots()):
        cv2.imwrite(str(root / "taken" / f"{k:02}.png"), image)
    cv2.imwrite(str(root / "taken" / "empty.png"), np.full((480, 640), 90, np.uint8))
    documents.write(root / "board.yaml", BOARD.document, "calibration_board")
    return root


def test_images_become_a_calibration_that_a_rig_file_takes(folder, tmp_path):
    out = tmp_path / "camera.yaml"
    options = ("--board", folder / "board.yaml", "--source", folder / "taken", "--model", "k1k2p1p2")
    shown = calibrate(*options, "--out", out)
    assert shown.exit_code == 0, shown.output
    assert "13 images, the board in 12" in shown.output
    document = documents.read(out, "camera_calibration")
    assert abs(document["intrinsics"]["fx"] - TRUTH["fx"]) < 3 and document["rms"] < 0.2
    assert len(document["views"]) == 12 and document["board"] == BOARD.document
    assert cv2.imread(str(out.with_suffix(".png"))) is not None
    printed = yaml.safe_load(shown.output[shown.output.index("intrinsics:") :])
    assert printed["intrinsics"] == document["intrinsics"]
    assert PinholeCamera.from_document(printed["intrinsics"]).width == 640
    again = calibrate(*options, "--out", out)
    assert isinstance(again.exception, TacdataError) and "not overwritten" in str(again.exception)


def test_a_drawn_board_has_its_size_on_paper_and_a_file(tmp_path):
    board = tmp_path / "board.yaml"
    shown = calibrate("--board", board, "--draw", tmp_path / "board.png")
    assert shown.exit_code == 0, shown.output
    sheet = Image.open(tmp_path / "board.png")
    assert sheet.info["dpi"][0] == pytest.approx(600, abs=0.1)
    assert np.allclose(np.array(sheet.size) * 25.4 / 600, (297, 210), atol=0.05)
    wanted = read_board(board)
    small = np.asarray(sheet.convert("L").resize((sheet.width // 4, sheet.height // 4), Image.Resampling.BOX))
    view = find_board(small, wanted)
    assert view is not None and len(view.ids) == (wanted.columns - 1) * (wanted.rows - 1)
    assert calibrate("--board", tmp_path / "b.yaml", "--draw", tmp_path / "b.pdf").exit_code == 0
    assert (tmp_path / "b.pdf").read_bytes().startswith(b"%PDF")
    assert isinstance(calibrate("--board", board, "--draw", tmp_path / "c.png").exception, TacdataError)


def test_a_film_gives_its_still_and_different_images(folder, tmp_path):
    shots = [cv2.imread(str(p)) for p in sorted((folder / "taken").glob("[01]*.png"))]
    film = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (640, 480))
    for shot in [*shots[:10], shots[9]]:  # each twice: held still; the last one longer
        film.write(shot)
        film.write(shot)
    film.release()
    options = ("--board", folder / "board.yaml", "--source", tmp_path / "film.avi", "--out", tmp_path / "c.yaml")
    shown = calibrate(*options, "--model", "k1k2p1p2")
    assert "22 images, the board in 22, 10 views taken" in shown.output


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"source": "nothing"}, "no file or folder"),
        ({"source": "text.mp4"}, "no video"),
        ({"source": "mixed"}, "images of one size"),
        ({"source": "broken"}, "cannot be read as an image"),
        ({"source": "blank"}, "0 views"),
        ({"source": "nobody"}, "holds no image"),
        ({"model": "fisheye"}, "rational"),
        ({"board": "none.yaml"}, "none.yaml"),
        ({"source": "97"}, "no camera 97"),
        ({"source": "0", "size": "large"}, "WIDTHxHEIGHT"),
        ({"source": None}, "--source with --out"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(folder, tmp_path, monkeypatch, change, words):
    monkeypatch.chdir(tmp_path)
    grey = np.full((480, 640), 90, np.uint8)
    for name in ("mixed", "broken", "blank", "nobody"):
        (tmp_path / name).mkdir()
    (tmp_path / "text.mp4").write_text("no film")
    (tmp_path / "broken" / "a.png").write_text("no image")
    for name, shape in (("mixed", (480, 640)), ("blank", (480, 640))):
        cv2.imwrite(str(tmp_path / name / "a.png"), grey[: shape[0]])
    cv2.imwrite(str(tmp_path / "mixed" / "b.png"), grey[:100])
    values = {"board": folder / "board.yaml", "source": folder / "taken", "out": "c.yaml", **change}
    shown = calibrate(*(part for k, v in values.items() if v is not None for part in (f"--{k}", v)))
    assert isinstance(shown.exception, TacdataError), shown.output
    assert words in str(shown.exception)
    assert not (tmp_path / "c.yaml").exists()


MIRROR, NEGATIVE, PLAIN = (lambda image: image[:, ::-1]), (lambda image: 255 - image), (lambda image: image)


@pytest.mark.parametrize(
    ("changes", "seen_as", "words"),
    [
        ({"legacy": True}, PLAIN, "legacy: false"),
        ({"columns": 6, "rows": 9}, PLAIN, "columns: 9 and rows: 6"),
        ({"dictionary": "5X5_100"}, PLAIN, "dictionary: 4X4_50"),
        ({}, MIRROR, "mirroring off"),
        ({"columns": 6, "rows": 9}, MIRROR, "mirroring off, and write columns: 9"),
        ({}, NEGATIVE, "black on white"),
        ({"columns": 8}, PLAIN, "columns: 9 and rows: 6"),
        ({"columns": 10, "rows": 7}, PLAIN, "columns: 9 and rows: 6"),
    ],
)
def test_why_no_board_is_found_is_looked_for_and_named(changes, seen_as, words):
    pattern = replace(BOARD, **changes)
    picker = ViewPicker(pattern, still=False)
    for k, image in enumerate(shots()[:2]):
        assert not picker.take(np.ascontiguousarray(seen_as(image)), f"image {k}")
    with pytest.raises(FormatError, match="in the others") as caught:
        picker.check_board()
    assert words in str(caught.value)


def test_a_few_odd_images_are_remarked_upon_or_refused_if_too_few_are_left():
    picker = ViewPicker(BOARD, still=False)
    for k, image in enumerate(shots()[:3]):
        picker.take(np.ascontiguousarray(image[:, ::-1]) if k == 2 else image, f"image {k}")
    assert "in 2 of 3 images; in the others the images are mirrored: switch" in picker.check_board()
    with pytest.raises(FormatError, match="mirrored"):
        picker.check_board(least=8)


def test_images_of_no_board_are_not_explained():
    picker = ViewPicker(BOARD, still=False)
    noise = np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8)
    assert not picker.take(noise, "noise")
    picker.check_board()


def test_pixels_are_read_as_the_sensor_wrote_them(tmp_path):
    """Whatever turn a viewer is told by EXIF: the optical centre belongs to the sensor."""
    plain = np.random.default_rng(0).integers(0, 255, (48, 64), dtype=np.uint8)
    endings = {"png": {}, "tif": {}, "webp": {"lossless": True}, "jpg": {"quality": 95}}
    for orientation in range(1, 9):
        tag = Image.Exif()
        tag[0x0112] = orientation
        for ending, options in endings.items():
            Image.fromarray(plain).save(tmp_path / f"{ending}_{orientation}.{ending}", exif=tag, **options)
    found = dict(images_of(tmp_path))
    assert len(found) == 32
    for name, image in found.items():
        np.testing.assert_array_equal(image, found["jpg_1.jpg"] if name[0] == "j" else plain, err_msg=name)
