"""A simulated dataset: drawn by seed and number, solved once, read by the transduction, marked as simulated."""

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from bump_skin import SMALL, BumpSkin
from farm_examples import HERE
from running.in_process import tacdata

from tacdata.dataset import pack, read_dataset
from tacdata.dataset.format import features
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm import environment
from tacdata.label_farm.simulated import solving
from tacdata.label_farm.simulated.plan import DEFAULT, SimulationPlan, read_simulation_plan
from tacdata.label_farm.simulated.press_draw import draw_press
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.specimen import draw_specimen
from tacdata.recording.episode import PHASES
from tacdata.sensor import default_sensor
from tacdata.transduction import Loads, Transducer

SENSOR = default_sensor()
NOISY = {**SMALL, "noise": {"readings": 4.0, "drift": 2.0}}


def simulate(folder, *more, presses=3, plan=SMALL):
    """Type the verb in a folder and return what it printed."""
    (folder / "plan.yaml").write_text(yaml.safe_dump(plan))
    words = "simulate", "plan.yaml", "--out", "sim", "--presses", presses, "--device", "cpu", "--workers", 1
    done = tacdata(*words, *more, folder=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


def recorded():
    """A recording and its label."""
    sys.path.append(str(HERE.parent / "dataset"))
    from press_example import episode, label

    return episode(), label(episode())


@pytest.fixture
def bumps(monkeypatch):
    """Let the verb solve without finite elements."""
    monkeypatch.setattr(
        solving, "specimen_model", lambda simulation, number, device: BumpSkin(simulation.specimens[number])
    )


@pytest.fixture(
    scope="module",
    params=[
        "bumps",
        pytest.param(
            "skin", marks=pytest.mark.long("label_farm", "tacdata/skin", reason="skins solved by two processes")
        ),
    ],
)
def made(request, tmp_path_factory):
    """A dataset of three presses on two specimens; its labels' counts are carried along."""
    folder, workers = tmp_path_factory.mktemp("simulated"), {"bumps": 1, "skin": 2}[request.param]
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "bumps":
            bump = lambda simulation, number, device: BumpSkin(simulation.specimens[number], 99.0, 1.0)  # noqa: E731
            patch.setattr(solving, "specimen_model", bump)
        said = simulate(folder, "--column", "taxel_counts", "--workers", workers)
    assert "presses solved: 3, given up: 0" in said
    return folder


def columns(root):
    dataset = read_dataset(root)
    return {key: np.array(values) for key, values in dataset.columns.items()}


def test_readings_are_what_the_specimens_transduction_makes_of_its_taxel_forces(made):
    dataset = read_dataset(made / "sim")
    simulation = Simulation.read(Path(f"{made / 'sim'}.solved"))
    for episode in dataset.episodes:
        frames = slice(episode.start, episode.stop)
        force = dataset[features.TAXEL_FORCE][frames].astype(float)
        # The default sensor's layer yields to the force alone.
        said = Transducer.of(simulation.specimen(episode.index)).read(Loads(force, 0 * force, 0 * force)).counts
        assert np.abs(dataset[features.RAW][frames] - said).max() <= 0.5 + 1e-3
        assert np.ptp(said, axis=0).max() > 50


def test_an_episode_rests_presses_holds_and_lets_go_at_the_boards_rate(made):
    dataset = read_dataset(made / "sim")
    for episode in dataset.episodes:
        frames = slice(episode.start, episode.stop)
        phase, depth = dataset[features.PHASE][frames], dataset[features.TIP][frames, 2]
        assert [PHASES[k] for k in dict.fromkeys(phase[phase >= 0].tolist())] == list(PHASES)
        assert depth[phase == PHASES.index("hold")] == pytest.approx(episode.press.depth)
        assert np.diff(dataset[features.TIME][frames]) == pytest.approx(1e9 / SENSOR.taxels.rate, abs=2)
        pressed = np.array(dataset[features.DEPTH][frames]).max(axis=(1, 2))
        assert pressed.max() == pytest.approx(episode.press.depth, abs=0.05)
        assert pressed[depth <= 0].max() == 0


def test_every_episode_says_that_it_is_simulated(made):
    for episode in read_dataset(made / "sim").episodes:
        drawn = episode.record.simulated
        assert (drawn["plan"], drawn["seed"], drawn["press"]) == ("small", 0, episode.index)
        assert drawn["specimen"]["thickness"] != SENSOR.skin.thickness


def test_the_data_card_says_first_that_nobody_recorded_it(made):
    words = tacdata("card", "sim", folder=made).stdout
    assert words.splitlines()[4].startswith("**Simulated.** Nobody recorded this dataset")
    assert "drawn from plan small, seed 0 (3)" in words
    assert "recorded on" not in words
    assert "note: 3 simulated presses, nobody recorded them" in tacdata("browse", "sim", folder=made).stdout


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        (("protocols", "sim"), "3 of 3 episodes are simulated, nobody measured them"),
        (("report", "run", "--out", "page.html", "--trials", "sim"), "nobody measured them"),
        (("discrepancy", "sim", "--out", "verdict"), "simulated presses have none"),
        (("check", "sim.solved"), "nobody recorded them"),
        (("compare", "sim", *["--predictions", "run"] * 2, "--picture", "a.png"), "nobody measured them"),
        (("dataset", "merge", "sim", "measured", "--out", "both"), "robot_type"),
    ],
)
def test_it_is_refused_where_measured_data_is_meant(made, verb, words):
    if not (made / "measured").exists():
        measured, label = recorded()
        pack([measured], lambda episode: label, made / "measured")
        (made / "run").mkdir()
    done = tacdata(*verb, folder=made)
    assert done.returncode != 0
    assert words in done.stderr


def test_recordings_are_not_packed_into_it(made):
    measured, label = recorded()
    label = replace(label, taxel_counts=np.zeros_like(label.taxel_force))
    with pytest.raises(UsageError, match="holds simulated presses, episode-000000"):
        pack([measured], lambda episode: label, made / "sim", append=True, extra=["tacdata.taxel_counts"])


def test_more_presses_go_on_where_the_others_end(bumps, tmp_path):
    simulate(tmp_path, presses=5)
    before = columns(tmp_path / "sim")
    assert "presses solved: 4," in simulate(tmp_path, presses=9)
    after = columns(tmp_path / "sim")
    assert len(np.unique(after["episode_index"])) == 9
    for key, values in before.items():
        assert np.array_equal(after[key][: len(values)], values), key


@pytest.mark.parametrize("left", [0, 1, 4])
def test_a_run_that_was_cut_solves_nothing_twice_and_gives_the_same_bytes(bumps, tmp_path, left, monkeypatch):
    monkeypatch.setitem(solving._IN_A_FILE, "cpu", 2)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    for folder in (whole, cut):
        folder.mkdir()
        simulate(folder, plan=NOISY, presses=9)
    shards = sorted(Path(cut / "sim.solved").glob("presses-*.npz"))
    for lost in shards[left:]:
        lost.unlink()
    kept = {file: file.stat().st_mtime_ns for file in shards[:left]}
    shutil.rmtree(cut / "sim")
    simulate(cut, plan=NOISY, presses=9)
    assert all(file.stat().st_mtime_ns == time for file, time in kept.items())
    assert sorted(Path(cut / "sim.solved").glob("*.npz")) == shards
    for file in sorted(Path(whole / "sim" / "data").rglob("*.parquet")):
        assert pq.read_table(file).equals(pq.read_table(cut / file.relative_to(whole))), file


def test_a_dataset_that_was_cut_is_finished(bumps, tmp_path):
    """Written up to an episode, the others are appended, as if nothing had happened."""
    simulate(tmp_path, presses=4)
    simulate(tmp_path, "--solved", "sim.solved", presses=6)
    first = columns(tmp_path / "sim")
    shutil.rmtree(tmp_path / "sim")
    assert "solved:" not in simulate(tmp_path, presses=6)
    second = columns(tmp_path / "sim")
    assert all(np.array_equal(first[key], second[key]) for key in first)


def test_presses_without_an_equilibrium_are_counted_and_left_out(bumps, tmp_path):
    plan = {**SMALL, "shapes": {"ball": {"shape": "sphere", "radius": [2.0, 4.5]}}}
    words = simulate(tmp_path, presses=12, plan=plan)
    given_up = int(re.search(r"given up: (\d+)", words)[1])
    assert 0 < given_up < 12
    assert f"given up {given_up} times: no equilibrium at state 3" in words
    assert len(read_dataset(tmp_path / "sim").episodes) == 12 - given_up


def test_presses_whose_skin_lies_above_the_shape_are_left_out_and_said(bumps, tmp_path, monkeypatch):
    """An older release took a thin shape that the skin had swallowed for an equilibrium."""
    monkeypatch.setattr(BumpSkin, "swallows", True)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(SMALL))
    words = ["simulate", "plan.yaml", "--out", "sim", "--device", "cpu", "--workers", 1]
    done = tacdata(*words, "--presses", 5, folder=tmp_path)
    assert done.returncode == 5
    assert "none of 5 presses is left: the skin lies above the sphere from 0." in done.stderr
    monkeypatch.setattr(BumpSkin, "swallows", False)
    done = tacdata(*words, "--presses", 7, folder=tmp_path)
    assert "left out: 5 solved presses; the skin lies above the sphere from 0." in done.stdout
    assert len(read_dataset(tmp_path / "sim").episodes) == 2


def test_presses_are_solved_without_the_recorders_and_the_learners_packages(tmp_path):
    """As on a rented computer with a GPU that has torch, Warp and little else."""
    words = ["simulate", "--presses", "2", "--solved", "presses", "--device", "cpu", "--workers", "1"]
    computer = Path(__file__).with_name("bare_computer.py")
    done = subprocess.run([sys.executable, str(computer), *words], cwd=tmp_path, capture_output=True, text=True)
    assert "presses solved: 2" in done.stdout, done.stderr


def test_a_process_that_dies_is_named_with_its_last_words(bumps, tmp_path, monkeypatch):
    words = [sys.executable, "-c", "raise SystemExit('no memory is left')"]
    monkeypatch.setattr(environment, "python", lambda module: words)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(SMALL))
    done = tacdata("simulate", "plan.yaml", "--out", "sim", "--device", "cpu", "--workers", 2, folder=tmp_path)
    assert done.returncode != 0
    assert "no memory is left" in done.stderr
    assert "what was written is kept" in done.stderr


def test_another_model_does_not_go_on_in_a_folder(bumps, tmp_path, monkeypatch):
    simulate(tmp_path)
    monkeypatch.setattr(BumpSkin, "content_hash", "cd" * 32)
    simulate(tmp_path)  # nothing is left to solve
    done = tacdata(
        "simulate", "plan.yaml", "--out", "sim", "--presses", 5, "--device", "cpu", "--workers", 1, folder=tmp_path
    )
    assert done.returncode != 0
    assert "was solved by model abababababab, this release's is cdcdcdcdcdcd" in done.stderr


def test_noise_is_laid_over_presses_without_solving_them_again(bumps, tmp_path):
    simulate(tmp_path, "--solved", "presses")
    quiet = columns(tmp_path / "sim")
    shutil.rmtree(tmp_path / "sim")
    assert "solved:" not in simulate(tmp_path, "--solved", "presses", plan=NOISY)
    loud = columns(tmp_path / "sim")
    off = (loud[features.RAW] - quiet[features.RAW])[quiet[features.PHASE] == PHASES.index("rest")]
    assert 2.0 < off.std() < 6.0
    assert np.array_equal(loud[features.DEPTH], quiet[features.DEPTH])


def test_another_seed_is_refused_in_a_folder_of_solved_presses(bumps, tmp_path):
    simulate(tmp_path)
    done = tacdata("simulate", "plan.yaml", "--out", "sim", "--seed", 1, "--device", "cpu", folder=tmp_path)
    assert done.returncode != 0
    assert "holds presses of another seed" in done.stderr


def test_presses_are_decided_by_seed_and_number_and_stay_on_the_skin():
    plan = read_simulation_plan(DEFAULT)
    presses = [draw_press(plan, SENSOR, 7, number) for number in range(200)]
    assert presses[17] == draw_press(plan, SENSOR, 7, 17)
    assert presses[17] != draw_press(plan, SENSOR, 8, 17)
    assert {press.indenter_name for press in presses} == {shape.name for shape in plan.shapes}
    for press in presses:
        reach = np.abs([press.x, press.y]) + press.indenter.footprint(press.depth, press.yaw)
        assert (reach <= np.array([SENSOR.skin.size_x, SENSOR.skin.size_y]) / 2 - plan.rim + 1e-3).all()


def test_specimens_vary_as_the_sensor_file_says():
    spread = SimulationPlan.from_document(SMALL, "small").specimens
    drawn = [draw_specimen(SENSOR, spread, 0, number) for number in range(60)]
    thickness = [each.skin.thickness for each in drawn]
    assert np.std(thickness) == pytest.approx(SENSOR.uncertainty["thickness"], rel=0.3)
    gains = np.array([each.transduction.gain for each in drawn]) / Transducer.of(SENSOR).gain
    assert gains.std() == pytest.approx(0.1, rel=0.2)


def _beside_ball(other):
    """A second shape that cannot be pressed: the first one must not hide it."""
    return {"shapes": {"ball": {"shape": "sphere", "radius": 2.0}, "other": other}}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"depth": [0.5, 0.3]}, "0.5 to 0.3"),
        ({"rest": 0.0}, "readings are tared"),
        ({"shapes": {"ball": {"shape": "sphere", "radius": 40.0}}, "depth": 1.0}, "no press in 200 tries"),
        ({"specimens": {"count": 1, "parameters": {"stiffness": 0.1}}}, "stiffness"),
        (_beside_ball({"shape": "sphere", "radius": [5.0, 1.0]}), "shapes/other: .*radius: 5 to 1"),
        (_beside_ball({"shape": "sphere", "radus": 2.0}), "shapes/other: .*radus"),
        (_beside_ball({"shape": "sphere", "radius": 2.0, "depth": 9.0}), "shapes/other: .*a depth of 9 mm"),
    ],
)
def test_a_plan_that_cannot_be_drawn_says_why(change, words):
    plan = {**SMALL, **change}
    with pytest.raises(FormatError, match=words):
        simulation = Simulation(Path("nowhere"), SimulationPlan.from_document(plan, "small"), SENSOR, 0)
        simulation.check()
