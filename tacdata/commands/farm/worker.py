"""Work for a label service from this computer."""

from typing import Annotated

import typer

from tacdata.commands.farm import command as service

ORDER = 60
EXAMPLES = (
    "tacdata farm worker http://HOST:8765",
    "tacdata farm worker http://HOST:8765 --processes 4",
    "tacdata farm worker tcp://HOST:8786",
)


def run(
    url: Annotated[
        str,
        typer.Argument(envvar="TACDATA_FARM_URL", help="The service, http://HOST:PORT; or a Dask scheduler, tcp://…"),
    ],
    token: service.Token = "",
    processes: Annotated[int | None, typer.Option(min=1, help="Worker processes; else one a GPU or core.")] = None,
    device: Annotated[
        list[str] | None, typer.Option(help="What they solve on: cpu, cuda for all GPUs, cuda:0, ...")
    ] = None,
    factory: Annotated[str, typer.Option(hidden=True, help="What builds the model: module:name.")] = "",
) -> None:
    """Solve presses for a service, or a Dask scheduler, elsewhere; Ctrl-C gives back unfinished presses."""
    if url.startswith(("tcp://", "tls://")):
        from tacdata.label_farm.workers.dask_pool import join

        join(url, processes, tuple(device or ()))
        return
    from tacdata.label_farm.remote.crew import Crew

    Crew(url, token, processes, tuple(device or ()), factory).work()
