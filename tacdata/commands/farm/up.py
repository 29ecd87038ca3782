"""Start the label service."""

from pathlib import Path
from typing import Annotated

import typer

ORDER = 10
EXAMPLES = (
    "tacdata farm up --root /data",
    "tacdata farm up --root /data --host 0.0.0.0 --workers 4",
    "tacdata farm up --root /data --dask tcp://HOST:8786",
)


def run(
    root: Annotated[Path, typer.Option(help="Folder that sessions are named from; nothing outside it is touched.")] = (
        Path(".")
    ),
    store: Annotated[Path | None, typer.Option(help="Folder of solved presses; else ROOT/farm.")] = None,
    host: Annotated[str, typer.Option(help="Address to listen on; beyond 127.0.0.1 only with a token.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for any that is free.")] = 8765,
    token: Annotated[
        str, typer.Option(envvar="TACDATA_FARM_TOKEN", help="What every request must carry; 16 characters or more.")
    ] = "",
    workers: Annotated[int | None, typer.Option(min=0, help="Worker processes here; else one a GPU or core.")] = None,
    device: Annotated[
        list[str] | None, typer.Option(help="What workers solve on: cpu, cuda for all GPUs, cuda:0, ...")
    ] = None,
    dask: Annotated[
        str, typer.Option(help="Solve on a Dask cluster: tcp://HOST:PORT of its scheduler, or `here` to start one.")
    ] = "",
    factory: Annotated[str, typer.Option(hidden=True, help="What builds the model: module:name.")] = "",
) -> None:
    """Start the service and its page; Ctrl-C stops it, and the next one goes on."""
    from tacdata.label_farm.service.up import UpSettings, up

    up(
        UpSettings(
            root=root,
            store=store,
            host=host,
            port=port,
            token=token,
            workers=workers,
            devices=tuple(device or ()),
            dask=dask,
            factory=factory,
        )
    )
