"""Whether damaged files end in words: each reader gets thousands of truncated, flipped, emptied and foreign files.

A reader must return, or raise one of our own errors, within 10 s and 1 GiB. Anything else is a fault, and is listed
with its seed. A process that ends by a signal is one as well, at its end too. Tables are also imported whole.

    python benchmarks/fuzz_readers.py [--tries N] [--first SEED] [--only NAME ...] [--json FILE]
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import logging
import os
import resource
import signal
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tacdata.errors import TacdataError

LONGEST, LARGEST = 10, 1 << 30
"""Time that a file may take [s], and memory of the process after it [byte]."""
KINDS = ("cut", "flip", "zero", "insert", "swap", "empty", "foreign")
"""Kinds of damage: cut off, bytes flipped, zeroed or inserted, two parts swapped, emptied, a file of another kind."""


def examples(folder: Path) -> dict[str, tuple[bytes, str, Callable[[Path], object]]]:
    """Return a whole file of each kind, its ending, and its reader."""
    import trimesh
    from scipy.io import savemat

    from tacdata import documents
    from tacdata.importing.formats.source_format import read_table
    from tacdata.indenters import from_document
    from tacdata.plans import read_plan
    from tacdata.recording.files.reader import read_recording
    from tacdata.replay.robot import read_robot
    from tacdata.sensor import default_sensor, read_sensor

    rng = np.random.default_rng(0)
    columns = {"t": np.arange(200) * 0.02, "cap0": rng.normal(20, 1, 200), "cap1": rng.normal(20, 1, 200)}
    found: dict[str, tuple[bytes, str, Callable[[Path], object]]] = {}

    def table(path: Path) -> object:
        return read_table(path)

    lines = [",".join(columns), *(",".join(f"{v:.5f}" for v in row) for row in zip(*columns.values(), strict=True))]
    text = "\n".join(lines).encode()
    found["csv"] = text, ".csv", table
    found["json"] = json.dumps({name: values.tolist() for name, values in columns.items()}).encode(), ".json", table
    by_row = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [json.dumps(dict(zip(columns, row, strict=True))) for row in by_row]
    found["jsonl"] = "\n".join(lines).encode(), ".jsonl", table
    found["import"] = _press_table(), ".csv", importer(folder)
    found["csv.gz"] = gzip.compress(text, mtime=0), ".csv.gz", table
    stream = io.BytesIO()
    np.savez_compressed(stream, **columns)
    found["npz"] = stream.getvalue(), ".npz", table
    stream = io.BytesIO()
    np.save(stream, columns["cap0"])
    found["npy"] = stream.getvalue(), ".npy", table
    savemat(folder / "a.mat", columns, do_compression=True)
    found["mat"] = (folder / "a.mat").read_bytes(), ".mat", table
    import pyarrow as pa
    from pyarrow import feather, parquet

    parquet.write_table(pa.table(columns), folder / "a.parquet")
    feather.write_feather(pa.table(columns), folder / "a.feather")
    with pa.ipc.new_stream(folder / "a.arrow", pa.table(columns).schema) as stream:
        stream.write_table(pa.table(columns))
    found["arrow"] = (folder / "a.arrow").read_bytes(), ".arrow", table
    found["parquet"] = (folder / "a.parquet").read_bytes(), ".parquet", table
    found["feather"] = (folder / "a.feather").read_bytes(), ".feather", table
    from openpyxl import Workbook

    book = Workbook()
    for row in zip(*columns.values(), strict=True):
        book.active.append([float(v) for v in row])
    book.save(folder / "a.xlsx")
    found["xlsx"] = (folder / "a.xlsx").read_bytes(), ".xlsx", table
    import h5py
    from nptdms import ChannelObject, TdmsWriter

    with h5py.File(folder / "a.h5", "w") as file:
        for name, values in columns.items():
            file.create_dataset(f"run/{name}", data=values, chunks=(50,), compression="gzip").attrs["units"] = "pF"
    found["h5"] = (folder / "a.h5").read_bytes(), ".h5", table
    with TdmsWriter(folder / "a.tdms") as file:
        file.write_segment([ChannelObject("run", name, values) for name, values in columns.items()])
    found["tdms"] = (folder / "a.tdms").read_bytes(), ".tdms", table
    plan = {
        "version": "1.0",
        "name": "p",
        "indenters": {"ball": {"shape": "sphere", "radius": 2.0}},
        "motion": {
            "clearance": 2.0,
            "travel_speed": 10.0,
            "approach_speed": 2.0,
            "press_speed": 1.0,
            "hold": 0.5,
            "rest": 0.5,
        },
        "presses": [{"indenter": "ball", "x": 0.0, "y": 0.0, "depth": 1.0}],
    }
    documents.write(folder / "plan.yaml", plan, "plan")
    documents.write(folder / "sensor.json", default_sensor().document, "sensor")
    found["plan"] = (folder / "plan.yaml").read_bytes(), ".yaml", read_plan
    found["sensor"] = (folder / "sensor.json").read_bytes(), ".json", read_sensor
    ball = trimesh.creation.icosphere(subdivisions=2, radius=2.0)
    for ending in (".stl", ".ply", ".obj"):
        ball.export(folder / f"ball{ending}")

        def solid(path: Path) -> object:
            return from_document({"shape": "mesh", "file": path.name}, "plan", path.parent)

        found[ending[1:]] = (folder / f"ball{ending}").read_bytes(), ending, solid
    urdf = (
        '<?xml version="1.0"?><robot name="a"><link name="b"/><link name="c"/><joint name="j" type="revolute">'
        '<parent link="b"/><child link="c"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    (folder / "robot.yaml").write_text("version: '1.0'\nname: a\nurdf: a.urdf\nfingers: {index: {link: c}}\n")

    def robot(path: Path) -> object:
        path.replace(folder / "a.urdf")
        return read_robot(folder / "robot.yaml")

    found["urdf"] = urdf.encode(), ".urdf", robot
    found["mcap"] = _recording(folder), ".mcap", read_recording
    found["mcap.json"] = _json_log(), ".mcap", topic_of("/board")
    for part in ("zarr.json", "c/0"):
        store = _store(folder / f"whole_{part.partition('.')[0].replace('/', '')}.zarr", columns)

        def array(path: Path, place: Path = store / "cap0" / part, store: Path = store) -> object:
            place.write_bytes(path.read_bytes())
            return read_table(store)

        found[f"zarr {part}"] = (store / "cap0" / part).read_bytes(), "." + part.rpartition(".")[2].strip("c/0"), array
    for ending in (".mcap", ".db3", ".bag"):
        found[f"bag{ending}"] = _bag(folder, ending), ending, topic_of("/taxels")
    return found


def topic_of(name: str) -> Callable[[Path], object]:
    """Return a reader of one topic of a bag."""
    from tacdata.importing.formats.source_format import read_table
    from tacdata.importing.mapping import ReadOptions

    return lambda path: read_table(path, ReadOptions(table=name))


def _json_log() -> bytes:
    """Return an MCAP file of another writer, with messages in JSON."""
    from mcap.writer import Writer

    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=1024)
    writer.start(profile="", library="lab")
    schema = writer.register_schema("board", "jsonschema", b"{}")
    channel = writer.register_channel("/board", "json", schema)
    for number in range(100):
        time_ns = 10**18 + number * 10**7
        content = json.dumps({"stamp": {"sec": number, "nsec": 5}, "c": [float(number), 1.0]}).encode()
        writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=content)
    writer.finish()
    return stream.getvalue()


def _store(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Write a Zarr store of some columns, one chunk each."""
    import zarr

    group = zarr.open_group(str(path), mode="w")
    for name, values in columns.items():
        group.create_array(name, data=values, chunks=(len(values),))
    return path


def _press_table() -> bytes:
    """Return a table of two presses."""
    time = np.arange(0, 8, 0.02)
    depth = np.interp(time % 4, [0, 1, 2, 3, 4], [-0.5, -0.5, 1.0, 1.0, -0.5])
    rows = [f"{t:.3f},{d:.4f},{20 + max(d, 0):.4f}" for t, d in zip(time, depth, strict=True)]
    return "\n".join(["t,depth,cap0", *rows]).encode()


def importer(folder: Path) -> Callable[[Path], object]:
    """Return a function that imports one table with columns t, depth and cap0 into a session, which is then removed."""
    from tacdata.importing.imported_session import import_session

    mapping = folder / "import.yaml"
    mapping.write_text(
        "version: '1.4'\nname: a\nfiles: {data: {path: '*.csv', time: {column: t, unit: s}}}\nsensor: {name: s}\n"
        "taxels: {file: data, columns: [cap0], unit: pF}\ntrials: {press_above: 0.3}\n"
        "position: {file: data, depth: {column: depth, unit: mm}}\n"
    )

    def whole(path: Path) -> object:
        with tempfile.TemporaryDirectory(dir=folder) as out:
            return import_session(path, mapping, Path(out) / "session")

    return whole


class _TooLong(BaseException):
    """A reader took longer than `LONGEST`."""


def _stop(*_: object) -> None:
    raise _TooLong


def _bag(folder: Path, ending: str) -> bytes:
    """Return a bag of ROS 2, or 1 for .bag, with one topic of readings."""
    from rosbags.rosbag1 import Writer as First
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    first = ending == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    floats = types.types["std_msgs/msg/Float32MultiArray"]
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    plugin = StoragePlugin.MCAP if ending == ".mcap" else StoragePlugin.SQLITE3
    bag = folder / (f"whole{ending}" if first else f"bag{ending[1:]}")
    pack = types.serialize_ros1 if first else types.serialize_cdr
    with First(bag) if first else Writer(bag, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/taxels", floats.__msgtype__, typestore=types)
        for number in range(100):
            message = floats(layout=layout, data=np.arange(6, dtype=np.float32) + number)
            writer.write(connection, 10**18 + number * 10**7, pack(message, floats.__msgtype__))
    return bag.read_bytes() if first else next(bag.glob(f"*{ending}")).read_bytes()


def _recording(folder: Path) -> bytes:
    """Return a recording, imported from a table."""
    from tacdata.importing.imported_session import import_session

    time = np.arange(0, 4, 0.02)
    depth = np.interp(time, [0, 1, 2, 3, 4], [-0.5, -0.5, 1.0, 1.0, -0.5])
    rows = [f"{t:.3f},{d:.4f},{20 + max(d, 0):.4f}" for t, d in zip(time, depth, strict=True)]
    source = folder / "source"
    source.mkdir()
    (source / "a.csv").write_text("\n".join(["t,depth,cap0", *rows]))
    mapping = folder / "mapping.yaml"
    mapping.write_text(
        "version: '1.2'\nname: a\nfiles: {data: {path: a.csv, time: {column: t, unit: s}}}\nsensor: {name: s}\n"
        "taxels: {file: data, columns: [cap0], unit: pF}\n"
        "position: {file: data, depth: {column: depth, unit: mm}}\n"
    )
    made = import_session(source, mapping, folder / "session")
    return next(iter(sorted(made.folder.glob("*.mcap")))).read_bytes()


def _memory() -> int:
    """Return the most memory that the process has used so far [byte]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def damaged(data: bytes, kind: str, others: list[bytes], rng: np.random.Generator) -> bytes:
    """Return a file with one kind of damage."""
    broken, at = bytearray(data), int(rng.integers(len(data)))
    match kind:
        case "cut":
            return bytes(broken[:at])
        case "flip":
            for place in rng.integers(len(data), size=int(rng.integers(1, 9))):
                broken[place] ^= int(rng.integers(1, 256))
        case "zero":
            broken[at : at + 64] = bytes(len(broken[at : at + 64]))
        case "insert":
            broken[at:at] = rng.bytes(int(rng.integers(1, 64)))
        case "swap":
            other = int(rng.integers(len(data)))
            broken[at : at + 32], broken[other : other + 32] = broken[other : other + 32], broken[at : at + 32]
        case "empty":
            return b""
        case "foreign":
            return others[int(rng.integers(len(others)))]
    return bytes(broken)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tries", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="first seed, to share readers among processes")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, _stop)
    logging.disable(logging.CRITICAL)
    result = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        known = examples(folder)
        others = [data for data, _, _ in known.values()]
        for what, (data, ending, read) in known.items():
            if chosen.only and what not in chosen.only:
                continue
            whole = folder / f"whole{ending}"
            whole.write_bytes(data)
            read(whole)
            counts: Counter[str] = Counter()
            faults: dict[str, int] = {}
            for seed in range(chosen.first, chosen.first + chosen.tries):
                rng = np.random.default_rng(seed)
                # A name of its own: readers may cache contents by name.
                path = folder / f"damaged_{seed}{ending}"
                path.write_bytes(damaged(data, KINDS[seed % len(KINDS)], others, rng))
                signal.alarm(LONGEST)
                try:
                    read(path)
                    counts["read"] += 1
                except _TooLong:
                    counts["fault"] += 1
                    faults.setdefault(f"longer than {LONGEST} s", seed)
                except TacdataError:
                    counts["refused"] += 1
                except Exception as error:
                    counts["fault"] += 1
                    where = traceback.extract_tb(error.__traceback__)[-1]
                    faults.setdefault(f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}", seed)
                signal.alarm(0)
                if (used := _memory()) > LARGEST and not any("memory" in words for words in faults):
                    counts["fault"] += 1
                    faults[f"memory of {used >> 20} MiB"] = seed
                path.unlink(missing_ok=True)
            result[what] = {**counts, "faults": faults}
            print(
                f"{what:<8} {chosen.tries} tries: {counts['read']} read, {counts['refused']} refused in words, "
                f"{counts['fault']} faults",
                flush=True,
            )
            for words, seed in faults.items():
                print(f"    {words} (first with seed {seed})", flush=True)
    if chosen.json:
        chosen.json.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
