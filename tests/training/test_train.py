"""Training learns, repeats itself bit for bit, resumes as if never stopped, and refuses what does not fit."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.training.frames.normalization import normalization
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.predictor import predict
from tacdata.training.loss import WeightedLoss
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train

SMALL = TrainingSettings(arguments={"hidden": 24, "channels": 8}, epochs=3)


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def run(frames, settings, out, **options):
    return train(frames, settings, out, device="cpu", threads=1, **options)


def weights(path):
    return checkpoint.load(path).network.state_dict()


def same(a, b):
    return a.keys() == b.keys() and all(torch.equal(a[k], b[k]) for k in a)


def test_it_learns_and_beats_the_mean_map(make_frames, tmp_path):
    frames = make_frames(episodes=40, length=18)
    settings = TrainingSettings(arguments={"hidden": 48, "channels": 8}, epochs=12, batch_size=16)
    trained = run(frames, settings, tmp_path / "run")
    history = [json.loads(line) for line in (tmp_path / "run/metrics.jsonl").read_text().splitlines()]
    assert [h["epoch"] for h in history] == list(range(1, 13))
    assert history[-1]["train_loss"] < 0.2 * history[0]["train_loss"]
    test = frames.indices(trained.split.test)
    mean_map = frames.depth[frames.indices(trained.split.train)].mean(axis=0)
    predicted = predict(trained.network, Windows(frames, trained.network.offsets), test, 3.0)
    error = np.sqrt(np.mean((predicted - frames.depth[test]) ** 2))
    assert error < 0.5 * np.sqrt(np.mean((mean_map - frames.depth[test]) ** 2))


def test_the_same_seed_gives_the_same_bits_and_another_does_not(frames, tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        run(frames, replace(SMALL, epochs=2, seed=seed), tmp_path / name)
    last = [weights(tmp_path / name / checkpoint.LAST) for name in "abc"]
    assert same(last[0], last[1])
    assert not same(last[0], last[2])


def test_a_resumed_run_is_the_run(frames, tmp_path):
    run(frames, replace(SMALL, epochs=4), tmp_path / "whole")
    run(frames, replace(SMALL, epochs=2), tmp_path / "parts")
    run(frames, replace(SMALL, epochs=4), tmp_path / "parts", resume=True)
    for name in (checkpoint.LAST, checkpoint.BEST):
        assert same(weights(tmp_path / "whole" / name), weights(tmp_path / "parts" / name))
    losses = [
        [json.loads(line)["train_loss"] for line in (tmp_path / name / "metrics.jsonl").read_text().splitlines()]
        for name in ("whole", "parts")
    ]
    assert losses[0] == losses[1]
    assert len(losses[0]) == 4


def test_the_checkpoint_says_what_it_is(frames, tmp_path):
    trained = run(frames, replace(SMALL, epochs=1), tmp_path / "run")
    document = trained.document
    assert document["dataset"]["hash"] == frames.dataset_hash
    assert document["sensor"]["hash"] == frames.sensor.content_hash
    assert document["network"]["arguments"] == {"hidden": 24, "channels": 8}
    assert document["provenance"]["code_version"]
    learned = frames.taxels[frames.indices(trained.split.train)]
    np.testing.assert_allclose(document["normalization"]["mean"], learned.mean(axis=0), rtol=1e-5)
    np.testing.assert_allclose(document["normalization"]["sd"], learned.std(axis=0), rtol=1e-4)
    torch.testing.assert_close(trained.network.get_buffer("mean"), torch.tensor(document["normalization"]["mean"]))


def test_a_dead_channel_stays_silent():
    mean, sd = normalization(np.stack([np.full(5, 7.0), np.arange(5.0)], axis=1))
    assert mean.tolist() == [7.0, 2.0]
    assert sd.tolist() == pytest.approx([1.0, np.sqrt(2.0)])


def test_an_existing_folder_is_not_overwritten(frames, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run/mine.txt").write_text("keep")
    with pytest.raises(UsageError, match="already exists"):
        run(frames, SMALL, tmp_path / "run")
    assert [p.name for p in (tmp_path / "run").iterdir()] == ["mine.txt"]


def test_a_resumed_run_must_be_the_same_run(frames, other_sensor_frames, tmp_path):
    out = tmp_path / "run"
    run(frames, replace(SMALL, epochs=1), out)
    with pytest.raises(UsageError, match="seed 5 instead of 0"):
        run(frames, replace(SMALL, seed=5), out, resume=True)
    with pytest.raises(UsageError, match="the same dataset"):
        run(replace(frames, dataset_hash="e" * 64), SMALL, out, resume=True)
    with pytest.raises(FormatError, match=r"skin/thickness 3\.3 against 3\.0"):
        run(other_sensor_frames, SMALL, out, resume=True)
    with pytest.raises(UsageError, match="no checkpoint"):
        run(frames, SMALL, tmp_path / "nothing", resume=True)


def test_a_loss_that_is_no_number_stops_with_words(frames, tmp_path):
    with pytest.raises(TacdataError, match="a finite loss"):
        run(frames, replace(SMALL, loss=WeightedLoss(foreground=float("inf"))), tmp_path / "run")


@pytest.mark.parametrize("settings", [{"epochs": 0}, {"batch_size": 0}, {"seed": -1}, {"learning_rate": 0.0}])
def test_settings_that_cannot_train_are_refused(settings):
    with pytest.raises(UsageError, match=next(iter(settings))):
        TrainingSettings(**settings)


def test_damaged_checkpoints_are_refused(frames, tmp_path):
    run(frames, replace(SMALL, epochs=1), tmp_path / "run")
    path = tmp_path / "run" / checkpoint.BEST
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FormatError, match="not a readable checkpoint"):
        checkpoint.load(tmp_path / "run")
    path.write_bytes(b"no checkpoint at all")
    with pytest.raises(FormatError, match="not a readable checkpoint"):
        checkpoint.load(tmp_path / "run")


def test_an_unknown_device_is_refused(frames, tmp_path):
    with pytest.raises(UsageError, match="--device tpu"):
        train(frames, SMALL, tmp_path / "run", device="tpu")


def test_the_rate_falls_along_the_cosine_and_the_paper_keeps_it():
    assert {TrainingSettings(epochs=5).rate_at(e) for e in range(1, 6)} == {1e-3}
    rates = [TrainingSettings(epochs=5, schedule="cosine").rate_at(e) for e in range(1, 6)]
    assert rates == sorted(rates, reverse=True)
    assert rates[0] == pytest.approx(1e-3)
    assert rates[-1] == pytest.approx(2e-5)


def test_a_resumed_run_with_every_variation_is_the_run(frames, tmp_path):
    """Mirrors, gains, idle frames and the schedule are drawn again alike; only the schedule's length is fixed."""
    varied = replace(SMALL, epochs=2, schedule="cosine", mirror=True, gain_jitter=0.1, idle_share=0.3)
    run(frames, varied, tmp_path / "whole")

    def interrupted(progress):
        if progress.finished:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(frames, varied, tmp_path / "cut", listener=interrupted)
    run(frames, varied, tmp_path / "cut", resume=True)
    assert same(weights(tmp_path / "whole" / checkpoint.LAST), weights(tmp_path / "cut" / checkpoint.LAST))
    with pytest.raises(UsageError, match="cosine schedule"):
        run(frames, replace(varied, epochs=3), tmp_path / "cut", resume=True)


def test_idle_frames_are_left_out_and_contact_never(make_frames, tmp_path):
    frames = make_frames(episodes=8, length=24)
    steps = {}
    for share in (1.0, 0.0):
        count = []
        settings = replace(SMALL, epochs=1, batch_size=1, idle_share=share)
        out = tmp_path / str(share)
        run(frames, settings, out, listener=lambda progress, count=count: count.append(progress.steps))
        steps[share] = count[0]
        learned = frames.indices(checkpoint.load(out).split.train)
    touching = (frames.depth[learned].max(axis=(1, 2)) > 0.1).sum()
    assert steps == {1.0: len(learned), 0.0: touching}


def test_bfloat16_learns_alike(frames, tmp_path):
    losses = {}
    for precision in ("float32", "bfloat16"):
        trained = run(frames, replace(SMALL, epochs=2, precision=precision), tmp_path / precision)
        losses[precision] = trained.document["history"][-1]["train_loss"]
    assert losses["bfloat16"] == pytest.approx(losses["float32"], rel=0.1)
    last = [weights(tmp_path / precision / checkpoint.LAST) for precision in losses]
    assert not same(*last)


@pytest.mark.parametrize(
    "changed", [{"schedule": "linear"}, {"precision": "float8"}, {"gain_jitter": -0.1}, {"idle_share": 1.5}]
)
def test_variations_that_make_no_sense_are_refused(changed):
    with pytest.raises(UsageError, match=next(iter(changed))):
        TrainingSettings(**changed)


def test_tensorboard_shows_what_the_metrics_file_holds(frames, tmp_path):
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    from tacdata.training.tensorboard import FOLDER, event_log

    run(frames, replace(SMALL, epochs=2), tmp_path / "run", listener=event_log(tmp_path / "run"))
    events = EventAccumulator(str(tmp_path / "run" / FOLDER))
    events.Reload()
    history = [json.loads(line) for line in (tmp_path / "run/metrics.jsonl").read_text().splitlines()]
    for name in ("train_loss", "validation_loss"):
        assert [e.value for e in events.Scalars(name)] == pytest.approx([h[name] for h in history])
