"""Pictures small enough for a repository, replacing those of before."""

import tempfile
from pathlib import Path

from tacdata.replacement import replacement
from tacdata.viewers.pictures.backend import PictureBackend
from tacdata.viewers.pictures.film import FilmBackend
from tacdata.viewers.scene.scene import Scene

PAGE, FILM = 64, 52
"""Resolutions [dots per inch]."""


def small_page(scene: Scene, path: Path) -> Path:
    """Draw a page and return its path."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "page.png"
        PictureBackend(file, PAGE).draw(scene)
        _put(file, path)
    return path


def small_film(scene: Scene, path: Path) -> Path:
    """Draw a film (.gif) and return its path."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.gif"
        FilmBackend(file, FILM).draw(scene)
        _put(file, path)
    return path


def _put(source: Path, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacement(path) as stream:
        stream.write(source.read_bytes())
