"""An exported network answers like torch, says what it is, and is not kept otherwise."""

import json

import numpy as np
import pytest

from tacdata import registry
from tacdata.errors import FormatError, UsageError
from tacdata.training.inference import onnx_export
from tacdata.training.inference.onnx_export import export
from tacdata.training.inference.sequence import window_map
from tacdata.training.networks.network import BASE, ROOM
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train

onnxruntime = pytest.importorskip("onnxruntime")
onnx = pytest.importorskip("onnx")


@pytest.mark.parametrize("name", registry.names(ROOM, BASE))
def test_every_network_answers_like_torch(name, frames, tmp_path):
    trained = train(frames, recipe({"network": name, "epochs": 1}), tmp_path / "run", device="cpu", threads=1)
    made = export(trained, tmp_path / "network.onnx")
    assert made.difference < 1e-4
    session = onnxruntime.InferenceSession(str(made.path), providers=["CPUExecutionProvider"])
    window = frames.taxels[: len(trained.network.offsets)]
    answer = session.run(None, {"windows": window[None]})[0]
    assert answer.shape == (1, 35, 26)
    np.testing.assert_allclose(answer[0], window_map(trained)(window), atol=1e-4)
    told = json.loads({p.key: p.value for p in onnx.load(made.path).metadata_props}[onnx_export.KEY])
    assert told["checkpoint"] == trained.content_hash
    assert told["offsets"] == list(trained.network.offsets)
    with pytest.raises(UsageError, match="exists"):
        export(trained, made.path)


def test_a_network_that_answers_differently_is_not_kept(frames, tmp_path, monkeypatch):
    trained = train(frames, TrainingSettings(network="direct", epochs=1), tmp_path / "run", device="cpu", threads=1)
    monkeypatch.setattr(onnx_export, "TOLERANCE", -1.0)
    with pytest.raises(FormatError, match="differs from torch"):
        export(trained, tmp_path / "network.onnx")
    assert not [p for p in tmp_path.iterdir() if p.name != "run"]
