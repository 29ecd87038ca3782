"""Deletes from, splits and merges datasets by lerobot's edit tools, and restores fields that these drop.

A new dataset is written to a temporary folder, then renamed. Sources stay as they are.
"""

import logging
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tacdata.dataset.flags import carry_flags
from tacdata.dataset.format import folder, metadata
from tacdata.dataset.notes import carry_notes
from tacdata.dataset.pack import refuse_existing
from tacdata.dataset.restore import restore
from tacdata.errors import FormatError, UsageError


def delete(root: Path, episodes: Sequence[int], target: Path) -> list[int]:
    """Write a dataset without some of its episodes; the others are renumbered.

    Args:
        root: The dataset.
        episodes: Numbers of the episodes to leave out.
        target: Folder of the new dataset.

    Returns:
        Numbers of the new dataset's episodes whose record was not found.

    Raises:
        UsageError: If ``target`` exists, a number is not there, or no episode would stay.
        FormatError: If the dataset is damaged.
        ModuleNotFoundError: If lerobot is not installed.
    """
    count = _check_numbers(root, episodes)
    if len(set(episodes)) == count:
        raise UsageError(
            f"all {count} episodes of {root} to delete", "at least one that stays", "remove the folder instead"
        )
    numbers = sorted(set(episodes))

    def edit(tools: Any, directory: Path) -> None:
        tools.delete_episodes(_open(root), numbers, output_dir=directory, repo_id=_name(target))

    return _write(target, [root], edit)[""]


def split(root: Path, parts: Mapping[str, Sequence[int]], target: Path) -> dict[str, list[int]]:
    """Write parts of a dataset as datasets of their own.

    Args:
        root: The dataset.
        parts: Name of each part -> numbers of its episodes. Episodes of no part are left out.
        target: New folder, with a folder for each part in it.

    Returns:
        Name of each part -> numbers of its episodes whose record was not found.

    Raises:
        UsageError: If ``target`` exists, a number is not there or in two parts, or a part is empty.
        FormatError: If the dataset is damaged.
        ModuleNotFoundError: If lerobot is not installed.
    """
    owners: dict[int, str] = {}
    for name, episodes in parts.items():
        if not episodes or not name or Path(name).name != name:
            raise UsageError(
                f"part {name!r} with {len(episodes)} episodes",
                "a plain name and one episode or more",
                "name it as in --part train=0-7",
            )
        if (twice := next((number for number in episodes if number in owners), None)) is not None:
            raise UsageError(
                f"episode {twice} in the parts {owners[twice]} and {name}",
                "each episode in one part at most",
                "take it out of one",
            )
        owners |= dict.fromkeys(episodes, name)
    _check_numbers(root, list(owners))

    def edit(tools: Any, directory: Path) -> None:
        tools.split_dataset(_open(root), {name: sorted(part) for name, part in parts.items()}, output_dir=directory)

    return _write(target, [root], edit, tuple(parts))


def merge(roots: Sequence[Path], target: Path) -> list[int]:
    """Write datasets below each other as one.

    Args:
        roots: The datasets, in the order of their episodes.
        target: Folder of the new dataset.

    Returns:
        Numbers of the new dataset's episodes whose record was not found.

    Raises:
        UsageError: If ``target`` exists, or two of the datasets hold the same recording.
        FormatError: If a dataset is damaged, or their columns or rates differ.
        ModuleNotFoundError: If lerobot is not installed.
    """
    if len(roots) < 2:
        raise UsageError(f"{len(roots)} datasets to merge", "two or more", "name them all")
    holders: dict[str, Path] = {}
    for root in roots:
        folder.read_info(root)
        records = metadata.read_records(root).values()
        if twice := next((record for record in records if record.recording in holders), None):
            raise UsageError(
                f"{holders[twice.recording]} and {root} both hold {twice.recording_file}",
                "each recording once: a copy in training and one in the test would flatter a network",
                "leave it out of one with tacdata dataset delete",
            )
        holders |= {record.recording: root for record in records}

    def edit(tools: Any, directory: Path) -> None:
        tools.merge_datasets([_open(root) for root in roots], output_repo_id=_name(target), output_dir=directory)

    return _write(target, roots, edit)[""]


def _check_numbers(root: Path, episodes: Sequence[int]) -> int:
    """Return how many episodes a dataset has, if all of these are among them."""
    count = folder.read_info(root)["total_episodes"]
    if wrong := sorted(number for number in set(episodes) if not 0 <= number < count):
        raise UsageError(
            f"{root} has no episode {wrong[0]}", f"0 to {count - 1}", "look at the numbers with tacdata browse"
        )
    return count


def _write(
    target: Path, sources: Sequence[Path], edit: Callable[[Any, Path], None], parts: Sequence[str] = ("",)
) -> dict[str, list[int]]:
    """Let lerobot write into a hidden folder, restore dropped fields, carry the flags along, and rename the folder."""
    refuse_existing(target, append=False)
    for source in sources:
        # A damaged source is refused here: lerobot's error would not name it.
        folder.read_info(source)
    os.environ.setdefault("HF_HUB_OFFLINE", "1")  # before lerobot is imported: nothing here is on the hub
    from lerobot.datasets import dataset_tools

    target.parent.mkdir(parents=True, exist_ok=True)
    lacking = {}
    # Hidden beside the target, so that a crash leaves no half dataset under its name.
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as work:
        draft = Path(work) / target.name
        try:
            with _quiet():
                edit(dataset_tools, draft)
        except (ValueError, KeyError, RuntimeError, OSError) as error:
            reason = next(iter(str(error).splitlines()), type(error).__name__)
            raise FormatError(
                f"lerobot cannot write {target}: {reason}",
                "whole datasets with the same columns, rate and robot_type",
                "compare their meta/info.json; pack the sessions again if one is damaged",
            ) from error
        for part in parts:
            lacking[part] = restore(draft / part, sources)
            for source in sources:
                carry_flags(source, draft / part)
                carry_notes(source, draft / part)
        os.replace(draft, target)
    return lacking


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the log of lerobot: above all a page on a video decoder, which our datasets have no use for."""
    level = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(level)


def _open(root: Path) -> Any:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    return LeRobotDataset(_name(root), root=root)


def _name(root: Path) -> str:
    """Return lerobot's name of a dataset that is on no hub."""
    return f"local/{root.resolve().name}"
