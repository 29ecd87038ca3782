"""Error of the network that ships where nothing is unknown: it gets the model's own forces, without noise.

    python benchmarks/learning_curve/model_forces.py SOLVED --contacts CONTACTS

The presses are those of `run.py`. This error is the network's own: neither gains nor noise nor another skin are in it.
The additional error on a rig comes from these.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import run
from wearing import DEEP, overlaps

from tacdata.training.frames.frames import Frames
from tacdata.training.pretraining.shipped import NAME, pretrained


def exact(folder: Path) -> Frames:
    """Return solved presses whose readings are the model's forces [N]."""
    frames = run.rig_frames(folder, 0)
    assert frames.taxel_force is not None
    return replace(frames, taxels=frames.taxel_force)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("--contacts", type=Path, required=True, help="solved presses of rig_contacts.yaml")
    parser.add_argument("--from", dest="start", default=NAME)
    arguments = parser.parse_args()
    network = pretrained(arguments.start).network
    network.is_calibrated = False  # it takes forces as they are
    frames = exact(arguments.solved)
    unseen = [span for span in frames.episodes if span.indenter in run.UNSEEN]
    edge = [span for span in frames.episodes if span not in unseen and run.at_edge(span, frames.sensor)]
    rest = [span for span in frames.episodes if span not in unseen and span not in edge]
    for name, spans in (("other presses", rest), ("unseen shapes", unseen), ("edge", edge)):
        print(name, {key: round(value, 3) for key, value in run.scores(network, run.part(frames, spans)).items()})
    inner = [s for s in unseen if s.indenter == "prism" and s.depth >= DEEP and not run.at_edge(s, frames.sensor)]
    print(f"prism, aligned IoU of {len(inner)}: {np.mean(overlaps(network, run.part(frames, inner))):.3f}")
    contacts = exact(arguments.contacts)
    for name, row in run.contacts(network, contacts).items():
        print(name, {key: round(value, 2) for key, value in row.items()})


if __name__ == "__main__":
    main()
