import re
from dataclasses import replace

import numpy as np
import pytest

from tacdata.errors import FormatError
from tacdata.recording.episode import CncStream, TaxelStream
from tacdata.viewers.pictures.backend import PictureBackend, page
from tacdata.viewers.rerun.backend import RerunBackend
from tacdata.viewers.scenes.episode import episode_scene

DEEPEST = 1.2


@pytest.fixture(scope="module")
def scene(episode, label, prediction, images):
    return episode_scene(episode, label, prediction, images)


def curve(scene, name):
    return next(c for c in scene.curves if c.name == name)


def test_every_part_has_the_rows_it_should(scene):
    maps = {part.name: len(part.time_ns) for part in scene.maps}
    assert (maps["label"], maps["prediction"], maps["error"]) == (120, 118, 118)
    assert {part.name: len(part.time_ns) for part in scene.surfaces}["label"] == 120
    assert {part.name: len(part.time_ns) for part in scene.bodies} == {"indenter": 120}
    assert [(camera.name, len(camera.image_ns), len(camera.cube_ns)) for camera in scene.cameras] == [("top", 30, 30)]
    assert [phase.name for phase in scene.phases] == ["rest", "approach", "press", "hold", "release"]


def test_the_signal_is_zero_at_rest_and_strongest_under_the_tip(scene):
    change = curve(scene, "taxels/change")
    assert np.abs(np.median(change.values[:30], axis=0)).max() < 3
    strongest = np.unravel_index(scene.taxels.grid[75].argmax(), (4, 6))
    assert strongest == (1, 3)  # the taxel at x = 0.95, y = -1.25, next to the tip at (1, -0.5)


def test_without_a_rest_phase_the_first_frames_are_the_reference(episode):
    scene = episode_scene(replace(episode, phases=episode.phases[1:]))
    assert np.abs(curve(scene, "taxels/change").values[:10]).max() < 20


def test_the_reported_tip_is_brought_into_the_sensors_frame(scene, episode):
    reported = curve(scene, "tip/reported")
    assert np.allclose(reported.values, episode.tip_at(reported.time_ns), atol=1e-9)


def test_the_error_is_predicted_minus_labelled_at_equal_times(scene, label, prediction):
    error = scene.map_named("error")
    assert (error.time_ns == label.time_ns[2:]).all()
    assert np.allclose(error.values[70], prediction.depth[70] - label.depth[72], atol=1e-6)
    values = curve(scene, "error").values
    assert values[70, 0] == pytest.approx(np.sqrt(np.mean((prediction.depth[70] - label.depth[72]) ** 2)), rel=1e-5)
    assert (values[:, 1] >= values[:, 0]).all()


def test_label_and_prediction_share_a_scale_that_covers_both(scene, label, prediction):
    scales = {m.name: m.scale for m in scene.maps}
    assert scales["label"] == scales["prediction"]
    assert scales["label"].high >= max(label.depth.max(), prediction.depth.max())
    assert scales["error"].low == -scales["error"].high


def test_pressure_and_shear_are_drawn_where_the_label_knows_them(episode, label, prediction):
    traction = np.zeros((len(label.time_ns), 3, *label.signed.shape[1:]), np.float16)
    traction[:, 2], traction[:, 0], traction[:, 1] = 0.04, 0.003, -0.004
    drawn = episode_scene(episode, replace(label, traction=traction), prediction)
    assert [m.name for m in drawn.maps] == ["label", "prediction", "error", "pressure", "shear"]
    pressure, shear = drawn.maps[3:]
    assert pressure.scale.unit == shear.scale.unit == "kPa"
    assert pressure.values[5] == pytest.approx(40.0, rel=1e-3) and shear.values[5] == pytest.approx(5.0, rel=2e-3)
    assert (pressure.time_ns == label.time_ns).all()
    assert page(drawn).axes


def test_the_pressure_of_each_protrusion_is_drawn_where_it_stands(episode, label):
    pressure = np.zeros((len(label.time_ns), 24, 10, 10), np.float16)
    pressure[:, 7, 2:8, 2:8] = 0.02
    pressure[9, 16, 5, 5] = 0.1
    drawn = episode_scene(episode, replace(label, taxel_pressure=pressure))
    board = drawn.map_named("board")
    assert board.scale.unit == "kPa" and board.scale.high >= 100 and (board.time_ns == label.time_ns).all()
    pitch, (x, y) = 0.7 / 4, episode.sensor.taxels.centers[7]
    assert np.diff(board.x) == pytest.approx(pitch) and np.diff(board.y) == pytest.approx(pitch)
    there = (np.abs(board.x - x) < 3.6 * pitch)[:, None] & (np.abs(board.y - y) < 3.6 * pitch)
    assert (board.values[5] > 0).sum() == 36 and not board.values[5][~there].any()
    assert board.values[5].max() == pytest.approx(20.0, rel=1e-3)
    [(i, j)] = np.argwhere(board.values[9] > 50)
    aside = np.array([board.x[i], board.y[j]]) - episode.sensor.taxels.centers[16]
    assert aside == pytest.approx(pitch / 2, abs=pitch / 2)
    titled = {axes.get_title(): axes for axes in page(drawn).axes}
    wide = titled["Label"].get_xlim(), titled["Protrusions on the board"].get_xlim()
    assert np.ravel(wide) == pytest.approx([-7.0, 7.0] * 2), "the smaller map leaves the shared axes as they were"


def test_the_skin_is_the_face_minus_the_signed_map(scene, episode, label):
    surface = scene.surfaces[0]
    thickness = episode.sensor.skin.thickness
    assert np.allclose(surface.height, thickness - label.signed, atol=1e-6)
    assert surface.height.max() > thickness, "bulging stands above the undeformed face"
    vertices = surface.vertices[75].reshape(35, 26, 3)
    assert np.allclose(vertices[:, 0, 0], episode.sensor.map.x)
    assert np.allclose(vertices[0, :, 1], episode.sensor.map.y)


def test_the_triangles_cover_the_map_once_and_look_outwards(scene):
    surface = scene.surfaces[0]
    a, b, c = (surface.vertices[0][surface.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0).all()
    assert 0.5 * normal[:, 2].sum() == pytest.approx(34 * 0.4 * 25 * 0.4, rel=1e-4)


def test_the_indenter_touches_the_skin_where_the_tip_is(scene, episode):
    body = scene.bodies[0]
    lowest = body.vertices[:, 2].min() + body.position[75, 2]
    assert lowest == pytest.approx(episode.sensor.skin.thickness - DEEPEST, abs=1e-9)
    assert body.position[75, :2] == pytest.approx([1.0, -0.5])


def test_pixels_of_the_picture_are_where_the_map_has_them(scene):
    maps = scene.map_named("label")
    i, j = 20, 3
    across, down = maps.pixels(np.array([[maps.x[i], maps.y[j]]]))[0]
    assert (across, down) == pytest.approx((i + 0.5, 26 - j - 0.5))
    assert maps.pictures[75][int(down), int(across)] == maps.values[75, i, j]


def test_the_cube_is_in_millimetres_and_absent_where_no_tag_was_seen(scene):
    camera = scene.cameras[0]
    assert np.nanmax(camera.cube_position[:, 2]) == pytest.approx(200)
    assert np.isnan(camera.cube_position[5:8]).all()
    assert camera.matrix[0, 0] == 400
    assert (np.diff(camera.image_ns) > 0).all()


def test_both_clocks_name_the_same_frame(scene, episode):
    times = episode.taxels.sample_ns
    assert (scene.frame_at(times) == episode.taxels.counter).all()
    assert scene.frame_at(np.array([times[10] + 1, times[0] - 5, times[-1] + 10**9])).tolist() == [510, 500, 619]


def test_what_is_missing_is_said_and_the_rest_is_shown(episode):
    scene = episode_scene(replace(episode, tags=(), phases=(), tip_ns=episode.tip_ns[:0], tip=episode.tip[:0]))
    assert scene.maps == () and scene.bodies == () and scene.tip is None
    assert [s.name for s in scene.surfaces] == ["undeformed"]
    assert (scene.surfaces[0].height == np.float32(3.3)).all()
    assert (np.ptp(scene.surfaces[0].colors, axis=-1) == 0).all(), "grey, not the colour of zero depth"
    for words in ("no label", "no commanded path", "no phase is marked", "camera top has no image"):
        assert words in scene.summary


def test_the_summary_names_press_and_checkpoint(scene):
    for words in ("sphere (radius 4", "depth 1.2 mm", "abababababab", "test part", "a made-up press"):
        assert words in scene.summary


def test_the_summary_states_peak_and_centroid_of_the_deepest_frame_and_of_the_press(scene):
    # The made prediction is 0.9 of the label, moved by (0.4, 0.2) mm.
    [line] = [line for line in scene.summary.splitlines() if "**Error**" in line]
    numbers = [float(number) for number in re.findall(r"[-+]?\d+\.\d+", line)]
    predicted, labelled, peak, centroid, median_peak, contact_rmse = numbers
    assert (predicted, labelled) == pytest.approx((1.08, 1.2), abs=0.02)
    assert peak == pytest.approx(predicted - labelled, abs=0.011)
    assert centroid == pytest.approx(np.hypot(0.4, 0.2), abs=0.12)
    assert 0.02 < median_peak <= abs(peak) + 0.01 and contact_rmse > median_peak / 2
    page_texts = [text.get_text() for axes in page(scene).axes for text in axes.texts]
    assert any(text.startswith("peak -0.1") and "centroid" in text for text in page_texts)


def test_a_missed_contact_has_a_peak_error_and_no_centroid(episode, label, prediction):
    flat = replace(prediction, depth=np.zeros_like(prediction.depth))
    summary, deepest = episode_scene(episode, label, flat).summary, label.depth.max()
    assert f"0.00 mm predicted, {deepest:.2f} mm labelled (peak {-deepest:.2f} mm)" in summary


def test_lost_frames_are_counted(episode):
    counter = episode.taxels.counter + np.where(np.arange(120) > 50, 3, 0)
    taxels = replace(episode.taxels, counter=counter)
    assert "3 lost" in episode_scene(replace(episode, taxels=taxels)).summary


def test_an_empty_recording_is_refused_in_words(episode):
    empty = np.zeros(0, dtype=np.int64)
    taxels = TaxelStream(empty, empty, empty, np.zeros((0, 24)))
    cnc = CncStream(empty, empty, np.zeros((0, 3)), ())
    with pytest.raises(FormatError, match="not one taxel frame"):
        episode_scene(replace(episode, taxels=taxels, cnc=cnc, tip_ns=empty, tip=np.zeros((0, 3)), tags=()))


def test_without_taxels_the_rest_is_shown(episode, images, tmp_path):
    empty = np.zeros(0, dtype=np.int64)
    silent = replace(episode, taxels=TaxelStream(empty, empty, empty, np.zeros((0, 24))))
    scene = episode_scene(silent, images=images)
    assert "not one taxel frame" in scene.summary
    assert len(scene.cameras[0].images) == 30 and scene.bodies[0].position[:, 2].min() == pytest.approx(2.1, abs=0.01)
    RerunBackend(tmp_path / "silent.rrd").draw(scene)
    PictureBackend(tmp_path / "silent.png", resolution=20).draw(scene)


def test_maps_of_another_sensor_are_refused(episode, label):
    with pytest.raises(FormatError, match="label of episode-000003"):
        episode_scene(episode, replace(label, signed=label.signed[:, :30]))


def test_a_prediction_for_other_frames_gives_no_error_map(episode, label, prediction):
    scene = episode_scene(episode, label, replace(prediction, time_ns=prediction.time_ns + 10**9 + 7))
    assert scene.map_named("error") is None
    assert "share no frame" in scene.summary
