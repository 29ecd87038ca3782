"""ACT policies of LeRobot with touch and without, trained on the same demonstrations, tried on the same oranges.

python examples/policy_with_touch/policy.py FOLDER [--camera 3] [--episodes 300] [--steps 2000] [--trials 40]
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import scene
import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.factory import make_policy, make_policy_config, make_pre_post_processors
from lerobot.policies.pretrained import PreTrainedPolicy
from lerobot.utils.utils import cycle
from scipy.stats import binomtest

from tacdata.replay.comparison.paired import paired

ACT = {
    "chunk_size": 10,
    "n_action_steps": 1,
    "dim_model": 64,
    "n_heads": 4,
    "dim_feedforward": 128,
    "n_encoder_layers": 2,
    "n_vae_encoder_layers": 2,
    "latent_dim": 8,
    "optimizer_lr": 5e-4,
    "device": "cpu",
    "push_to_hub": False,
}
"""Options of `lerobot-train --policy.type=act`."""
SCRIPTED = {
    "raw taxels, scripted": lambda trial: scene.by_touch(trial, "raw_taxel"),
    "camera alone, scripted": lambda _: scene.by_camera,
    "true place, scripted": scene.by_place,
}
"""Controllers that were not trained: the demonstrator, and two limits."""
BATCH, CLIP = 32, 10.0
"""Frames of a step [count]; norm to which gradients are clipped, as LeRobot does."""


def train(root: Path, out: Path, steps: int, seed: int) -> None:
    """Train a policy by LeRobot's classes and save it as `lerobot-train` does."""
    torch.manual_seed(seed)
    config = make_policy_config("act", **ACT)
    future = {scene.ACTION: [k / scene.RATE for k in range(ACT["chunk_size"])]}
    dataset = LeRobotDataset("local/orange", root=root, delta_timestamps=future)
    policy = make_policy(config, ds_meta=dataset.meta)
    before, after = make_pre_post_processors(config, dataset_stats=dataset.meta.stats)
    optimizer = config.get_optimizer_preset().build(policy.get_optim_params())
    # Few frames without images: held in memory, which spares most of the time.
    frames = [dataset[k] for k in range(len(dataset))]
    loader = torch.utils.data.DataLoader(frames, BATCH, shuffle=True, drop_last=True)
    policy.train()
    for _, batch in zip(range(steps), cycle(loader), strict=False):
        loss, _ = policy.forward(before(batch))
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), CLIP)
        optimizer.step()
        optimizer.zero_grad()
    for part in (policy, before, after):
        part.save_pretrained(out)


def by_policy(checkpoint: Path) -> tuple[PreTrainedPolicy, scene.Controller]:
    """Return a trained policy, of `train` or of `lerobot-train`, and its controller."""
    from lerobot.policies.factory import get_policy_class

    config = PreTrainedConfig.from_pretrained(checkpoint)
    policy = get_policy_class(config.type).from_pretrained(checkpoint, config=config).eval()
    before, after = make_pre_post_processors(config, pretrained_path=str(checkpoint))
    wide = config.input_features[scene.STATE].shape[0]

    def controller(observation: scene.Observation) -> np.ndarray:
        tensors = {key: torch.from_numpy(value) for key, value in observation.items()}
        tensors[scene.STATE] = tensors[scene.STATE][:wide]
        with torch.inference_mode():
            return after(policy.select_action(before(tensors))).squeeze(0).numpy()

    return policy, controller


def trials(world: scene.World, count: int, seed: int, arms: dict[str, Path | None]) -> dict[str, list[tuple]]:
    """Return (held, steps, offset at the end [mm]) of each trial, by arm; each meets the same oranges."""
    results: dict[str, list[tuple]] = {}
    for name, checkpoint in arms.items():
        policy, controller = by_policy(checkpoint) if checkpoint else (None, None)
        results[name] = []
        for number in range(count):
            trial = scene.Trial(world, (seed, number))
            if policy is not None:
                policy.reset()
            held, steps, _ = scene.run(trial, controller or SCRIPTED[name](trial))
            results[name].append((held, steps, trial.place - trial.arm))
    return results


def table(results: dict[str, list[tuple]]) -> list[str]:
    """Return the figures as a table in Markdown, and the paired difference of touch."""
    lines = ["| controller | held | Wilson 95 % | median offset at the end [mm] | steps |", "|---|---|---|---|---|"]
    for name, outcomes in results.items():
        held, of = sum(o[0] for o in outcomes), len(outcomes)
        low, high = binomtest(held, of).proportion_ci(method="wilson")
        offset, steps = np.median(np.abs([o[2] for o in outcomes])), np.mean([o[1] for o in outcomes])
        lines.append(f"| {name} | {held}/{of} | {low:.0%} to {high:.0%} | {offset:.2f} | {steps:.0f} |")
    touch, blind = ([o[0] for o in results[f"ACT {name} touch"]] for name in ("with", "without"))
    return [*lines, "", f"ACT with touch less without, same oranges: {paired(touch, blind).text}"]


def main() -> None:
    """Demonstrate, train both policies, try them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--camera", type=float, default=3.0, help="camera's error [mm]")
    parser.add_argument("--episodes", type=int, default=300)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    torch.set_num_threads(1)
    world = scene.World(given.camera)
    episodes: list[dict[str, np.ndarray]] = []
    arms: dict[str, Path | None] = {}
    for touch in (True, False):
        name = f"{'with' if touch else 'without'} touch"
        root, out = (given.folder / f"{kind}_{name.replace(' ', '_')}" for kind in ("dataset", "policy"))
        begun = time.process_time()
        if not root.exists():
            episodes = episodes or scene.demonstrate(world, given.episodes, given.seed)
            scene.write(root, episodes, touch, world.sensor.taxels.count)
        if not out.exists():
            train(root, out, given.steps, given.seed)
            print(f"policy {name}: {time.process_time() - begun:.0f} s of the processor")
        arms[f"ACT {name}"] = out
    arms |= dict.fromkeys(SCRIPTED)
    # Seeds of the trials begin far from those of the demonstrations.
    results = trials(world, given.trials, given.seed + 1000, arms)
    print("\n".join(table(results)))
    (given.folder / "trials.json").write_text(json.dumps({"settings": vars(given), "trials": results}, default=str))


if __name__ == "__main__":
    main()
