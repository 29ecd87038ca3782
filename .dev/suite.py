"""Run the checks and the tests.

Without arguments: lint, import directions, types, the site and the quick tests. `--long`: those that are long by
nature (tests/running/long_part.py). `--ci`: the quick ones, then of the long ones what changed since they last passed.
Other arguments go to pytest: to one process, unless with one of these two.

All checks run even if one fails; the exit status is that of the first that failed. The last line is pytest's summary.
"""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
WAITING = 2
"""Test processes that take what waits for a clock, beside one a core that computes."""
MOST = 8
"""Computing test processes at most: each takes 1 to 2 GB."""
PACKAGES = ("tacdata", "label_farm", "training", "viewers", "schemas")
NO_TESTS = 5
"""Pytest's exit status if none was to run."""
MOST_OF_A_LINE = 1000
"""Characters kept of what pytest says, to find its last line."""


class Checks:
    """Runs commands, prints each under its name, and keeps what failed."""

    def __init__(self):
        self.failed = {}
        self.summaries = []
        self.begin = time.monotonic()

    def run(self, name, command, **options):
        """Run a command whose words go to the terminal."""
        self._head(name, command)
        self._note(name, subprocess.run(command, cwd=ROOT, check=False, **options).returncode)

    def tests(self, name, *arguments, perhaps_none=False):
        """Run pytest and keep its last line; say whether there may be nothing to do."""
        command = [sys.executable, "-m", "pytest", *arguments]
        self._head(name, command)
        said = ""
        # One thread a process: more would only wait for those of the others. Where a verb takes two, they sleep while
        # they wait: by default they spin, which costs three times the work on a machine whose cores are all taken.
        environment = {
            **_compiling(),
            "OMP_NUM_THREADS": str(max(1, _cores() // MOST)),
            "OMP_WAIT_POLICY": "PASSIVE",
            "PYTHONUNBUFFERED": "1",
        }
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, env=environment) as done:
            # Piece by piece: pytest's dots come long before the end of their line.
            while piece := os.read(done.stdout.fileno(), 65536).decode(errors="replace"):
                print(piece, end="", flush=True)
                said = (said + piece)[-MOST_OF_A_LINE:]
        self._note(name, 0 if perhaps_none and done.returncode == NO_TESTS else done.returncode)
        self.summaries.append(said.strip().rpartition("\n")[2])

    def end(self):
        """Print what failed, and the summaries of all test runs as one; return the exit status."""
        if self.failed:
            print(f"\nfailed: {' '.join(self.failed)}", file=sys.stderr, flush=True)
        if self.summaries:
            print(_sum(self.summaries, time.monotonic() - self.begin), flush=True)
        return next(iter(self.failed.values()), 0)

    def _head(self, name, command):
        print(f"\n== {name}: {' '.join(os.path.relpath(c, ROOT) if c.startswith(str(ROOT)) else c for c in command)}")
        sys.stdout.flush()

    def _note(self, name, code):
        if code < 0:
            print(f"{name}: killed by signal {-code}", flush=True)
        if code:
            self.failed[name] = abs(code)


def _compiling():
    """Return the environment, with what was compiled kept: many tests start a process."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def _cores():
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _sum(lines, seconds):
    """Return one line like pytest's of several: "3 passed, 1 skipped in 2.00s"."""
    counts = {}
    for line in lines:
        for count, what in re.findall(r"(\d+) ([a-z]+)", line.split(" in ")[0]):
            what = {"errors": "error", "warnings": "warning"}.get(what, what)
            # Either part leaves out all tests of the other.
            if what != "deselected":
                counts[what] = counts.get(what, 0) + int(count)
    words = ", ".join(f"{count} {what}" for what, count in counts.items()) or "no tests ran"
    return f" {words} in {seconds:.2f}s ({time.strftime('%H:%M:%S', time.gmtime(seconds))}) ".center(100, "=")


def _side_by_side(computing, waiting):
    return ["--numprocesses", str(computing + waiting), "--waiting", str(waiting)]


def main(arguments):
    """Return the exit status."""
    checks = Checks()
    ours = {"--long", "--ci"} & set(arguments)
    # Once for all: else every test process, started at the same time, compiles all that is new here.
    compiling = [
        subprocess.Popen([sys.executable, *words], cwd=ROOT, env=_compiling())
        for words in (["-m", "compileall", "-q", *PACKAGES], ["tests/running/rewritten.py"])
    ]
    checks.run("lint", [str(BIN / "ruff"), "check", "."])
    checks.run("format", [str(BIN / "ruff"), "format", "--check", "--quiet", "."])
    checks.run("imports", [str(BIN / "lint-imports")])
    checks.run("types", [str(BIN / "ty"), "check", "--no-progress"])
    site = ["-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(ROOT / "build" / "site")]
    checks.run("site", [sys.executable, *site], env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    for process in compiling:
        process.wait()
    rest = [argument for argument in arguments if argument not in ours]
    if not arguments or "--ci" in ours:
        checks.tests("tests", *_side_by_side(min(_cores(), MOST), WAITING), *rest)
    elif not ours:
        checks.tests("tests", *arguments)
    if ours:
        which = "changed" if "--ci" in ours else "all"
        # One that holds a rig to the clock or fills the machine with workers, and one that computes beside it.
        checks.tests("long part", f"--long={which}", *_side_by_side(1, 1), *rest, perhaps_none=True)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
