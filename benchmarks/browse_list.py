"""Cost of opening a dataset of many episodes as a list, and one episode of it.

    python benchmarks/browse_list.py --episodes 1000

One made-up press (`view_open.py`) is packed again and again, each time at another depth and time. Then the list is made
as `tacdata browse` makes it, and one episode as `tacdata view DATASET --episode N`, each in a process of its own, with
its imports.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from view_open import write

from tacdata.dataset.frames import recording_hash
from tacdata.dataset.pack import pack
from tacdata.labels import Label, read_label
from tacdata.recording.episode import Episode
from tacdata.recording.files.reader import read_episode

APART = 100_000_000_000
"""Time from one episode to the next [ns]."""
MEASURED = """
import json, resource, sys, time
begun = time.perf_counter()
from pathlib import Path
from tacdata.viewers.browse.list_sources import episodes_at
from tacdata.viewers.source import scene_at
root, number = Path(sys.argv[1]), int(sys.argv[2])
shown = len(episodes_at(root).entries) if number < 0 else len(scene_at(root, episode=number).frame_ns)
used = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps({"shown": shown, "wall s": time.perf_counter() - begun, "cpu s": used.ru_utime + used.ru_stime}))
"""


def episodes(base: Episode, count: int) -> Iterator[Episode]:
    """Yield the press again and again, at other depths and times."""
    for k in range(count):
        shift, taxels = k * APART, base.taxels
        yield replace(
            base,
            path=Path(f"made-up/episode-{k:06d}.mcap"),
            press=replace(base.press, index=k, depth=0.3 + 1e-3 * k),
            taxels=replace(taxels, sample_ns=taxels.sample_ns + shift, arrival_ns=taxels.arrival_ns + shift),
            tip_ns=base.tip_ns + shift,
            phases=tuple(replace(p, start_ns=p.start_ns + shift, end_ns=p.end_ns + shift) for p in base.phases),
        )


def made(root: Path, count: int) -> Path:
    """Write the dataset; return its folder."""
    recording = write(root, 0.1, 30.0, 0.0, True)
    base, label = read_episode(recording), read_label(root / "labels" / f"{recording.stem}.parquet")

    def label_of(own: Episode) -> Label:
        parents = {**label.provenance["parents"], "recording": recording_hash(own)}
        provenance = {**label.provenance, "parents": parents}
        return replace(label, episode=own.number, time_ns=own.taxels.sample_ns, provenance=provenance)

    pack(episodes(base, count), label_of, root / "dataset")
    return root / "dataset"


def main() -> None:
    """Write the dataset, open it as a list and one of its episodes three times each, print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--episodes", type=int, default=1000)
    count = parser.parse_args().episodes
    with tempfile.TemporaryDirectory() as temporary:
        root = made(Path(temporary), count)
        size = sum(file.stat().st_size for file in root.rglob("*") if file.is_file())
        print(f"{count} episodes, {size / 1e6:.0f} MB")
        for name, number in (("list", -1), ("one episode", 3 * count // 4)):
            for _ in range(3):
                command = [sys.executable, "-c", MEASURED, str(root), str(number)]
                done = subprocess.run(command, check=True, capture_output=True, text=True)
                print(name, {k: round(v, 2) for k, v in json.loads(done.stdout).items()})


if __name__ == "__main__":
    main()
