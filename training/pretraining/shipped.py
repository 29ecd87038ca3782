"""The pretrained network that ships for the default sensor, and how a person names one."""

from __future__ import annotations

from pathlib import Path

from tacdata import provenance
from tacdata.training.inference import checkpoint
from tacdata.training.inference.checkpoint import Checkpoint

NAME = "shipped"
PATH = Path(__file__).with_name("tacprint.safetensors")
"""Made by `docs/how_to/pretrain.md` from presses that `tacdata simulate` solved."""


def pretrained(model: str) -> Checkpoint:
    """Return a pretrained network: a checkpoint's path, a run's folder, or "shipped".

    Raises:
        UsageError: If there is none.
        FormatError: If it is damaged.

    Example:
        >>> from tacdata.training.pretraining.shipped import pretrained
        >>> pretrained("shipped").network.name
        'pattern'
    """
    return checkpoint.load(PATH if model == NAME else Path(model))


def unfitted(trained: Checkpoint) -> str:
    """Describe a network that was trained on simulated presses alone; empty if it is fitted to a unit."""
    simulated = trained.document["dataset"].get("simulated", trained.content_hash == provenance.file_hash(PATH))
    if not simulated:
        return ""
    return (
        f"the network {trained.path.name} learnt from simulated presses alone and is fitted to no unit: its depths are "
        "off by what gains and skin differ; record presses of this fingertip, and tacdata train DATASET --from it"
    )
