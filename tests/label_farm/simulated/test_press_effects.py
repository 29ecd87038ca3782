"""Effects that a verdict named are laid over simulated readings; labels stay, and what has no meaning is refused."""

import numpy as np
import pytest
import yaml
from bump_skin import SMALL, BumpSkin
from running.in_process import tacdata

from tacdata import documents, schemas
from tacdata.dataset import read_dataset
from tacdata.dataset.format import features
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.simulated import press_effects, solving
from tacdata.label_farm.simulated.plan import SimulationPlan
from tacdata.label_farm.simulated.press_effects import drawn_effects, effects_of, specimen_effects
from tacdata.sensor import Sensor, default_sensor

SENSOR = default_sensor()
STILL = {**SMALL, "noise": {"readings": 0.0, "drift": 0.0, "quantum": 0.0}}
FRAME = 1 / SENSOR.taxels.rate
RELAXATION = {"effect": "relaxation", "values": {"f": 0.4, "tau": 0.05}}


def simulate(folder, out, plan, *more):
    """Simulate two presses, on the solved presses that the folder has, and return the dataset."""
    (folder / f"{out}.yaml").write_text(yaml.safe_dump(plan))
    words = ("simulate", f"{out}.yaml", "--out", out, "--solved", "solved", "--presses", 2, "--device", "cpu")
    done = tacdata(*words, "--workers", 1, *more, folder=folder)
    assert done.returncode == 0, done.stderr
    return read_dataset(folder / out)


def with_effects(*effects):
    return {**STILL, "effects": list(effects)}


def drawn(*effects, plan=STILL):
    return drawn_effects(SimulationPlan.from_document({**plan, "effects": list(effects)}, "plan"))


def verdict(*effects, status="named"):
    """A verdict with these entries; everything else is empty."""
    return {
        "version": schemas.version("verdict"),
        "status": status,
        "why": "",
        "effects": list(effects),
        "gate": {"gap": True, "p": 0.0, "p_generic": 0.0, "noise": [1.0], "memory": 0.0},
        "left": {"share": 0.0, "t": 0.0, "before": 2.0, "after": 1.0, "floor": 1.0},
        "located": [],
        "unjudgeable": {},
        "limits": {},
        "untested": [],
        "data": {},
        "remarks": [],
        "next": [],
        "provenance": {},
    }


def entry(effect="creep", status="named"):
    return {
        "mechanism": effect,
        "effect": effect,
        "title": "",
        "stage": "mechanics",
        "moves": ["signal"],
        "status": status,
        "alternatives": [],
        "margins": {},
        "necessity": 9.0,
        "at_bound": [],
        "experiment": "",
        "parameters": {
            "f": {"value": 0.1, "unit": "1", "error": 0.1, "interval": [-0.06, 0.26]},
            "tau": {"value": 2.0, "unit": "s", "error": None},
        },
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of two solved presses; the dataset `plain` has no effect."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            solving, "specimen_model", lambda simulation, number, device: BumpSkin(simulation.specimens[number])
        )
        made = tmp_path_factory.mktemp("effects")
        simulate(made, "plain", STILL)
    return made


def frames(dataset, key, number=0):
    span = dataset.episodes[number]
    return np.asarray(dataset[key][span.start : span.stop], dtype=float)


def test_a_delay_of_two_frames_moves_readings_by_two_frames_and_leaves_labels(folder):
    plain = read_dataset(folder / "plain")
    late = simulate(folder, "late", with_effects({"effect": "latency", "values": {"L": 2 * FRAME}}))
    before, after = frames(plain, features.RAW), frames(late, features.RAW)
    assert np.ptp(before, axis=0).max() > 50
    assert np.allclose(after[2:], before[:-2], atol=1e-2)
    for key in (features.DEPTH, features.TAXEL_FORCE, features.TIP):
        assert np.array_equal(late[key], plain[key])


def test_relaxation_takes_its_share_of_the_rise_by_the_end_of_the_hold(folder):
    plain, relaxed = read_dataset(folder / "plain"), simulate(folder, "relaxed", with_effects(RELAXATION))
    assert relaxed.episodes[0].record.simulated["effects"] == [
        {"effect": "relaxation", "values": {"f": 0.4, "tau": 0.05}}
    ]
    before, after = frames(plain, features.RAW), frames(relaxed, features.RAW)
    depth = frames(plain, features.TIP)[:, 2]
    end = np.flatnonzero(depth == depth.max())[-1]
    taxel = int(np.ptp(before, axis=0).argmax())
    kept = (after[end, taxel] - after[0, taxel]) / (before[end, taxel] - before[0, taxel])
    # 60 % of the force; the layer yields less than in proportion, so a little more of the reading.
    assert 0.58 < kept < 0.64


def test_effects_of_a_range_are_drawn_once_for_each_specimen():
    plan = SimulationPlan.from_document(
        with_effects(
            {"effect": "gain", "values": {"e": [0.1, 0.3]}}, {"effect": "channel_gain", "values": {"e": [-0.05, 0.05]}}
        ),
        "plan",
    )
    found = [specimen_effects(plan, SENSOR, 3, number) for number in (0, 1, 0)]
    common = [float(effects[0].values["e"]) for effects in found]
    assert common[0] == common[2] != common[1]
    assert all(0.1 <= value <= 0.3 for value in common)
    own = found[0][1].values["e"]
    assert own.shape == (24,)
    assert len(set(own.tolist())) == 24
    assert np.abs(own).max() <= 0.05


def test_a_verdict_gives_its_named_effects_with_their_intervals_within_bounds(tmp_path):
    path = tmp_path / "verdict.json"
    documents.write(path, verdict(entry(), entry("hysteresis", "suspected")), "verdict")
    assert effects_of(path) == [{"effect": "creep", "values": {"f": [0.0, 0.26], "tau": 2.0}}]


def test_a_revised_model_gives_its_effects(tmp_path):
    path, spec = (
        tmp_path / "spec.json",
        {
            "version": schemas.version("model_spec"),
            "name": "revised",
            "parent": None,
            "response": {"kind": "fitted"},
            "effects": [{**RELAXATION, "stage": "mechanics", "error": {}, "evidence": ""}],
        },
    )
    documents.write(path, spec, "model_spec")
    assert effects_of(path) == [RELAXATION]


def test_the_verb_lays_a_verdicts_effects_beside_the_plans_own(folder):
    documents.write(folder / "verdict.json", verdict(entry()), "verdict")
    both = simulate(folder, "both", with_effects(RELAXATION), "--effects", "verdict.json")
    assert [one["effect"] for one in both.episodes[0].record.simulated["effects"]] == ["relaxation", "creep"]


@pytest.mark.parametrize(
    ("effect", "values", "words"),
    [
        ("z_offset", {"dz": 0.05}, "pressed where its label says"),
        ("thickness", {"e": 0.05}, "has its specimen's shape"),
        ("view_scale", {"s": 0.01}, "changes no reading"),
        ("wear_in", {"a": 0.05}, "stands alone"),
        ("warm_up_drift", {"a": 0.05}, "stands alone"),
        ("temperature_offset", {"k": 0.05}, "have no temperature"),
        ("creep", {"share": 0.1}, "creep with share"),
        ("creep", {"f": 1.5}, "f = 1.5"),
        ("creep", {"f": [0.2, 0.1]}, "f = [0.2, 0.1]"),
    ],
)
def test_effects_without_meaning_for_a_simulated_press_are_refused(effect, values, words):
    with pytest.raises(FormatError, match="plan small") as refused:
        drawn({"effect": effect, "values": values})
    assert words in refused.value.given


def test_an_effect_given_twice_is_refused():
    with pytest.raises(UsageError, match="relaxation given twice"):
        drawn(RELAXATION, RELAXATION)


def test_numbers_for_other_channels_are_refused():
    [one] = drawn({"effect": "channel_gain", "values": {"e": [0.1, 0.2, 0.1]}})
    with pytest.raises(FormatError, match="for 3 channels"):
        one.placed(np.random.default_rng(0), 24)


def test_effects_on_forces_are_refused_where_a_board_reads_more_than_forces():
    document = SENSOR.document
    document["transduction"] = {"principle": "gap_closing", "gain": 4000.0, "offset": 9000.0}
    plan = SimulationPlan.from_document(with_effects(RELAXATION), "plan")
    with pytest.raises(FormatError, match="gap_closing, which reads more"):
        specimen_effects(plan, Sensor.from_document(document, "other"), 0, 0)
    assert press_effects.specimen_effects(plan, SENSOR, 0, 0)


def test_a_verdict_that_names_nothing_is_refused(tmp_path):
    documents.write(tmp_path / "verdict.json", verdict(entry(status="suspected"), status="unknown"), "verdict")
    with pytest.raises(FormatError, match="names no effect"):
        effects_of(tmp_path / "verdict.json")
