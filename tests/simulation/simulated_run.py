"""One seed: a recording with faults, what must hold of it, then the person repairs the rig and resumes."""

import bisect
import random
import re
import sys
import tempfile
import time
import traceback
from pathlib import Path

import numpy as np
from drawn_faults import Faults
from schedule import SECOND, Hung
from simulated_host import EPOCH, START
from simulated_rig import CLEARANCE, ORIGIN, World

from tacdata.errors import TacdataError
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.registration.evidence import prove_zero

NEAR = 0.02
"""Difference of two positions that are the same [mm]: reports have three decimals."""
STOPPED = 0.5
"""Time from when a fault can be seen until the motion has stopped [s], beside the braking."""
BRAKING = 0.2
"""Longest braking [s]: 30 mm/s at 150 mm/s^2."""
HALTING = {"alarm", "brown_out"}
"""Faults after which a controller moves nothing, and says so."""
OFF = 0.06
"""Distance between the true path and the plan in a file that is complete [mm]: steps, reports, the judge's interval."""
UNLOCKED = (None, 2)
"""Alarms that a reset and ``$X`` end without a loss of the position: a soft limit is raised after braking to rest."""
COURSES = ("", "", "", "", "sync tap", "tools", "touch", "registration")
"""Courses that a seed draws: plain presses, or what may come before and between them."""
REPORT = 0.25
"""Longest interval of two reports, with their way [s]."""
STEP = 0.002
"""Way sideways that is none [mm]: half a motor step, on which a machine that lost its power need not stand."""
BUMP, TOUCHED = 1.0, 0.4
"""Rise of a sensor's stand that was bumped, and depth of a touch that notices it at most [mm]."""
LONG = 900.0
"""Time after which a course with a registration or a sync tap counts as hung [s]."""
LIFTABLE = {
    "board_freezes",
    "board_saturates",
    "board_unplugged",
    "board_stalls",
    "damaged_frame",
    "disk_full",
    "disk_slow",
    "foreign_hold",
    "foreign_override",
    "camera_hangs",
    "camera_unplugged",
    "computer_stalls",
    "damaged_lift",
    "camera_freezes",
    "reader_starves",
}
"""Faults that leave a controller able to lift the tip."""
IN_SKIN, WAIT = 0.05, 5.0
"""Depth at which a tip rests in the skin [mm], and the longest rest beyond the plan's hold [s]."""
OUTSIDE = 1.0
"""Time that the tip may be outside the envelope [s]: the interval of two reports, their way, the hold, the braking."""


class Run:
    """One attempt to record."""

    def __init__(self, world, resume=False, course=""):
        """Record, or carry out another ``course`` of `COURSES`, until it ends by itself or is killed."""
        self.course, self.is_registration = course, course == "registration"
        self.world, self.begin = world, world.schedule.now
        self.before = set(world.folder.glob("*.mcap")) if world.folder.exists() else set()
        self.session, self.error, self.hung = None, None, ""
        try:
            if self.is_registration:
                world.register()
            else:
                prove = prove_zero if course == "touch" else None
                self.session = world.record(resume, sync_tap=course == "sync tap", prove=prove)
        except Hung as error:
            self.hung = str(error)
        except (Exception, KeyboardInterrupt) as error:  # judged below
            self.error = error
        self.end = world.schedule.now
        self.killed = world.computer.killed
        self.words = "\n".join([str(self.error or ""), *getattr(self.error, "__notes__", ())])
        if course in ("touch", "registration") and not self.hung:  # no file is closed first: a hold still brakes
            world.schedule.run_for(BRAKING, world.bench)
        self.here = world.position()
        self.moves_at_the_end = world.controller.planner.moving(world.clock.now_ns())

    @property
    def path(self):
        """Times [s], true positions [mm], and whether it moves, while this ran."""
        table = between(self.world.path, self.begin, self.end)
        return table[:, 0], table[:, 1:4], table[:, 4] > 0


def between(path, begin, end):
    """Return the rows of `World.path` from one time to another [s], shape (rows, 6)."""
    first, last = bisect.bisect_left(path, (begin,)), bisect.bisect_right(path, (end, np.inf))
    return np.array(path[first:last], float).reshape(-1, 6)


def longest_rest(run):
    """Return the longest rest in the skin beyond the plan's hold [s].

    It ends at the latest when a person reads that the tip is not lifted: the machine obeys a person, or nobody. Time
    does not count in which this computer, or the thread that hears the controller, does not run: nobody knows then
    where the tip is.
    """
    world, longest = run.world, 0.0
    rows = between(world.path, run.begin, run.end)
    resting = (rows[:, 3] < ORIGIN[2] - IN_SKIN) & (rows[:, 4] == 0)
    for first, last in np.flatnonzero(np.diff([0, *resting, 0])).reshape(-1, 2):
        begin, end = rows[first, 0], rows[last - 1, 0]
        end = min([end, *(moment for moment in world.warned if moment >= begin)])
        longest = max(longest, _waking(world.computer, begin, end, "grbl-listen"))
    return max(longest - world.plan.motion.hold, 0.0)


def _waking(computer, begin, end, thread):
    """Return how much of a stretch of time [s] this computer runs a thread."""
    pauses = ((a / SECOND, b / SECOND) for a, b in [*computer.stalls, *computer.unheard(thread)])
    return end - begin - sum(max(0.0, min(end, b) - max(begin, a)) for a, b in pauses)


def broken(run, faults):
    """Yield what does not hold of a run, a sentence each."""
    if run.hung:
        yield f"hangs: {run.hung}"
        return
    known = run.error is None or isinstance(run.error, (TacdataError, KeyboardInterrupt))
    if not known:
        yield f"not an error for a person: {_traced(run.error)}"
    yield from _threads(run)
    if (rest := longest_rest(run)) > WAIT:
        yield f"the tip rested in the skin for {rest:.1f} s more than planned"
    yield from _motion(run, faults)
    yield from _tools(run)
    if not run.killed:
        yield from _words(run, faults)
        yield from _lifted(run, faults)
    yield from _files(run, faults)


def _traced(error):
    return "".join(traceback.format_exception(error))[-1500:]


def _threads(run):
    for task in run.world.schedule.tasks:
        if task.error is not None and task.name != "main":
            yield f"the thread {task.name} died: {_traced(task.error)}"
    left = [task.name for task in run.world.computer.tasks if not task.ended]
    starved = {thread for thread, *_ in run.world.computer.starved}  # ended by themselves once they run again
    left = [name for name in left if name not in starved]
    if left and not run.killed and not isinstance(run.error, KeyboardInterrupt):  # a second one ends all waiting
        yield f"threads that go on after the end: {left}"


def _motion(run, faults):
    times, places, _ = run.path
    if not len(times):
        return
    outside = np.any(
        (places < np.array(run.world.envelope["min"]) - NEAR) | (places > np.array(run.world.envelope["max"]) + NEAR),
        axis=1,
    )
    steps = np.diff(places, axis=0, prepend=places[:1])
    # A lift from below the envelope is the way back, and slow: 2.8 mm below take 1.4 s (seed 11549).
    lift = (places[:, 2] < run.world.envelope["min"][2]) & (steps[:, 2] > 0) & (np.abs(steps[:, :2]).max(axis=1) == 0)
    moving = outside & np.any(steps != 0, axis=1) & ~lift
    if moving.sum() * 0.01 > OUTSIDE and not faults.deaf:
        yield f"moved outside the envelope for {moving.sum() * 0.01:.2f} s, to {places[outside].min(axis=0)}"
    sideways = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
    down = -np.diff(places[:, 2])
    low = places[:-1, 2] < ORIGIN[2] + CLEARANCE - NEAR
    begun = np.flatnonzero(~low)
    first = begun[0] if len(begun) else len(low)
    astray = np.linalg.norm(places[: first + 1, :2] - places[0, :2], axis=1)
    if astray.max() > STEP or np.any(down[:first] > 1e-6):
        yield "the first move was not straight up"
    seen = faults.seen(cameras=not run.is_registration)  # in the sense of `Faults.see`; a registration opens none
    if seen is not None and not faults.deaf:
        late = times[:-1] > seen + STOPPED + BRAKING
        goes = np.flatnonzero(late & ((sideways > NEAR / 10) | (down > NEAR / 10)))
        if len(goes):
            yield f"a fault could be seen at {seen:.2f} s; it still went on at {times[goes[0]]:.2f} s"


def _tools(run):
    """Yield where the guide moved, or stood too low, while a person changed the tool."""
    for name, begun, ended in run.world.mounted:
        if begun[2] < ORIGIN[2] + CLEARANCE - NEAR or np.abs(ended - begun).max() > NEAR / 10:
            yield f"{name} was mounted between {begun} and {ended}"


def _lifted(run, faults):
    """Yield what is wrong with a tip that could have been lifted, and with a fault that had to end the run."""
    if (
        run.error is not None
        and faults.names
        and set(faults.names) <= LIFTABLE | {name for name in faults.names if "busy" in name}
    ):
        if run.here[2] < ORIGIN[2] + CLEARANCE - NEAR:
            yield f"the tip could be lifted and is at {run.here}; the words are:\n{run.words}"
    if (due := faults.due()) and due < run.end and not any(run.begin <= stop <= due for stop in run.world.stops):
        yield f"a fault had to be noticed by {due:.2f} s; the motion was stopped at {run.world.stops}"
    for begin, seconds in faults.stalls if run.error is None else ():
        if any(abs(row[0] - begin) < 0.05 and row[4] for row in run.world.path):
            yield f"this computer stood still for {seconds} s from {begin:.2f} s on in mid-move; it ended well"


def _words(run, faults):
    world, words = run.world, run.words
    if run.moves_at_the_end and "NOT KNOWN" not in words and not re.search("broke|closed", words):
        yield f"it moves after the end, and the words are:\n{words}"
    if run.error is None:
        return
    if "NOT KNOWN" in words and set(faults.names) & HALTING and set(faults.names) <= HALTING:
        yield f"the controller has stopped by itself, and the words are:\n{words}"
    done, stated = len(file_names.finished(world.folder)) if world.folder.exists() else 0, None
    if match := re.search(r"data:   (\d+) of \d+ presses are complete", words):
        stated = int(match[1])
    if "data:   nothing was written" in words:
        stated = 0
    if stated != done:
        yield f"{done} presses are on disk, and the words are:\n{words}"
    skin = run.here[2] < ORIGIN[2] - NEAR
    if world.lost:
        return
    lifted = re.search(r"straight up from (\S+) to (\S+) mm", words)
    if lifted and abs(float(lifted[2]) - run.here[2]) > NEAR and not faults.deaf:
        yield f"the tip is at {run.here}, and the words are:\n{words}"
    if skin and "not lifted" not in words and "nothing was moved" not in words:
        yield f"the tip is in the skin, at {run.here}, and the words are:\n{words}"
    if match := re.search(r"motion: (?:stopped|at rest) at \((\S+), (\S+), (\S+)\)", words):
        stated = np.array([float(value) for value in match.groups()])
        off = np.abs(stated - run.here)[: 2 if lifted else 3]
        if off.max() > NEAR and not faults.deaf:
            yield f"the tip is at {run.here}, and the words are:\n{words}"
    if "nothing was moved" in words and world.controller.planner.rest_ns is not None and run.begin == 0:
        yield f"something moved, and the words are:\n{words}"


def _files(run, faults):
    folder = run.world.folder
    if run.is_registration:
        return
    if not folder.exists():
        if run.error is None and not run.killed:
            yield "there is no session"
        return
    presses = len(run.world.plan.presses)
    finished = file_names.finished(folder)
    if run.error is None and not run.killed and len(finished) < presses:
        yield f"it ended well with {len(finished)} of {presses} presses"
    partial = list(folder.glob(f"*{file_names.PARTIAL}"))
    hurried = isinstance(run.error, KeyboardInterrupt)  # a second one ends the closing, too; --resume renames the file
    if partial and not (run.killed or hurried) and run.world.computer.disk.refused_ns is None:
        yield f"left half written: {[path.name for path in partial]}"
    for path in [*finished.values(), *file_names.unfinished(folder)]:
        # What the run before left half written is renamed by --resume: it was judged with that run's faults.
        left = path.with_name(path.name.split(".")[0] + file_names.PARTIAL)
        earlier = path in run.before or (path not in finished.values() and left in run.before)
        if path.stat().st_size == 0 or earlier:
            continue
        if path in finished.values() or run.world.computer.disk.refused_ns is None:
            yield from _frames(run, faults, path)


def _frames(run, faults, path):
    try:
        recording = read_recording(path)
    except TacdataError as error:
        if not run.killed:
            yield f"{path.name} cannot be read: {error}"
        return
    episode = recording.episode
    is_final = bool(file_names.EPISODE.fullmatch(path.name))
    whole = run.killed and path.name.endswith(file_names.PARTIAL)  # killed before it got its name: --resume gives it
    if is_final != episode.complete and not whole:
        yield f"{path.name} says complete: {episode.complete}"
    if episode.complete:
        yield from _true_path(run, episode)
    counter = episode.taxels.counter
    touched = {"damaged_frame", "board_stalls", "board_unplugged", "damaged_lift"} & set(faults.names)  # unplugs it too
    if not touched and len(counter) and np.any(np.diff(counter) != 1):
        yield f"{path.name} lacks frames: {np.flatnonzero(np.diff(counter) != 1)}"
    for view in recording.cameras.values():
        if not {"camera_hangs", "camera_unplugged"} & set(faults.names) and np.any(np.diff(view.sequence) != 1):
            yield f"{path.name} lacks images: {np.flatnonzero(np.diff(view.sequence) != 1)}"
    if run.killed and path.name.endswith(file_names.PARTIAL) and not touched and not run.world.computer.stalls:
        last = (episode.taxels.arrival_ns[-1] - EPOCH - START) * 1e-9 if len(counter) else run.begin
        lost = _waking(run.world.computer, last, run.end, "taxel-board")  # what waits in a port dies with its reader
        if lost > 1.2 and len(counter) and not run.world.computer.disk.slow:
            yield f"{path.name} ends {lost:.2f} s before the kill"


def _true_path(run, episode):
    """Yield where the tip truly went elsewhere than the plan states, in a file that is complete."""
    if not episode.phases or episode.press.index < 0:
        return
    begin, end = ((t - EPOCH - START) * 1e-9 for t in (episode.phases[0].start_ns, episode.phases[-1].end_ns))
    rows = between(run.world.path, begin, end)
    if not len(rows):
        return
    press = run.world.plan.presses[episode.press.index]
    wanted = run.world.rig().registration.to_machine(press.x, press.y, press.depth)
    deepest = rows[int(np.argmin(rows[:, 3])), 1:4]
    if np.abs(deepest - wanted).max() > OFF:
        yield f"{episode.path.name} is complete, and the tip went to {deepest}, not to {np.round(wanted, 3)}"


def play(seed, only=(), presses=2):
    """Play one seed of so many presses; return (names of its faults, what did not hold, simulated seconds)."""
    with tempfile.TemporaryDirectory() as folder:
        draw = random.Random(f"rig {seed}")
        firmware = draw.choice(("Grbl", "Grbl", "grblHAL"))
        settings = draw.choice((None, None, {"$20": "0", "$22": "0"}))
        echo, camera = draw.random() < 0.3, draw.random() < 0.3
        more = {"echo": echo, "camera": camera}
        later = random.Random(f"later {seed}")  # of its own, so that seeds keep what they drew before
        more["zero"] = later.random() < 0.5
        course = random.Random(f"course {seed}").choice(COURSES)
        tools = course == "tools"
        machine = {"firmware": firmware, "settings": settings}
        world = World(seed, Path(folder) / "session", presses, tools=tools, **machine, **more)
        if course in ("sync tap", "registration"):
            world.schedule.extend(LONG)
        faults = Faults(world, seed, only)
        try:
            found = list(_play(world, faults, later.random() < 0.5, later.random() < 0.5, course))
        finally:
            faults.end()
            world.end()
        kind = [firmware, *(["no homing"] if settings else []), *(name for name, on in more.items() if on)]
        return [*kind, *([course] if course else []), *faults.names], found, world.schedule.now


def _play(world, faults, anew=False, unlocks=False, course=""):
    run = Run(world, course=course)
    world.is_new = False
    faults.end()
    yield from (f"first run: {words}" for words in broken(run, faults))
    if run.hung or (run.error is None and not run.killed):
        return
    world.reboot()
    world.schedule.run_for(0.1, world.bench)  # what went wrong at the very end has its effect
    alarm = world.controller.machine.alarm
    cut = run.killed and run.here[2] < ORIGIN[2] + CLEARANCE - NEAR  # nobody saw its motion end
    calm = world.repair(world.lost or alarm is not None, unlocks)
    # A hard limit may have cost steps even where it did not. No report states one of the last moments of a run.
    stated = "zero:   LOST" in run.words  # who reads that finds the zero again
    lost = world.lost or stated or (alarm not in UNLOCKED and not run.end - REPORT < faults.alarmed < np.inf)
    resume = world.folder.exists()
    before = world.path[-1][1:4] if world.path else None
    if lost or cut:
        if anew:  # people whose session broke begin a new folder
            world.folder, resume = world.folder.with_name("session2"), False
        run = Run(world, resume)
        yield from (f"without an answer: {words}" for words in broken(run, calm))
        if (resume or anew) and (run.error is None or np.abs(np.array(world.path[-1][1:4]) - before).max() > NEAR):
            yield f"it moved from a lost place without an answer; its words:\n{run.words}"
        world.reboot()
        if lost:
            world.home()
    world.answer = lambda question: True
    if course == "touch" and world.folder.exists():
        yield from _bumped(world, calm)
    run = Run(world, world.folder.exists())
    yield from (f"resumed: {words}" for words in broken(run, calm))
    if run.error is not None:
        yield f"does not resume: {run.words}"


def _bumped(world, calm):
    """Yield what does not hold where somebody bumped the sensor's stand before the session goes on."""
    world.raised = BUMP
    run = Run(world, True, "touch")
    yield from (f"bumped: {words}" for words in broken(run, calm))
    heights = run.path[1][:, 2]  # a tip that was left in the skin is first lifted
    clear = np.flatnonzero(heights > ORIGIN[2] + BUMP)
    deepest = ORIGIN[2] + BUMP - heights[clear[0] if len(clear) else 0 :].min(initial=np.inf)
    if run.error is None or deepest > TOUCHED:
        yield f"the skin is {BUMP} mm higher, and the tip went {deepest:.2f} mm into it; its words:\n{run.words}"
    world.raised = 0.0
    world.reboot()


def main(first, last):
    """Play seeds from ``first`` up to ``last`` and print those that fail; return how many did."""
    failed, seconds, begin = 0, 0.0, time.process_time()
    for seed in range(first, last):
        names, found, simulated = play(seed)
        seconds += simulated
        if found:
            failed += 1
            print(f"seed {seed} ({', '.join(names)}):", *found, sep="\n  ", flush=True)
    used = time.process_time() - begin
    print(f"{failed} of {last - first} seeds failed; {seconds:.0f} simulated s took {used:.0f} s of a core")
    return failed


if __name__ == "__main__":
    sys.path.append(str(Path(__file__).parents[1]))  # pyserial imports the lines by this folder's name
    sys.exit(bool(main(int(sys.argv[1]), int(sys.argv[2]))))
