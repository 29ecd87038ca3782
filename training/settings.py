"""The recipe of a training run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from math import cos, pi
from typing import Any

from tacdata.errors import UsageError
from tacdata.training.loss import WeightedLoss

SCHEDULES = ("constant", "cosine")
PRECISIONS = ("float32", "bfloat16")


@dataclass(frozen=True)
class TrainingSettings:
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
    schedule: str = "constant"
    """Course of the learning rate over the epochs: "constant", or "cosine" down to a fiftieth."""
    mirror: bool = False
    """Mirror half of the frames about x and half about y, signals and labels: taxels and map are symmetric."""
    gain_jitter: float = 0.0
    """Standard deviation of a factor drawn for each channel of each frame [1]: other specimens' gains."""
    scale_jitter: float = 0.0
    """Standard deviation of a factor drawn for each frame, common to all channels [1]: a unit's gain is uncertain."""
    exponent_jitter: float = 0.0
    """Standard deviation of a change of the exponent drawn for each frame [1]: a unit's law is uncertain."""
    spread_jitter: float = 0.0
    """Standard deviation of a variance by which each frame's loads are spread over neighbours [mm^2]: a unit's skin may
    spread them less far than the model's, or farther."""
    calibrate: bool = False
    """Turn readings into forces first, by a calibration fitted on the training presses."""
    pull: float = 0.0
    """Weight of the squared distance from the pretrained weights [1], for 10 training presses or fewer; with more
    it falls as one over their number (L2-SP; X. Li et al., ICML 2018)."""
    idle_share: float = 1.0
    """Share of the frames without contact that an epoch takes, drawn each epoch [1]; the others all count."""
    precision: str = "float32"
    """Arithmetic of the forward pass while training: "float32" or "bfloat16"; weights are float32 in both."""

    def __post_init__(self) -> None:
        """Refuse settings that cannot train.

        Raises:
            UsageError: Naming the first such setting.
        """
        for name, minimum in (("epochs", 1), ("batch_size", 1), ("seed", 0)):
            value = getattr(self, name)
            if value < minimum:
                raise UsageError(f"{name} = {value}", f"an integer of at least {minimum}", f"change --{name}")
        for name, positive in (("learning_rate", True), ("weight_decay", False)):
            value = getattr(self, name)
            if not (0 < value < 1 or (value == 0 and not positive)):
                raise UsageError(f"{name} = {value}", "a number between 0 and 1", f"change {name}")
        for name, allowed in (("schedule", SCHEDULES), ("precision", PRECISIONS)):
            if getattr(self, name) not in allowed:
                raise UsageError(f"{name} = {getattr(self, name)!r}", ", ".join(allowed), f"change --{name}")
        if not 0.0 <= self.idle_share <= 1.0:
            raise UsageError(f"idle_share = {self.idle_share}", "0 to 1", "change --idle-share")
        for name in ("gain_jitter", "scale_jitter", "exponent_jitter", "spread_jitter"):
            if not 0.0 <= (value := getattr(self, name)) < 1.0:
                option = f"--{name.replace('_', '-')}"
                raise UsageError(f"{name} = {value}", "0 or more, less than 1", f"change {option}")
        if self.pull < 0.0:
            raise UsageError(f"pull = {self.pull}", "0 or more", "change --pull")

    def rate_at(self, epoch: int) -> float:
        """Return the learning rate of an epoch, counted from 1."""
        if self.schedule == "constant":
            return self.learning_rate
        done = (epoch - 1) / max(1, self.epochs - 1)
        return self.learning_rate * (0.02 + 0.98 * 0.5 * (1.0 + cos(pi * done)))

    @property
    def document(self) -> dict[str, Any]:
        """The settings as plain data (JSON types)."""
        return asdict(self)

    @property
    def title(self) -> str:
        """The network, and the changes of the recipe from the paper's."""
        paper = TrainingSettings()
        changed = [f"{k} {v}" for k, v in self.arguments.items()]
        names = (
            "batch_size",
            "learning_rate",
            "weight_decay",
            "schedule",
            "mirror",
            "gain_jitter",
            "scale_jitter",
            "exponent_jitter",
            "spread_jitter",
            "calibrate",
            "pull",
            "idle_share",
            "epochs",
            "loss",
        )
        for name in names:
            value = getattr(self, name)
            if value != getattr(paper, name):
                changed.append(name if value is True else f"{name.replace('_', ' ')} {value}")
        return self.network + (f" ({', '.join(changed)})" if changed else "")

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> TrainingSettings:
        """Rebuild settings from `document`."""
        values: dict[str, Any] = {**document, "loss": WeightedLoss(**document["loss"])}
        return cls(**values)
