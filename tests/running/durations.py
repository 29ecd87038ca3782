"""What tests cost: seconds by the clock and of the processor. `--record-durations` writes those of each file down."""

import csv
import resource
from collections import defaultdict
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
RECORDED = TESTS / "running" / "durations.csv"
"""Seconds a file, by which long files start first (`side_by_side.py`)."""
SHOWN = 15


def recorded():
    """Return seconds by the clock of every recorded file, by its path in the repository."""
    with RECORDED.open(newline="") as stream:
        return {row["file"]: float(row["seconds"]) for row in csv.DictReader(stream)}


def processor_seconds():
    """Return what this process and those that it waited for have used of the processor [s]."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def pytest_addoption(parser):
    """Add the option that writes durations down."""
    parser.addoption(
        "--record-durations", action="store_true", help="write the seconds of each file that ran to durations.csv"
    )


def pytest_configure(config):
    """Time in every process; count in the one that the tests report to."""
    config.pluginmanager.register(Clock())
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Count(config))


class Clock:
    """Notes in every report what its phase used of the processor."""

    def __init__(self):
        self.before = processor_seconds()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self):
        """Note what was used since the report before."""
        report = yield
        now = processor_seconds()
        report.processor, self.before = now - self.before, now
        return report


class Count:
    """Adds up the reports of a run."""

    def __init__(self, config):
        self.config = config
        self.tests = defaultdict(lambda: [0.0, 0.0])

    def pytest_runtest_logreport(self, report):
        """Add a phase."""
        total = self.tests[report.nodeid]
        total[0] += report.duration
        total[1] += getattr(report, "processor", 0.0)

    def pytest_terminal_summary(self, terminalreporter):
        """Print rooms and the costliest tests, if there were many."""
        rooms, files = defaultdict(lambda: [0.0, 0.0]), defaultdict(lambda: [0.0, 0.0])
        for test, spent in self.tests.items():
            file = test.split("::")[0]
            for total in (rooms[file.split("/")[1]], files[file]):
                total[0] += spent[0]
                total[1] += spent[1]
        # The long tests of a file have a record of their own.
        if self.config.option.record_durations and not self.config.option.long:
            _record(files)
        if len(files) < 2:
            return
        terminalreporter.section("seconds by the clock, of the processor")
        for room, spent in sorted(rooms.items(), key=lambda pair: -pair[1][1]):
            terminalreporter.write_line(f"{spent[0]:8.1f} {spent[1]:8.1f}  {room}")
        longest = sorted(self.tests.items(), key=lambda pair: -max(pair[1]))[:SHOWN]
        terminalreporter.write_line(f"the {len(longest)} longest:")
        for test, spent in longest:
            terminalreporter.write_line(f"{spent[0]:8.1f} {spent[1]:8.1f}  {test.removeprefix('tests/')}")


def _record(files):
    kept = {file: f"{seconds:.1f}" for file, seconds in recorded().items() if (TESTS.parent / file).exists()}
    kept |= {file: f"{spent[0]:.1f}" for file, spent in files.items()}
    with RECORDED.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["file", "seconds"])
        writer.writerows(sorted(kept.items()))
