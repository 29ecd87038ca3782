"""The recipe of a run from what a person asked for, the network and the pretrained network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tacdata import registry
from tacdata.errors import UsageError
from training.networks.network import BASE, ROOM, Network
from training.settings import TrainingSettings

if TYPE_CHECKING:
    from training.inference.checkpoint import Checkpoint

FITTING: dict[str, Any] = {"epochs": 20, "learning_rate": 5e-4, "batch_size": 64}
"""What differs where a pretrained network is fitted to a few recorded presses: small steps, and soon done."""
PULL = 1e-3
"""Weight of the pull towards the pretrained weights where no simulated frames are mixed in [1]."""


def recipe(asked: Mapping[str, Any], pretrained: Checkpoint | None = None, simulated: bool = False) -> TrainingSettings:
    """Return the settings of a run.

    A person's wishes come first, then what suits a pretrained start, then what suits the network, then the paper.

    Args:
        asked: Settings by name; None where a person said nothing.
        pretrained: What the run starts from.
        simulated: Whether simulated frames are mixed in.

    Raises:
        UsageError: If another network is asked for than the pretrained one, or a setting cannot train.

    Example:
        >>> from training.pretraining.recipe import recipe
        >>> recipe({"network": "pattern"}).batch_size, recipe({"network": "pattern", "batch_size": 32}).batch_size
        (128, 32)
    """
    wishes = {name: value for name, value in asked.items() if value is not None}
    name = wishes.setdefault("network", pretrained.network.name if pretrained else TrainingSettings.network)
    kind: type[Network] = registry.load(ROOM, BASE, name, Network)
    if pretrained is None:
        return TrainingSettings(**{**kind.recipe, **wishes})
    if name != pretrained.network.name:
        raise UsageError(
            f"--network {name} from {pretrained.path}, which is a network {pretrained.network.name}",
            "the same network",
            "leave --network out, or train without --from",
        )
    fitting: dict[str, Any] = {**FITTING, "arguments": pretrained.network.arguments, "pull": 0.0 if simulated else PULL}
    return TrainingSettings(**{**kind.recipe, **fitting, **wishes})
