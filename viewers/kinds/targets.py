"""Fingertip targets that `tacdata export` wrote for a robot, in any of its formats."""

from pathlib import Path

from tacdata.errors import UsageError
from tacdata.viewers.kinds.kind import Kind, refuse
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

MARKS = {
    "lerobot": "meta/tacdata_targets.json",
    "joints": "*.joints.parquet",
    "csv": "episode-*.csv",
    "parquet": "episode-*.parquet",
}
"""Format -> files of its folder; the first that fits is read."""
OURS = ("*.mcap", "*.tracks.parquet")
"""Files that no folder of targets contains."""


class TargetsKind(Kind):
    """One demonstration's targets."""

    ORDER, NOUN = 30, "a folder of tacdata export"

    def claims(self, path: Path) -> bool:
        """A folder with the files of one of the formats, and no recordings."""
        return path.is_dir() and _format(path) is not None

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return the targets of one demonstration, the first if none is named."""
        from tacdata.exporters.exporter import exporter
        from tacdata.exporters.joints import read_joints
        from tacdata.viewers.scenes.hand import targets_scene

        refuse(options, "targets", "episode")
        name, number = _format(path) or "", options.episode or 0
        if name == "joints":
            entries = [(targets, joints) for targets, joints, _ in read_joints(path)]
        else:
            entries = [(targets, None) for targets in exporter(name).read(path)]
        if number >= len(entries):
            raise UsageError(f"--episode {number}: not in {path}", f"0 to {len(entries) - 1}", "choose one of them")
        targets, joints = entries[number]
        title = f"{path.resolve().name}/{Path(targets.recording).stem}"
        return targets_scene(title, targets, len(entries) - 1, joints)


def _format(path: Path) -> str | None:
    if any(next(path.glob(pattern), None) for pattern in OURS):
        return None
    return next((name for name, pattern in MARKS.items() if next(path.glob(pattern), None)), None)
