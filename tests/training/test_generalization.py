"""Every split trained and scored, gone on with, compared, and put on one page."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from running.in_process import tacdata

from tacdata.errors import UsageError
from tacdata.training.generalization import generalize
from tacdata.training.inference import checkpoint
from tacdata.training.reports.comparison import groups, verdicts
from tacdata.training.reports.report_page import Scored, page
from tacdata.training.reports.score_sheet import markdown
from tacdata.training.settings import TrainingSettings

RECIPE = TrainingSettings(network="direct", arguments={"hidden": 16}, epochs=2, batch_size=64)


@pytest.fixture(scope="module")
def outcomes(frames, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    one_specimen = replace(frames, episodes=tuple(replace(e, specimen="a") for e in frames.episodes))
    return generalize(one_specimen, RECIPE, ("episode", "indenter", "specimen"), 2, out, "cpu", 1), one_specimen, out


def scored(outcomes):
    found, frames, _ = outcomes
    return [Scored("direct", o.evaluation, frames) for o in found if o.evaluation]


def test_what_a_dataset_does_not_allow_is_named(outcomes):
    found, _, _ = outcomes
    assert [(o.settings.split, o.settings.seed, bool(o.evaluation)) for o in found] == [
        ("episode", 0, True),
        ("episode", 1, True),
        ("indenter", 0, True),
        ("indenter", 1, True),
        ("specimen", 0, False),
        ("specimen", 1, False),
    ]
    assert "leaves no train episode" in found[-1].reason


def test_unseen_shapes_are_unseen(outcomes):
    found, frames, out = outcomes
    split = checkpoint.load(out / "direct-indenter-0").split
    shapes = [{e.shape for e in frames.spans(part)} for part in (split.train + split.validation, split.test)]
    assert not shapes[0] & shapes[1]
    assert found[2].evaluation.document["split"]["episodes"] == list(split.test)


def test_what_is_finished_is_kept(outcomes):
    _, frames, out = outcomes
    before = (out / "direct-episode-0/best.safetensors").stat().st_mtime_ns
    again = generalize(frames, RECIPE, ("episode",), 1, out, "cpu", 1)
    assert (out / "direct-episode-0/best.safetensors").stat().st_mtime_ns == before
    assert again[0].evaluation is not None


def test_nothing_possible_is_refused(frames, tmp_path):
    one = replace(frames, episodes=tuple(replace(e, specimen="a") for e in frames.episodes))
    with pytest.raises(UsageError, match="none of the splits specimen"):
        generalize(one, RECIPE, ("specimen",), 1, tmp_path / "runs", "cpu", 1)
    with pytest.raises(UsageError, match="did you mean"):
        generalize(frames, RECIPE, ("indentr",), 1, tmp_path / "runs", "cpu", 1)


def test_seeds_are_put_together_and_judged_by_the_papers_means(outcomes):
    runs = [(s.name, s.evaluation.document) for s in scored(outcomes)]
    found = groups(runs)
    assert [(g.split, g.seeds) for g in found] == [("episode", (0, 1)), ("indenter", (0, 1))]
    group = found[0]
    wanted = [d["contact_frames"]["iou"]["mean"] for _, d in runs[:2]]
    assert group.mean("iou") == pytest.approx(sum(wanted) / 2)
    assert group.deviation("iou") == pytest.approx(abs(wanted[0] - wanted[1]) / 2**0.5)
    better = replace(group, values={**group.values, "iou": group.values["iou"] * 0 + 0.9})
    assert better.beats_the_paper("iou")
    assert not replace(group, values={**group.values, "iou": group.values["iou"] * 0 + 0.5}).beats_the_paper("iou")
    worse = {m: v * 0 + (0.1 if m == "iou" else 99.0) for m, v in group.values.items()}
    assert verdicts([replace(group, values=worse)])[0].startswith("direct, split episode: no metric better")


def test_a_claim_must_beat_the_baselines_of_the_same_table(outcomes):
    runs = [(s.name, s.evaluation.document) for s in scored(outcomes)]
    group = groups(runs)[0]
    wanted = [d["baselines"]["mean"]["iou"]["mean"] for _, d in runs[:2]]
    assert group.baselines["mean"]["iou"] == pytest.approx(sum(wanted) / 2)
    good = {m: v * 0 + (0.9 if m == "iou" else 0.001) for m, v in group.values.items()}
    weak = {name: {m: 0.5 if m == "iou" else 0.002 for m in good} for name in ("mean", "linear")}
    better = replace(group, values=good, baselines=weak)
    assert better.stands_out("iou") and "every baseline in" in verdicts([better])[0]
    reached = replace(better, baselines={**weak, "mean": {**weak["mean"], "iou": 0.9}})
    assert reached.beats_the_paper("iou") and not reached.stands_out("iou")
    assert "but a predictor without a network reaches it too" in verdicts([reached])[0]
    unknown = replace(better, baselines={})
    assert not unknown.stands_out("iou") and "no baseline was scored" in verdicts([unknown])[0]


class Tags(HTMLParser):
    """Collects what a page refers to, and whether its elements are closed."""

    def __init__(self):
        super().__init__()
        self.open, self.sources, self.headings = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)


def test_the_page_stands_alone_and_shows_every_split(outcomes):
    text = page(scored(outcomes), impossible={"specimen": "one specimen <only>"})
    tags = Tags()
    tags.feed(text)
    assert not tags.open
    assert tags.sources and all(source.startswith("#part-") for source in tags.sources)
    maps = [json.loads(data)[0] for data in re.findall(r'<script type="application/json">(.*?)</script>', text)]
    shown = [entry for entry in maps if "extent" in entry]
    assert len(shown) >= 6 and len(shown[0]["values"]) == 26 and len(shown[0]["values"][0]) == 35
    words = re.sub(r"<(script|style).*?</\1>", "", text, flags=re.S)
    assert not re.search(r"\bnan\b", words) and re.search(r"<h1>.*errs by 0\.\d+ mm in depth", words)
    assert "direct, split episode, seed 0" in tags.headings
    assert "direct, split indenter, seed 0" in tags.headings
    assert "one specimen &lt;only&gt;" in text
    assert "virtual rig" in text
    assert "Test episodes: " in text
    for figure in ("0.223", "1.213", "0.829"):
        assert figure in text


def test_runs_are_reported_by_the_verb(outcomes, tmp_path, monkeypatch):
    """The verb reads datasets from disk; here a folder that the real writer wrote."""
    from test_training_verbs import call, write_dataset

    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "cache"))
    _, frames, _ = outcomes
    write_dataset(tmp_path / "data", frames)
    options = ["--network", "direct", "--epochs", 1, "--device", "cpu", "--threads", 1, "--split", "episode"]
    shown = call("generalize", tmp_path / "data", "--out", tmp_path / "runs", *options, "--split", "specimen")
    assert "split specimen is not possible" in shown
    assert (tmp_path / "runs/report.html").read_text().startswith("<!doctype html>")
    words = ["--out", tmp_path / "page.html", "--device", "cpu", "--threads", 1, "--json"]
    (run,) = json.loads(tacdata("report", tmp_path / "runs", *words).stdout)["runs"]
    text = (tmp_path / "page.html").read_text()
    assert "direct" in text and f"--predictions {tmp_path / 'runs' / 'direct-episode-0'} --sort error --web" in text
    with pytest.raises(UsageError, match="exists"):
        call("report", tmp_path / "runs", "--out", tmp_path / "page.html")
    scores = json.loads((tmp_path / "runs/direct-episode-0/scores/scores.json").read_text())
    assert next(entry["level"] for entry in scores["uncertainty"]["levels"]) == 0.5
    assert "direct" in run["title"] and run["uncertainty"] == scores["uncertainty"]


def test_the_time_of_a_network_is_one_in_report_and_score_sheet(outcomes):
    first = scored(outcomes)[0]
    document = {**first.evaluation.document, "inference_ms_per_frame": 2.3456}
    one = replace(first, evaluation=replace(first.evaluation, document=document))
    assert "2.35 ms a frame" in markdown(document)
    words = re.sub(r"<(script|style).*?</\1>", "", page([one]), flags=re.S)
    times = re.findall(r"\b\d\.\d\d(?= ms a frame)", words)
    assert times and set(times) == {"2.35"} and re.search(r">\s*2\.35\s*</td>", words)


def test_a_report_calls_networks_by_their_names_and_tells_their_recipes_once(outcomes):
    first, second = (replace(run, name=f"pattern (hidden {k})") for k, run in enumerate(scored(outcomes)[:2]))
    text = page([first, second])
    assert "pattern 1: hidden 0." in text and "pattern 2: hidden 1." in text
    assert text.count("hidden 0") == 1
