"""Depth maps while a sensor is touched."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import HANDS, Result
from tacdata.progress import say

if TYPE_CHECKING:
    from tacdata.live.live_loop import LiveLoop

ORDER = 40
PANEL = HANDS
EXAMPLES = (
    "tacdata live shipped --rig rig.yaml",
    "tacdata live shipped --rig rig.yaml --view window",
    "tacdata live network --rig demo_rig.yaml --finger index --socket 7000",
)


def run(
    network: Annotated[str, typer.Argument(help="A training run or checkpoint, fitted to this unit; or `shipped`.")],
    rig: Annotated[Path, typer.Option(help="Rig or demo rig file: which board.")],
    finger: Annotated[str | None, typer.Option(help="With a demo rig: whose board; default: the first.")] = None,
    causal: Annotated[
        bool, typer.Option("--causal", help="Estimate the newest frame, without waiting for the network's look-ahead.")
    ] = False,
    socket: Annotated[int | None, typer.Option(help="Port on this machine to send messages to; 0: a free one.")] = None,
    maps: Annotated[bool, typer.Option(help="With --socket: whole maps in the messages.")] = True,
    view: Annotated[str | None, typer.Option(metavar="WHERE", help="Rerun: window, web, or a file (.rrd).")] = None,
    tare: Annotated[float, typer.Option(help="How long nothing touches the skin at the beginning [s].")] = 1.0,
    seconds: Annotated[float | None, typer.Option(help="End after so long [s]; default: Ctrl-C.")] = None,
) -> Result:
    """Show depth map and contact centre at the sensor's rate, with their latency; send them to a socket or Rerun."""
    from contextlib import ExitStack

    from tacdata.live.depth_stream import DepthStream
    from tacdata.live.live_loop import LiveLoop
    from tacdata.live.message_server import MessageServer
    from tacdata.live.source import touched_board
    from tacdata.recording.live.device_streams import stream_clock
    from tacdata.training.inference.sequence import window_map
    from tacdata.training.metrics import novelty
    from tacdata.training.pretraining.shipped import pretrained, unfitted

    trained = pretrained(network)
    source = touched_board(rig, finger, trained.sensor)
    trained.check_sensor(source.sensor, str(rig))
    offsets, readings = trained.network.offsets, novelty.read(trained.path.parent, trained.content_hash)
    stream = DepthStream(
        window_map(trained),
        offsets,
        source.sensor.map,
        stream_clock(source.board),
        round(tare * source.rate),
        causal,
        readings.novelty if readings else None,
    )
    say(_mode(trained.network.name, max(offsets), causal, source.rate))
    if words := unfitted(trained):
        print(f"note: {words}", flush=True)
    with ExitStack() as stack:
        watch = server = None
        if view:
            from tacdata.viewers.live.window import live_view

            watch = stack.enter_context(live_view(view, source.sensor.taxels.columns, source.sensor.taxels.rows))
        if socket is not None:
            server = MessageServer(socket)
            stack.callback(server.close)
            where = f"127.0.0.1:{server.port}"
            print(f"messages: {where}, one line of JSON each (schemas/live_message.schema.json)", flush=True)
        stack.enter_context(source.board)
        say(f"{source.name}: taring, do not touch the skin")
        loop = LiveLoop(source, stream, trained.content_hash, server, watch, maps)
        # Without a terminal, as in a service, standard input may be closed or belong to somebody else.
        if sys.stdin.isatty():
            print("Enter tares again, Ctrl-C ends", flush=True)
            Thread(target=_tare_at_enter, args=(loop,), daemon=True).start()
        with _stopping(loop):
            loop.run(seconds, say)
    figures = loop.meter.figures
    print(figures.text if figures else "no estimate was made")
    lost = source.board.counts.lost
    print(f"board: {source.rate:g} Hz, {lost} frames lost, {loop.skipped} estimates left out as late")
    return Result({"latency": figures, "rate": source.rate, "lost": lost, "skipped": loop.skipped})


def _tare_at_enter(loop: LiveLoop) -> None:
    """Tare again at every typed line."""
    for _ in sys.stdin:
        loop.tare()


def _mode(name: str, lookahead: int, causal: bool, rate: float) -> str:
    """Print the delay by the network's look-ahead."""
    wait = f"{lookahead} frames, {1000 * lookahead / rate:.0f} ms at {rate:g} Hz"
    if lookahead <= 0:
        return f"network {name} needs no later frames: each estimate is of the newest one"
    if causal:
        return (
            f"causal: network {name} was trained to look {wait} ahead; the newest frame takes their place. That is "
            "right while a contact holds still and late while it changes; `tacdata train --network causal` needs none."
        )
    return f"network {name} looks {wait} ahead: every estimate is at least so old (with --causal it is not)"


@contextmanager
def _stopping(loop: LiveLoop) -> Iterator[None]:
    """Ctrl-C ends the loop and prints the measured figures."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    # The loop ends at the next frame, so that the figures of the whole run are printed.
    handlers = [signal.signal(number, lambda *_: loop.stop()) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, handlers, strict=True):
            signal.signal(number, handler)
