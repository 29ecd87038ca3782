"""The recipe of a run from options, the network and the pretrained network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.training.networks.network import BASE, ROOM, Network
from tacdata.training.settings import TrainingSettings

if TYPE_CHECKING:
    from tacdata.training.inference.checkpoint import Checkpoint

FITTING: dict[str, Any] = {"epochs": 20, "learning_rate": 5e-4, "batch_size": 64}
"""Settings for fitting a pretrained network to a few recorded presses: small steps, few epochs."""
PULL = 1e-3
"""Weight of the pull towards the pretrained weights where no simulated frames are mixed in [1]."""


def recipe(
    options: Mapping[str, Any], pretrained: Checkpoint | None = None, simulated: bool = False
) -> TrainingSettings:
    """Return the settings of a run.

    Order of precedence: options, settings of a pretrained start, those of the network, the paper's.

    Args:
        options: Settings by name; None where not given.
        pretrained: Start of the run.
        simulated: Whether simulated frames are mixed in.

    Raises:
        UsageError: If another network is asked for than the pretrained one, or a setting cannot train.

    Example:
        >>> from tacdata.training.pretraining.recipe import recipe
        >>> recipe({"network": "pattern"}).batch_size, recipe({"network": "pattern", "batch_size": 32}).batch_size
        (128, 32)
    """
    wishes = {name: value for name, value in options.items() if value is not None}
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
