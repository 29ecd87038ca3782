"""The one command: finds the verbs in `tacdata/commands`, orders them as the pipeline, turns errors into words."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import typer

from tacdata import registry, stages
from tacdata.errors import TacdataError

ROOM, BASE = "tacdata.commands", "command"


def application() -> typer.Typer:
    """Build the command line from the folder `tacdata/commands`: one file, one verb."""
    app = typer.Typer(
        name="tacdata",
        help="The data engine for soft tactile skins. Verbs stand in the order of the pipeline.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
    )
    modules = [registry.load_module(ROOM, BASE, name) for name in registry.names(ROOM, BASE)]
    for module in sorted(modules, key=lambda m: (m.ORDER, m.__name__)):
        name = module.__name__.rsplit(".", 1)[-1].replace("_", "-")
        if hasattr(module, "__path__"):
            app.add_typer(_group(module), name=name, help=module.run.__doc__, rich_help_panel=module.PANEL)
        else:
            verb = interruptible(module.run)
            app.command(name=name, help=module.run.__doc__, rich_help_panel=module.PANEL)(verb)
    return app


def _group(room: ModuleType) -> typer.Typer:
    """Return a verb that is a folder: each file in it is a verb below it."""
    group = typer.Typer(no_args_is_help=True, rich_markup_mode="markdown")
    modules = [registry.load_module(room.__name__, BASE, name) for name in registry.names(room.__name__, BASE)]
    for module in sorted(modules, key=lambda m: (m.ORDER, m.__name__)):
        name = module.__name__.rsplit(".", 1)[-1].replace("_", "-")
        group.command(name=name, help=module.run.__doc__)(interruptible(module.run))
    return group


def interruptible(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Return the verb with an answer to Ctrl-C; Typer would end it without a word."""

    @functools.wraps(verb)
    def run(*arguments: Any, **options: Any) -> Any:
        try:
            return verb(*arguments, **options)
        except KeyboardInterrupt:
            print("interrupted: what was finished is kept", file=sys.stderr)
            raise typer.Exit(130) from None

    return run


def main() -> None:
    """Run the command line; an error meant for a person ends in words and a non-zero exit, never a traceback."""
    stages.follow()
    try:
        application()(prog_name="tacdata")
    except TacdataError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(error.exit_code) from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
