"""`import tacdata as td`: one page of names, loaded when they are used."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tacdata as td
from tacdata.example.shipped import SESSION

HEAVY = ("numpy", "scipy", "matplotlib", "torch", "warp", "rerun", "lerobot", "cv2", "pyarrow", "jsonschema")
RECORDING = SESSION / "episode-000001.mcap"


def python(text):
    """Run a program in a process of its own; return what it prints."""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_importing_and_listing_load_nothing_heavy():
    program = f"import sys, tacdata as td; dir(td); print([m for m in {HEAVY} if m in sys.modules])"
    assert python(program) == "[]"


def test_a_checker_of_types_sees_the_names_that_are_loaded():
    tree = ast.parse(Path(td.__file__).read_text())
    [block] = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {}
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            seen |= {alias.asname or alias.name: (node.module, alias.name) for alias in node.names}
    assert seen == td._NAMES


@pytest.mark.parametrize("name", td.__all__)
def test_every_name_loads_and_is_explained(name):
    value = getattr(td, name)
    assert name == "__version__" or value.__doc__
    assert name in dir(td)


def test_the_page_names_every_name():
    assert not [name for name in td.__all__ if name not in td.__doc__ and name != "__version__"]


def test_a_name_that_is_none_of_them_is_refused():
    with pytest.raises(AttributeError, match="no attribute 'read_sesion'"):
        _ = td.read_sesion


def test_five_lines_from_a_session_to_a_prediction(tmp_path):
    session = td.example_session(tmp_path / "first look")
    episode = session[1]
    network = td.read_network("shipped")
    prediction = network.predict(episode)
    assert np.abs(prediction.depth - episode.label.depth)[episode.depth > 0.9].mean() < 0.1


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return td.pack(SESSION, tmp_path_factory.mktemp("door") / "dataset").dataset


@pytest.fixture(scope="module")
def nouns(dataset):
    episode = td.read_episode(RECORDING)
    network = td.read_network("shipped")
    return {
        "session": td.read_session(SESSION),
        "episode": episode,
        "label": episode.label,
        "dataset": dataset,
        "network": network,
        "prediction": network.predict(episode),
        "sensor": td.read_sensor("tacprint"),
        "plan": td.read_session(SESSION).plan,
    }


@pytest.mark.parametrize("name", ["session", "episode", "label", "dataset", "network", "prediction", "sensor", "plan"])
def test_a_noun_describes_and_draws_itself(name, nouns, tmp_path):
    noun = nouns[name]
    text = repr(noun)
    assert name.capitalize() in text.splitlines()[0]
    assert len(text.splitlines()) <= 6
    assert len(text) < 700
    page = noun._repr_html_()
    assert page.startswith("<pre>")
    if name != "network":
        assert "data:image/png;base64," in page
        noun.plot(tmp_path / "picture.png")
        with pytest.raises(td.UsageError, match="exists"):
            noun.plot(tmp_path / "picture.png")


def test_an_object_serves_as_its_path(nouns, tmp_path):
    session, network, episode = nouns["session"], nouns["network"], nouns["episode"]
    assert len(td.pack(session, tmp_path / "packed").dataset) == len(nouns["dataset"])
    assert td.open(nouns["dataset"]).content_hash == nouns["dataset"].content_hash
    assert np.array_equal(network.predict(RECORDING).depth, network.predict(episode).depth)
    assert td.read_network(network).path == network.path
    assert td.check(session).usable


def test_results_describe_themselves_in_a_few_lines(nouns, tmp_path):
    report, windows = repr(td.check(SESSION)), repr(nouns["dataset"].windows())
    packed = td.pack(SESSION, tmp_path / "dataset")
    assert repr(packed) == f"Packed: 2 episodes, 490 frames in {packed.root}"
    assert len(td.read_dataset(packed)) == 490
    assert report.splitlines()[0].endswith("2 recordings, usable")
    assert windows == "Windows of 490 frames: 9 of observation.state"
    assert len(report.splitlines()) <= 6


def test_an_episode_gives_its_arrays(nouns):
    episode, label = nouns["episode"], nouns["label"]
    assert episode.readings.shape == episode.tared.shape == (len(episode.times), 24)
    assert np.allclose(episode.tared, episode.readings - episode.baseline)
    assert episode.times[0] == 0
    assert episode.depth.max() == pytest.approx(episode.press.depth, abs=0.01)
    assert label.deepest.max() == pytest.approx(label.depth.max())


def test_an_episode_becomes_a_table(nouns):
    table = nouns["episode"].to_pandas()
    assert list(table.columns[:5]) == ["time_s", "phase", "x", "y", "depth"]
    assert table["taxel_3"].to_numpy() == pytest.approx(nouns["episode"].readings[:, 3])


def test_a_session_gives_its_episodes(nouns):
    session = nouns["session"]
    assert [episode.number for episode in session] == [0, 1]
    assert len(session) == 2
    with pytest.raises(td.UsageError, match="no episode 7"):
        _ = session[7]


def test_a_dataset_gives_windows_for_torch(dataset):
    assert tuple(dataset.windows()[50]["observation.state"].shape) == (9, 24)


@pytest.mark.parametrize("kind", [str, Path])
def test_readers_take_text_and_paths(kind, dataset):
    from tacdata.discrepancy.data.recordings import course_of

    assert td.read_session(kind(SESSION)).episodes
    assert td.read_episode(kind(RECORDING)).number == 1
    assert td.read_label(kind(SESSION / "labels" / "episode-000001.parquet")).episode == 1
    assert td.read_dataset(kind(dataset.root)).episodes
    assert td.read_sensor(kind(Path(td.__file__).parent / "sensor" / "tacprint.yaml")).name == "tacprint"
    assert np.array_equal(course_of(kind(SESSION)).readings, course_of([kind(SESSION)]).readings, equal_nan=True)
    assert td.check(kind(SESSION)).usable


@pytest.mark.parametrize(
    ("path", "kind"),
    [(SESSION, "Session"), (RECORDING, "Episode"), (SESSION / "labels" / "episode-000000.parquet", "Label")],
)
def test_open_finds_what_a_path_holds(path, kind):
    assert isinstance(td.open(str(path)), getattr(td, kind))


def test_open_refuses_what_it_does_not_know(tmp_path):
    with pytest.raises(td.UsageError, match="no file or folder"):
        td.open(tmp_path / "nothing")
    with pytest.raises(td.UsageError, match="no session, dataset"):
        td.open(tmp_path)


def test_a_press_has_sensible_defaults():
    press = td.Press(td.indenter("sphere", radius=4.0), depth=0.8)
    assert str(press) == "sphere (radius 4) at x 0, y 0 mm, 0.8 mm deep"
    with pytest.raises(td.FormatError, match="radius"):
        td.indenter("sphere")
