"""Cost of several threads of linear algebra in a verdict and in a press of the skin model.

    python benchmarks/threads.py

Each runs in a process of its own, as it ships and with the libraries' default number of threads. Run it on a machine
that does nothing else, in a shell that sets no number of threads.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WORLDS = Path(__file__).parent / "hidden_worlds"


def verdict(is_limited: bool) -> None:
    """Judge a hidden world as a user does, or with the default number of threads."""
    sys.path.insert(0, str(WORLDS))
    import numpy as np
    from judge import course_of, spec_of
    from worlds import written
    from worlds.cases import cases

    from tacdata.discrepancy.judge import judge

    case = next(case for case in cases("singles10", 97000, 0) if case.response == "fitted")
    with tempfile.TemporaryDirectory() as folder:
        written.write(Path(folder), case)
        world = Path(folder) / "worlds" / case.identity
        course, spec = course_of(dict(np.load(world / "recordings.npz"))), spec_of(world)
        timed(lambda: (judge if is_limited else judge.__wrapped__)(course, spec))


def press(is_limited: bool) -> None:
    """Solve a press and its error."""
    import tacdata as td

    skin, ball = td.Skin(), td.Press(td.indenter("sphere", radius=4.0), depth=0.8)
    timed(lambda: skin.solve(ball) if is_limited else type(skin).solve.__wrapped__(skin, ball))


def timed(run) -> None:
    """Run, and print seconds by the clock and of the processor."""
    begin, processor = time.perf_counter(), time.process_time()
    run()
    print(time.perf_counter() - begin, time.process_time() - processor)


JOBS = {"verdict": verdict, "press": press}


def main() -> None:
    """Print the table, or run one job."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("job", nargs="*", help="for the processes of the table: verdict or press, then one or default")
    if job := parser.parse_args().job:
        JOBS[job[0]](job[1] == "one")
        return
    print(f"{len(os.sched_getaffinity(0))} cores; seconds by the clock, and of the processor")
    print("| work | one thread | default | ratios |\n|---|---:|---:|---:|")
    for name in JOBS:
        seconds = []
        for threads in ("one", "default"):
            command = [sys.executable, __file__, name, threads]
            seconds.append([float(x) for x in subprocess.check_output(command, text=True).split()[-2:]])
        one, default = seconds
        texts = [f"{clock:.1f}, {processor:.1f}" for clock, processor in (one, default)]
        print(f"| {name} | {' | '.join(texts)} | {default[0] / one[0]:.2f}, {default[1] / one[1]:.2f} |")


if __name__ == "__main__":
    main()
