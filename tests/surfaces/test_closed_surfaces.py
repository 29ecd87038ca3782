"""What counts as a closed surface, and what the others are told."""

import numpy as np
import pytest
import trimesh

from tacdata.errors import FormatError, UsageError
from tacdata.surfaces.closed import check_closed, read_closed
from tacdata.surfaces.crossings import crossing_faces
from tacdata.surfaces.store import find, keep


def ball(radius=2.0, at=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    mesh.apply_translation(at)
    return mesh


@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_every_format_gives_the_same_solid(tmp_path, ending):
    path = tmp_path / f"ball.{ending}"
    ball().export(path)
    mesh = read_closed(path, 1.0, "indenter")
    assert mesh.volume == pytest.approx(ball().volume, rel=1e-5)
    assert read_closed(path, 2.0, "indenter").volume == pytest.approx(8 * ball().volume, rel=1e-5)


def test_a_hole_is_named_with_its_place():
    mesh = ball()
    mesh.update_faces(np.arange(len(mesh.faces)) != int(mesh.triangles_center[:, 2].argmax()))
    with pytest.raises(FormatError, match=r"not watertight: 3 open edges, the first near \(.*, 1\.9\d?\) mm"):
        check_closed(mesh, "ball")


def test_an_edge_of_three_triangles_is_named():
    box = trimesh.creation.box()
    fin = trimesh.Trimesh(
        np.vstack([box.vertices, [[2, 0, 0], [2, 0, 1]]]),
        np.vstack([box.faces, [[*box.faces[0, :2], 8]]]),
        process=False,
    )
    with pytest.raises(FormatError, match="not watertight"):
        check_closed(fin, "box")


def test_inside_out_is_named_with_its_volume():
    mesh = ball()
    mesh.invert()
    with pytest.raises(FormatError, match="inside out: volume -"):
        check_closed(mesh, "ball")


def test_one_flipped_triangle_is_inside_out_in_parts():
    mesh = ball()
    faces = mesh.faces.copy()
    faces[7] = faces[7][::-1]
    with pytest.raises(FormatError, match="inside out in parts"):
        check_closed(trimesh.Trimesh(mesh.vertices, faces, process=False), "ball")


def test_a_sheet_has_no_volume():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]], process=False)
    with pytest.raises(FormatError, match=r"encloses 0 mm\^3|not watertight"):
        check_closed(sheet, "sheet")


def test_two_solids_through_each_other_cross_on_their_common_circle():
    both = trimesh.util.concatenate([ball(), ball(at=(1.5, 0.0, 0.0))])
    with pytest.raises(FormatError, match=r"runs through itself: \d+ triangles cross others, the first near"):
        check_closed(both, "balls")
    pairs = crossing_faces(np.asarray(both.vertices, float), np.asarray(both.faces))
    assert both.triangles_center[pairs].mean(axis=1)[:, 0] == pytest.approx(0.75 * np.ones(len(pairs)), abs=0.4)


def test_solids_side_by_side_do_not_cross():
    check_closed(trimesh.util.concatenate([ball(), ball(at=(5.0, 0.0, 0.0))]), "balls")


@pytest.mark.parametrize("shape", [trimesh.creation.box(), trimesh.creation.capsule(), trimesh.creation.torus(2, 0.5)])
def test_sound_solids_pass(shape):
    check_closed(shape, "solid")


def test_garbage_is_refused_in_words(tmp_path):
    for name, content in (("empty.stl", b""), ("text.obj", b"hello"), ("cut.stl", b"\0" * 80 + b"\xff\xff\0\0abc")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FormatError, match=name):
            read_closed(tmp_path / name, 1.0, "indenter")
    with pytest.raises(UsageError, match="no file"):
        read_closed(tmp_path / "none.stl", 1.0, "indenter")
    with pytest.raises(UsageError, match="IGES files are not read"):
        read_closed(tmp_path / "a.IGES", 1.0, "indenter")
    with pytest.raises(UsageError, match=r"ending in \.stl, \.obj, \.ply, \.step"):
        read_closed(tmp_path / "a.png", 1.0, "indenter")


def test_a_kept_file_is_found_by_content_after_it_is_gone(tmp_path, monkeypatch):
    path = tmp_path / "ball.stl"
    ball().export(path)
    digest = keep(path)
    path.unlink()
    assert find("any_name.stl", digest, "indenter").is_file()
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "another_machine"))
    with pytest.raises(UsageError, match="not on this machine") as failure:
        find("ball.stl", digest, "indenter")
    assert "TACDATA_SHAPES" in failure.value.remedy
    ball().export(path)
    monkeypatch.setenv("TACDATA_SHAPES", str(tmp_path))
    assert find("ball.stl", digest, "indenter").is_file()


def test_a_changed_file_is_not_taken_for_the_one_that_was_used(tmp_path, monkeypatch):
    path = tmp_path / "ball.stl"
    ball().export(path)
    digest = keep(path)
    ball(2.1).export(path)
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "another_machine"))
    monkeypatch.setenv("TACDATA_SHAPES", str(tmp_path))
    with pytest.raises(FormatError, match="not the file that was used"):
        find("ball.stl", digest, "indenter")
