"""The visits of one unit in the order of time, each compared with the one before it and with the first."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.health.comparison import (
    Change,
    VisitComparison,
    compare,
    corrected,
    model_gains,
    repeatability_changes,
    wiring_alone,
)
from tacdata.health.gains import GainFit
from tacdata.health.network_error import NetworkError
from tacdata.health.visit import Visit
from tacdata.health.wiring import Wiring


@dataclass(frozen=True)
class History:
    """Visits and the changes between them."""

    visits: tuple[Visit, ...]
    """In the order of time."""
    comparisons: tuple[tuple[VisitComparison, ...], ...]
    """Comparisons of each visit with the one before it and, if different, with the first. None for the first visit."""
    model: tuple[GainFit | None, ...]
    """Gains of each visit relative to the model's predictions; None without labels."""
    network: Mapping[int, NetworkError]
    """Number of a visit -> errors of the network."""

    @property
    def last(self) -> Visit:
        """The latest visit."""
        return self.visits[-1]

    @property
    def wiring(self) -> Wiring:
        """Faults of the channels at the latest visit."""
        return self.wiring_at(len(self.visits) - 1)

    def wiring_at(self, number: int) -> Wiring:
        """Return the faults of the channels at a visit."""
        comparisons = self.comparisons[number]
        return comparisons[-1].wiring if comparisons else wiring_alone(self.visits[number])

    def beside_first(self, number: int) -> VisitComparison | None:
        """Return the comparison of a visit with the first one; None for the first."""
        return self.comparisons[number][-1] if self.comparisons[number] else None

    @property
    def changed(self) -> tuple[tuple[int, Change], ...]:
        """Changes at the latest visit, each with the number of the visit that it is compared with.

        A change against both the visit before and the first is listed once, against the visit before.
        """
        if not self.comparisons[-1]:
            return tuple((0, change) for change in repeatability_changes(self.last) if change.changed)
        latest: dict[tuple[str, int | None], tuple[int, Change]] = {}
        for comparison in self.comparisons[-1]:
            for change in comparison.changes:
                if change.changed:
                    latest.setdefault((change.quantity, change.channel), (comparison.against, change))
        return tuple(latest.values())


def history(visits: Sequence[Visit], network: Mapping[str, NetworkError] | None = None) -> History:
    """Put the visits of one unit in order and compare them.

    Args:
        visits: Sessions as measured, in any order.
        network: Folder of a session -> errors of one network at it.

    Raises:
        UsageError: If there are none, one is given twice, or they are of several units.
    """
    ordered = in_order(visits)
    errors = {
        k: network[str(v.session.folder)] for k, v in enumerate(ordered) if network and str(v.session.folder) in network
    }
    comparisons: list[tuple[VisitComparison, ...]] = [()]
    for number in range(1, len(ordered)):
        group = []
        for against in dict.fromkeys((number - 1, 0)):
            pair = (errors[number], errors[against]) if number in errors and against in errors else None
            group.append(compare(ordered[number], ordered[against], against, pair))
        comparisons.append(corrected(group))
    model = tuple(
        model_gains(visit, group[-1].wiring if group else wiring_alone(visit)) if visit.predicted else None
        for visit, group in zip(ordered, comparisons, strict=True)
    )
    return History(tuple(ordered), tuple(comparisons), model, errors)


def in_order(visits: Sequence[Visit]) -> list[Visit]:
    """Return the visits of one unit in the order of time.

    Raises:
        UsageError: If there are none, one is given twice, or they are of several units.
    """
    if not visits:
        raise UsageError("no session", "one or more sessions of one unit", "name the folder of a session")
    units: dict[str, list[Path]] = {}
    for visit in visits:
        taxels = visit.sensor.taxels
        kind = f"{visit.sensor.name} ({taxels.columns} x {taxels.rows} taxels of {taxels.pitch_x:g} x "
        units.setdefault(f"{kind}{taxels.pitch_y:g} mm)", []).append(visit.session.folder)
    if len(units) > 1:
        named = "; ".join(f"{name}: {', '.join(p.name for p in paths)}" for name, paths in units.items())
        typed = "; ".join("tacdata health " + " ".join(map(str, paths)) for paths in units.values())
        one = "; if it is one unit, import its visits with one mapping: the name of the sensor is the unit's"
        remedy = f"ask for each: {typed}" + one * (len({kind.rpartition(" (")[2] for kind in units}) == 1)
        raise UsageError(f"sessions of {len(units)} units: {named}", "sessions of one unit", remedy)
    folders = [visit.session.folder.resolve() for visit in visits]
    twice = {path.name for path in folders if folders.count(path) > 1}
    if twice:
        raise UsageError(f"{', '.join(sorted(twice))} given twice", "each session once", "leave one out")
    return sorted(visits, key=lambda visit: (visit.started, visit.name))
