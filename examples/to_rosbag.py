"""A recording as a bag of ROS 2, for its viewers and tools: python to_rosbag.py [SESSION/episode-000000.mcap BAG].

Readings, tip and further quantities keep their own times. It needs the extra `import`.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import tacdata as td

TYPES = get_typestore(Stores.ROS2_HUMBLE)
KIND = {name.rsplit("/", 1)[-1]: TYPES.types[name] for name in TYPES.types}


def readings(row):
    """Return a message of several numbers."""
    layout = KIND["MultiArrayLayout"](dim=[], data_offset=0)
    return KIND["Float64MultiArray"](layout=layout, data=np.asarray(row, dtype=np.float64))


def place(time_ns, tip):
    """Return the tip in the sensor's frame [m], z out of the skin."""
    stamp = KIND["Time"](sec=int(time_ns // 10**9), nanosec=int(time_ns % 10**9))
    point = KIND["Point"](x=tip[0] / 1000, y=tip[1] / 1000, z=-tip[2] / 1000)
    return KIND["PointStamped"](header=KIND["Header"](stamp=stamp, frame_id="sensor"), point=point)


def write(episode, bag):
    """Write an episode as a bag in MCAP; return the number of messages of each topic."""
    rows = [
        ("taxels", t, readings(row)) for t, row in zip(episode.taxels.sample_ns, episode.taxels.counts, strict=True)
    ]
    rows += [("tip", t, place(t, tip)) for t, tip in zip(episode.tip_ns, episode.tip, strict=True)]
    for stream in episode.measured:
        rows += [(stream.name, t, readings(row)) for t, row in zip(stream.sample_ns, stream.values, strict=True)]
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {name: message.__msgtype__ for name, _, message in rows}
        topics = {name: writer.add_connection(f"/{name}", kind, typestore=TYPES) for name, kind in kinds.items()}
        for name, time_ns, message in sorted(rows, key=lambda row: row[1]):
            writer.write(topics[name], int(time_ns), TYPES.serialize_cdr(message, message.__msgtype__))
    with Reader(bag) as reader:
        return {topic: connection.msgcount for topic, connection in reader.topics.items()}


if __name__ == "__main__":
    work = Path(tempfile.mkdtemp())
    source, target = map(Path, sys.argv[1:3]) if len(sys.argv) > 2 else (work / "session", work / "bag")
    if len(sys.argv) < 3:
        td.example_session(source)
        source = source / "episode-000000.mcap"
    for topic, count in write(td.read_episode(source), target).items():
        print(f"{topic}: {count} messages")
