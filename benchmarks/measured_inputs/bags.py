"""Bags of ROS 1 and 2 and MCAP of other writers, of several kinds of fault."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from truth import FIRST_STAMP, measured, presses

SECOND = 1_000_000_000
"""Nanoseconds of a second."""


def _json_log(
    path: Path,
    *,
    log: Callable[[float], float] = lambda t: FIRST_STAMP + t,
    sent: Callable[[float], float] = lambda t: FIRST_STAMP + t,
    by_topic: bool = False,
    encoding: str = "json",
    **options: Any,
) -> None:
    """Write an MCAP of a lab's own writer: /stage at 50 Hz, /board at 20 Hz, messages in JSON."""
    from mcap.writer import Writer

    messages = [(r[0], "/stage", {"depth": r[1]}) for r in presses(rate=50).tolist()]
    messages += [(r[0] + 0.003, "/board", {"c": r[2:]}) for r in presses().tolist()]
    messages.sort(key=lambda m: (m[1], m[0]) if by_topic else m[0])
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="", library="lab 0.1")
        schemas = {
            "/stage": {"type": "object", "properties": {"depth": {"type": "number", "description": "mm"}}},
            "/board": {"type": "object", "properties": {"c": {"type": "array", "items": {"type": "number"}}}},
        }
        channels = {
            topic: writer.register_channel(
                topic, encoding, writer.register_schema(topic[1:], "jsonschema", json.dumps(schema).encode())
            )
            for topic, schema in schemas.items()
        }
        for time, topic, content in messages:
            writer.add_message(
                channels[topic],
                log_time=round(log(time) * SECOND),
                publish_time=round(sent(time) * SECOND),
                data=json.dumps(content).encode(),
            )
        writer.finish()


@measured(6)
def json_in_mcap(folder: Path) -> None:
    """MCAP with messages in JSON: two topics of other rates, or refused with the way out."""
    _json_log(folder / "run.mcap")


@measured(1)
def topic_after_topic(folder: Path) -> None:
    """MCAP, one topic after the other in the file: read in the order of time."""
    _json_log(folder / "run.mcap", by_topic=True, chunk_size=4096)


@measured(1, told="time|stamp|received")
def log_time_of_zero(folder: Path) -> None:
    """MCAP whose writer left log_time 0 and set publish_time alone: 20 Hz, told or refused."""
    _json_log(folder / "run.mcap", log=lambda t: 0)


@measured(1, told="Hz|fast|publish|received")
def log_time_of_conversion(folder: Path) -> None:
    """MCAP converted later: log_time is the time of the conversion, 100 times faster; publish_time is right."""
    _json_log(folder / "run.mcap", log=lambda t: FIRST_STAMP + t / 100)


@measured(11, told="flatbuffer")
def flatbuffer_in_mcap(folder: Path) -> None:
    """MCAP with messages in a flatbuffer: refused by that name."""
    _json_log(folder / "run.mcap", encoding="flatbuffer")


@measured(11, told="protobuf")
def protobuf_in_mcap(folder: Path) -> None:
    """MCAP with messages in protobuf: refused by that name."""
    _json_log(folder / "run.mcap", encoding="protobuf")


@measured(11, told="snappy")
def unknown_compression(folder: Path) -> None:
    """MCAP with a compression that nobody knows: refused by that name."""
    _json_log(folder / "run.mcap", use_chunking=True)
    path = folder / "run.mcap"
    data = path.read_bytes()
    for known in (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4"):
        data = data.replace(known, known[:4] + b"snappy"[: len(known) - 4])
    path.write_bytes(data)


@measured(7, recordings=2, needed="cut|end|damaged|complete|summary|left out")
def killed_recorder(folder: Path) -> None:
    """MCAP whose recorder was killed: no summary, the last chunk cut: presses before it stay, told."""
    _json_log(folder / "run.mcap", chunk_size=2048)
    data = (folder / "run.mcap").read_bytes()
    (folder / "run.mcap").write_bytes(data[: int(len(data) * 0.6)])


@measured(7, needed="chunk|damaged|gap|missing|crc", aligned=False)
def damaged_chunk(folder: Path) -> None:
    """MCAP with one damaged chunk in the middle: its messages are missing, told."""
    _json_log(folder / "run.mcap", chunk_size=2048)
    data = bytearray((folder / "run.mcap").read_bytes())
    data[len(data) // 3 : len(data) // 3 + 200] = bytes(200)
    (folder / "run.mcap").write_bytes(bytes(data))


@measured(7, needed="chunks? (is|are) damaged", aligned=False)
def damaged_content(folder: Path) -> None:
    """MCAP with one chunk whose content is damaged: its messages are missing, told."""
    _json_log(folder / "run.mcap", chunk_size=2048)
    data = bytearray((folder / "run.mcap").read_bytes())
    begin = data.index(b"zstd", len(data) // 3) + 40
    data[begin : begin + 60] = bytes(60)
    (folder / "run.mcap").write_bytes(bytes(data))


def _bag(
    folder: Path,
    *,
    stamp: Callable[[int, float], float] = lambda k, t: FIRST_STAMP + t,
    log: Callable[[int, float], float] = lambda k, t: FIRST_STAMP + t + 0.02,
    rows: np.ndarray | None = None,
    first: bool = False,
    metres: bool = False,
    behind: int = 0,
) -> None:
    """Write a bag of ROS 2 or, with ``first``, ROS 1: /stage with a stamped pose, /board with a stamped state."""
    from rosbags.rosbag1 import Writer as First
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg("std_msgs/Header header\nfloat32[] capacitance", "lab_msgs/msg/Taxels"))
    time, header = types.types["builtin_interfaces/msg/Time"], types.types["std_msgs/msg/Header"]
    point, taxels = types.types["geometry_msgs/msg/PointStamped"], types.types["lab_msgs/msg/Taxels"]
    place = types.types["geometry_msgs/msg/Point"]
    writer = (
        First(folder / "run.bag") if first else Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    )
    pack = types.serialize_ros1 if first else types.serialize_cdr
    with writer:
        stage = writer.add_connection("/stage", point.__msgtype__, typestore=types)
        board = writer.add_connection("/board", taxels.__msgtype__, typestore=types)
        for number, row in enumerate((presses() if rows is None else rows).tolist()):
            moment = round(stamp(number, row[0]) * SECOND)
            extra = {"seq": number} if first else {}
            head, late = (
                header(stamp=time(sec=seconds, nanosec=moment % SECOND), frame_id="base", **extra)
                for seconds in (moment // SECOND, moment // SECOND - behind)
            )
            depth = 0.35 - row[1] / 1000 if metres else row[1]
            received = round(log(number, row[0]) * SECOND)
            for connection, message in (
                (stage, point(header=late, point=place(x=0.0, y=0.0, z=depth))),
                (board, taxels(header=head, capacitance=np.array(row[2:], np.float32))),
            ):
                writer.write(connection, received, pack(message, message.__msgtype__))


@measured(6)
def bag_of_ros_1(folder: Path) -> None:
    """A bag of ROS 1 with stamps: read, or refused with the way out."""
    _bag(folder, first=True)


@measured(1, needed="stamp|left out|out of line|time")
def stamps_of_zero(folder: Path) -> None:
    """A bag of ROS 2 whose first 20 stamps are 0, from before the clock came: 20 Hz, told."""
    _bag(folder, stamp=lambda k, t: 0 if k < 20 else FIRST_STAMP + t)


@measured(1, recordings=0, told="time goes back|copies|same")
def played_in_a_loop(folder: Path) -> None:
    """A bag recorded while another was played in a loop: stamps begin again; six presses, or three and told."""
    rows = np.concatenate([presses(), presses()])
    length = len(rows) // 2
    _bag(folder, rows=rows, stamp=lambda k, t: FIRST_STAMP + t,
         log=lambda k, t: FIRST_STAMP + 900 + t + 15 * (k >= length))  # fmt: skip


@measured(4, told="unit|metre|zero|depth 0|highest")
def pose_of_ros(folder: Path) -> None:
    """A bag of ROS 2 with a pose in metres, as the standard has it: 1.2 mm, told or asked."""
    _bag(folder, metres=True)


@measured(1, told="clock|overlap|common|time", recordings=0)
def stamps_of_two_clocks(folder: Path) -> None:
    """A bag whose stage stamps by its own clock, 120 s behind the board's: told or refused."""
    _bag(folder, behind=120)
