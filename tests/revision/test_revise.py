"""What follows a verdict: the gap is told where the numbers were not fitted; nothing is made to look better."""

import csv
import re

import numpy as np
import pytest
from revised_bench import verdict

from tacdata import documents
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.verdict.document import REVISE
from tacdata.errors import UsageError
from tacdata.revision.revise import RevisionOptions, revise


@pytest.fixture(scope="module")
def right(late, tmp_path_factory):
    """The right effect with numbers that are a little off."""
    folder = tmp_path_factory.mktemp("right")
    judged = verdict(folder / "verdict", "latency", {"L": 0.07}, session=late)
    return revise(judged, [late], read_spec(None), folder / "revision")


def test_the_right_effect_closes_the_gap_where_its_numbers_were_not_fitted(right):
    gap = right.document["gap"]
    assert gap["sealed"]["before"] > 20 and gap["sealed"]["after"] < 1.6
    assert gap["closed"] > 0.98 and gap["interval"][0] <= gap["closed"] <= gap["interval"][1]
    assert not gap["unseen"], "the verdict did not seal them, and it is said so"
    rates = [c for c in gap["elsewhere"] if "rate" in c["name"]]
    assert len(rates) == 2 and all(c["after"] < 0.1 * c["before"] for c in rates), "another rate is foretold too"
    [moved] = right.document["labels"]
    assert moved["path_most"] == pytest.approx(0.07 * 2.6, rel=0.1), "a late reading is paired with an earlier depth"
    worst = max(gap["slices"], key=lambda c: c["after"])
    assert worst["after"] < 3 and {"loading", "hold", "unloading", "channel 0"} <= {c["name"] for c in gap["slices"]}


def test_the_new_model_carries_its_evidence(right):
    document = documents.read(right.folder / "spec.json", "model_spec")
    assert document["parent"] == read_spec(None).content_hash
    [entry] = document["effects"]
    assert entry["effect"] == "latency" and entry["error"] == {"L": 0.01}
    assert right.document["verdict"] in entry["evidence"] and "recording session" in entry["evidence"]
    assert read_spec(right.folder / "spec.json").content_hash == right.document["spec"]["after"]


def test_the_card_stands_alone_and_says_what_it_rests_on(right):
    page = (right.folder / "card.html").read_text()
    assert "model after" in page and not re.search(r"(src|href)=['\"]https?:", page)
    for told in ("latency", "named", right.document["verdict"], "What would refute it", "90 % interval"):
        assert told in page
    rows = list(csv.DictReader((right.folder / "gap.csv").read_text().splitlines()))
    assert float(rows[0]["after"]) == pytest.approx(right.document["gap"]["sealed"]["after"], rel=1e-4)
    assert len((right.folder / "gap.md").read_text().splitlines()) == len(rows) + 2


def mean_square(residual):
    return np.nanmean(np.square(residual))


def test_the_curves_go_into_a_rerun_file(right, tmp_path):
    from tacdata.viewers.rerun.gap_recording import write

    # Of 80 ms 10 are left; the response itself took up nearly half of them before, as it cannot know the direction.
    assert right.shown
    for episode in right.shown:
        before, after = (mean_square(model - episode.measured) for model in (episode.before, episode.after))
        assert after < 0.25**2 * before
    write(right.shown, tmp_path / "gap.rrd", "named")
    assert (tmp_path / "gap.rrd").read_bytes()[:4] == b"RRF2" and (tmp_path / "gap.rrd").stat().st_size > 5_000


def test_a_wrong_effect_does_not_close_the_gap(late, tmp_path):
    judged = verdict(tmp_path / "verdict", "backlash", {"b": 0.02})
    wrong = revise(judged, [late], read_spec(None), tmp_path / "revision").document["gap"]
    assert wrong["closed"] < 0.9
    assert max(c["after"] for c in wrong["elsewhere"]) > 5, "another rate gives it away"


@pytest.mark.parametrize("status", ["ambiguous", "unknown"])
def test_an_undecided_verdict_adds_nothing_and_plans_presses_that_decide(loose, tmp_path, status):
    judged = verdict(tmp_path / "verdict", "backlash", {"b": 0.06}, status, ["latency"])
    made = revise(judged, [loose], read_spec(None), tmp_path / "revision")
    assert made.document["added"] == [] and made.document["spec"]["after"] is None
    assert not (made.folder / "spec.json").exists()
    rows = list(csv.DictReader((made.folder / made.document["next"]["plan"]).read_text().splitlines()))
    assert any(abs(float(r["speed_mm_s"]) - 1.3) > 0.5 or float(r["overshoot_mm"]) for r in rows), "another rate"
    assert all(float(r["speed_mm_s"]) <= 2.7 for r in rows), "no faster than the machine was seen to go"
    assert all(0 < float(r["depth_mm"]) + float(r["overshoot_mm"]) <= 1.0 for r in rows), "nowhere deeper"
    assert all("distinguishes" in r["purpose"] for r in rows) and len(made.document["next"]["presses"]) >= 1


def test_a_name_beside_a_remainder_and_a_family_are_added_and_the_readings_are_given_back(late, tmp_path):
    judged = verdict(tmp_path / "verdict", "latency", {"L": 0.08}, "named, incomplete", session=late)
    told = documents.read(judged / "verdict.json", "verdict")
    family = {**told["effects"][0], "level": "family", "family": "delay and filtering"}
    guess = {**told["effects"][0], "status": "suspected", "effect": "creep", "mechanism": "creep"}
    guess["parameters"] = {n: {"value": v, "unit": "u", "error": None} for n, v in (("f", 0.1), ("tau", 1.0))}
    documents.write(judged / "verdict.json", told | {"effects": [family, guess]}, "verdict")
    made = revise(judged, [late], read_spec(None), tmp_path / "revision", RevisionOptions(corrected=True))
    assert made.document["added"] == ["latency"] and made.document["suspected"] == ["creep"]
    assert "best form" in made.document["remarks"][0]
    assert made.document["gap"]["closed"] > 0.95
    assert [e["effect"] for e in documents.read(made.folder / "spec.json", "model_spec")["effects"]] == ["latency"]
    rows = list(csv.DictReader((made.folder / made.document["corrected"]["file"]).read_text().splitlines()))
    assert float(rows[9]["time_corrected_s"]) == pytest.approx(float(rows[9]["time_s"]) - 0.08, abs=1e-6)
    assert "0.08 s" in made.document["corrected"]["times"]


def test_a_plan_that_fails_takes_nothing_down(loose, tmp_path, monkeypatch):
    from tacdata.revision.next_presses import recommend as module

    def fails(*_, **__):
        raise ValueError("Knots should not have nans or infs")

    monkeypatch.setattr(module, "rivals", fails)
    judged = verdict(tmp_path / "verdict", "backlash", {"b": 0.06}, "named, incomplete", session=loose)
    made = revise(judged, [loose], read_spec(None), tmp_path / "revision")
    assert made.document["added"] == ["backlash"] and (made.folder / "card.html").is_file()
    assert made.document["next"]["plan"] is None and "Knots" in made.document["next"]["remark"]


def test_without_a_plan_nobody_is_sent_to_where_they_are(loose, tmp_path):
    """The verdict asks for a rigid block, and for the presses that `tacdata revise` chooses: it found none."""
    judged = verdict(tmp_path / "verdict", "backlash", {"b": 0.06}, "ambiguous")
    told = documents.read(judged / "verdict.json", "verdict")
    words = ["press a rigid block", f"the presses that settle it soonest: {REVISE} writes them as next.yaml"]
    documents.write(judged / "verdict.json", told | {"next": words}, "verdict")
    made = revise(judged, [loose], read_spec(None), tmp_path / "revision").document["next"]
    assert made["plan"] is None and made["remark"].startswith("no plan: ")
    assert made["presses"] == ["press a rigid block"]


def test_play_moves_the_paths_of_labels_on_the_way_back_alone(loose):
    from tacdata.effects import Placed, load
    from tacdata.recording import read_episode, read_session
    from tacdata.revision.labels.pose_path import moved_episodes
    from tacdata.revision.labels.relabel import paths_moved

    placed = [Placed(load("backlash"), {"b": np.array(0.06)})]
    moved = paths_moved(loose, placed)
    assert moved.paths == moved.episodes == 16
    assert moved.path_most == pytest.approx(0.06, abs=1e-6)
    old = [read_episode(p) for p in read_session(loose).episodes]
    for before, after in zip(old, moved_episodes(old, placed), strict=True):
        nominal = before.tip_at(after.tip_ns)
        peak = int(np.argmax(nominal[:, 2]))
        down = np.flatnonzero(nominal[:peak, 2] > 0)
        np.testing.assert_allclose(after.tip[down, 2], nominal[down, 2], atol=1e-6)
        up = peak + np.flatnonzero((nominal[peak:, 2] > 0) & (nominal[peak:, 2] < 0.9))
        np.testing.assert_allclose(after.tip[up, 2], nominal[up, 2] + 0.06, atol=1e-6)


def test_nothing_is_overwritten_and_a_verdict_of_something_else_is_refused(late, loose, right, tmp_path):
    judged = verdict(tmp_path / "verdict", "latency", {"L": 0.08})
    with pytest.raises(UsageError, match="exists"):
        revise(judged, [late], read_spec(None), tmp_path)
    with pytest.raises(UsageError, match="another model"):
        revise(judged, [late], read_spec(right.folder / "spec.json"), tmp_path / "new")
    known = verdict(tmp_path / "known", "latency", {"L": 0.08}, session=late)
    with pytest.raises(UsageError, match="other recordings") as caught:
        revise(known, [loose], read_spec(None), tmp_path / "new")
    assert "session" in caught.value.allowed
    with pytest.raises(UsageError, match="no file"):
        revise(tmp_path / "nothing", [late], read_spec(None), tmp_path / "new")
    assert not (tmp_path / "new").exists()
