"""Shared by the verbs of a service: its address and its token."""

from typing import Annotated

import typer

DEFAULT = "http://127.0.0.1:8765"
Url = Annotated[str, typer.Option(envvar="TACDATA_FARM_URL", help="Address of the service.")]
Token = Annotated[
    str, typer.Option(envvar="TACDATA_FARM_TOKEN", help="What the service was started with, if it was with one.")
]
