"""The episodes of a list as a dataset of Rerun's own catalogue server, for its table of recordings and its queries."""

import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from tacdata.errors import UsageError
from tacdata.viewers.browse.episode_list import EpisodeList
from tacdata.viewers.rerun.shield import LOOPBACK, shielded
from tacdata.viewers.rerun.timelines import HOST
from tacdata.viewers.rerun.window import GRPC_PORT, WEB_PORT, any_port, free_port, quiet_environment, running
from tacdata.viewers.scene.moments import moments

PORT = 51234
"""Rerun's own port of a catalogue; another where it is in use."""
BEGIN_LIMIT = 60.0
"""Time that the server may take until it answers [s]."""


LAYOUT = "layout.rbl"
_SECOND = 10**9


@dataclass(frozen=True)
class Catalogue:
    """A catalogue that is served."""

    page: str
    """Address of Rerun's web viewer, which opens the address behind `url=`."""
    address: str
    """Of the catalogue itself, for Rerun and its Python client."""
    dataset: str
    """Of the dataset in it; "" where the package datafusion is missing, by which Rerun's client asks."""
    deepest: dict[int, int]
    """Episode -> its deepest moment [ns]."""

    @property
    def whole(self) -> str:
        """Page that shows the table of recordings."""
        return self._page_of(self.dataset or self.address)

    def at_deepest(self, number: int) -> str:
        """Page that shows one episode at its deepest moment; "" where the dataset's address is not known."""
        if not self.dataset:
            return ""
        # A datetime holds microseconds, the moment is in nanoseconds.
        second, remainder = divmod(self.deepest[number], _SECOND)
        moment = f"{datetime.fromtimestamp(second, UTC):%Y-%m-%dT%H:%M:%S}.{remainder:09d}Z"
        return self._page_of(f"{self.dataset}?segment_id={_name(number)}#when={HOST}@{moment}")

    def _page_of(self, address: str) -> str:
        return f"{self.page}/?hide_welcome_screen&url={quote(address, safe='')}"


@contextmanager
def catalogue_server(
    listed: EpisodeList, labels: Path | None, predictions: Path | None, drawn: Callable[[int, int], None]
) -> Iterator[Catalogue]:
    """Draw every episode of a list, and serve them as one dataset while the context lasts, on the loopback only.

    Args:
        listed: Episodes of the page.
        labels: Folder of labels, as for `viewers.source.scene_at`.
        predictions: Folder of predictions, likewise.
        drawn: Called with how many are drawn, of how many.

    Yields:
        Served content.

    Raises:
        UsageError: If the list is empty, or the server does not begin.
    """
    if not listed.entries:
        raise UsageError(f"no episode of {listed.root} is left", "at least one", "leave --where out")
    name = listed.root.resolve().name
    port, web, grpc = free_port(PORT), any_port(), free_port(GRPC_PORT)
    viewer = ["--serve-web", "--bind", LOOPBACK, "--port", str(grpc), "--web-viewer-port", str(web)]
    with tempfile.TemporaryDirectory(prefix="tacdata-catalogue-") as folder, quiet_environment() as environment:
        layout = Path(folder) / LAYOUT
        served = layout.with_name("recordings")
        served.mkdir()
        deepest = _draw(listed, labels, predictions, served, layout, drawn)
        server = ["server", "--host", LOOPBACK, "--port", str(port), "--dataset", f"{name}={served}"]
        # The viewer outlives no page: both end with the context.
        with running(server, environment) as process, running(viewer, environment):
            _wait_for(port, lambda: process.poll() is None)
            address = f"rerun+http://{LOOPBACK}:{port}"
            dataset = _laid_out(address, name, layout) if find_spec("datafusion") else ""
            with shielded(web, free_port(WEB_PORT)) as page:
                yield Catalogue(page, address, dataset, deepest)


def _draw(
    listed: EpisodeList,
    labels: Path | None,
    predictions: Path | None,
    folder: Path,
    layout: Path,
    drawn: Callable[[int, int], None],
) -> dict[int, int]:
    """Write every episode, and the layout of the first for all; return each one's deepest moment [ns]."""
    from tacdata.viewers.rerun.backend import APPLICATION, RerunBackend
    from tacdata.viewers.rerun.blueprint import episode_blueprint
    from tacdata.viewers.source import scene_at

    deepest = {}
    for count, entry in enumerate(listed.entries, start=1):
        scene = scene_at(listed.root, labels, predictions, entry.number)
        RerunBackend(folder / f"{_name(entry.number)}.rrd", _name(entry.number)).draw(scene)
        if count == 1:
            episode_blueprint(scene, stands=True).save(APPLICATION, str(layout))
        deepest[entry.number] = dict(moments(scene))["deepest"]
        drawn(count, len(listed.entries))
    return deepest


def _name(number: int) -> str:
    return f"episode-{number:06d}"


def _laid_out(address: str, name: str, layout: Path) -> str:
    """Make a layout that of a whole dataset; return the dataset's address."""
    from rerun.catalog import CatalogClient

    dataset = CatalogClient(address).get_dataset(name)
    dataset.register_blueprint(layout.as_uri())
    return f"{address}/dataset/{dataset.id}"


def _wait_for(port: int, lives: Callable[[], bool]) -> None:
    end = time.monotonic() + BEGIN_LIMIT
    while lives() and time.monotonic() < end:
        with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1.0):
            return
        time.sleep(0.1)
    raise UsageError(
        f"Rerun's catalogue server does not answer on port {port}",
        f"an answer within {BEGIN_LIMIT:g} s",
        "look at the episodes with --web instead",
    )
