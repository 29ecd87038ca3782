"""The recipe of a training run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from tacdata.errors import UsageError
from training.loss import WeightedLoss


@dataclass(frozen=True)
class Settings:
    """Everything that decides a run besides the dataset; the defaults are the paper's."""

    network: str = "paper"
    """File name in training/networks."""
    arguments: dict[str, Any] = field(default_factory=dict)
    """Arguments of the network that differ from its defaults."""
    split: str = "episode"
    """File name in training/splits."""
    seed: int = 0
    """Seed of the split, the weights and the order of frames."""
    epochs: int = 50
    """Passes over the training frames."""
    batch_size: int = 32
    """Frames a step."""
    learning_rate: float = 1e-3
    """AdamW's learning rate [1/step]; constant, the paper prints no schedule."""
    weight_decay: float = 1e-4
    """AdamW's decoupled weight decay [1]."""
    loss: WeightedLoss = field(default_factory=WeightedLoss)
    """Weights of the training loss."""

    def __post_init__(self) -> None:
        """Refuse settings that cannot train.

        Raises:
            UsageError: Naming the first such setting.
        """
        for name, least in (("epochs", 1), ("batch_size", 1), ("seed", 0)):
            value = getattr(self, name)
            if value < least:
                raise UsageError(f"{name} = {value}", f"an integer of at least {least}", f"change --{name}")
        for name, positive in (("learning_rate", True), ("weight_decay", False)):
            value = getattr(self, name)
            if not (0 < value < 1 or (value == 0 and not positive)):
                raise UsageError(f"{name} = {value}", "a number between 0 and 1", f"change {name}")

    @property
    def document(self) -> dict[str, Any]:
        """The settings as plain data (JSON types)."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Settings:
        """Rebuild settings from `document`."""
        return cls(**{**document, "loss": WeightedLoss(**document["loss"])})
