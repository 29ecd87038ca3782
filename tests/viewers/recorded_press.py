"""The made-up press as a real recording, written by the recorder's own writer."""

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts, TaxelFrame
from tacdata.recording.files.writer import CubePoseRecord, EpisodeWriter, Header
from tacdata.recording.motion.move_times import Command
from tacdata.rig import Registration


def write_recording(path, episode, images):
    """Write an `Episode` and images of its camera as an MCAP file; return the file's path."""
    controller = {"settings": {}, "acceleration": [200.0] * 3, "max_rate": [50.0] * 3}
    header = Header(episode.press, episode.sensor, episode.rig, {}, {}, controller)
    writer = EpisodeWriter(path, header, Clock.start(), cameras=("top",))
    for command in commands(episode):
        writer.motion(command)
    stream = episode.taxels
    for arrival, sample, counter, counts in zip(
        stream.arrival_ns, stream.sample_ns, stream.counter, stream.counts, strict=True
    ):
        writer.taxels(TaxelFrame(int(arrival), int(counter), counts), int(sample))
    for sample, position, state in zip(episode.cnc.sample_ns, episode.cnc.position, episode.cnc.state, strict=True):
        writer.status(CncStatus(int(sample) - 2_000_000, int(sample) + 2_000_000, state, position, 90.0))
    tags = episode.tags[0]
    for k, (camera, sample, jpeg) in enumerate(images):
        writer.image(camera, sample + 5_000_000, sample, k, jpeg)
        seen = np.isfinite(tags.position[k]).all()
        pose = CubePoseRecord(tuple(tags.position[k]), tuple(tags.quaternion[k]), 0.3, 2) if seen else None
        writer.cube(camera, sample + 5_000_000, sample, k, pose)
    return writer.close(True, counts={"taxels": StreamCounts(received=len(stream.counter))})


def commands(episode):
    """Yield the moves and pauses that the made-up tip path would need, one for each stretch of it."""
    frame = episode.rig["registration"]
    registration = Registration(tuple(frame["origin"]), frame["yaw"])
    for k in range(len(episode.tip_ns) - 1):
        start_ns, end_ns = int(episode.tip_ns[k]), int(episode.tip_ns[k + 1])
        start, target = (np.array(registration.to_machine(*row)) for row in episode.tip[k : k + 2])
        seconds = (end_ns - start_ns) / 1e9
        distance = float(np.linalg.norm(target - start))
        phase = episode.phases[k].name if k < len(episode.phases) else ""
        if distance == 0:
            yield Command(phase, start, target, 0.0, seconds, start_ns, end_ns, f"G4 P{seconds:g}")
        else:
            yield Command(phase, start, target, distance / seconds, 0.0, start_ns, start_ns + 1_000_000, "G1")
