"""The one command: finds the verbs in `tacdata/commands`, orders them as the pipeline, turns errors into words."""

from __future__ import annotations

import functools
import inspect
import io
import itertools
import re
import sys
from collections.abc import Callable
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

try:
    import typer

    from tacdata import progress, registry, stages
    from tacdata.commands.command import Result
    from tacdata.errors import Exit, TacdataError, UsageError, refused_by_system
    from tacdata.extras import missing_package
except KeyboardInterrupt:  # these imports take most of the first half second
    print("interrupted", file=sys.stderr)
    raise SystemExit(130) from None

ROOM, BASE = "tacdata.commands", "command"
QUIET, JSON = "quiet", "as_json"
OPTIONS = {
    QUIET: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no hints: only results and errors.")],
    JSON: Annotated[bool, typer.Option("--json", help="Print the result as JSON; words go to standard error.")],
}
"""Options that the command line adds to verbs: the first to all, the second to those that return a `Result`."""


def application() -> typer.Typer:
    """Build the command line from the folder `tacdata/commands`: one file, one verb."""
    app = typer.Typer(
        name="tacdata",
        help="The data engine for soft tactile skins. Verbs stand in the order of the pipeline.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
        callback=_before,
    )
    for module, name in _members(ROOM):
        if _is_group(module):
            app.add_typer(_group(module, name), name=name, help=module.run.__doc__, rich_help_panel=module.PANEL)
        else:
            verb = answering(f"tacdata {name}", module.run)
            app.command(name=name, help=module.run.__doc__, rich_help_panel=module.PANEL)(verb)
    return app


def _is_group(verb: ModuleType) -> bool:
    return hasattr(verb, "__path__")


def _verbs(room: str = ROOM) -> tuple[Callable[..., Any], ...]:
    """Return the functions of a room's verbs, those of its groups among them."""
    modules = [module for module, _ in _members(room)]
    below = [_verbs(module.__name__) for module in modules if _is_group(module)]
    return (*(module.run for module in modules), *itertools.chain(*below))


@functools.lru_cache(maxsize=1)
def _command(verbs: tuple[Callable[..., Any], ...]) -> Any:
    """Return the command line as it is run, built once for a process that runs several verbs, or again for others."""
    return typer.main.get_command(application())


def _group(room: ModuleType, name: str) -> typer.Typer:
    """Return a verb that is a folder: each file in it is a verb below it."""
    group = typer.Typer(no_args_is_help=True, rich_markup_mode="markdown")
    for module, below in _members(room.__name__):
        verb = answering(f"tacdata {name} {below}", module.run)
        group.command(name=below, help=module.run.__doc__)(verb)
    return group


def _members(room: str) -> list[tuple[ModuleType, str]]:
    """Return a room's verbs and how they are typed, in their order."""
    modules = [registry.load_module(room, BASE, name) for name in registry.names(room, BASE)]
    modules.sort(key=lambda module: (module.ORDER, module.__name__))
    return [(module, module.__name__.rsplit(".", 1)[-1].replace("_", "-")) for module in modules]


def _version(asked: bool) -> None:
    if asked:
        from tacdata.provenance import code_version

        release, _, commit = code_version().partition("+g")
        print(f"tacdata {release}" + (f" (commit {commit})" if commit else ""))
        raise typer.Exit(Exit.DONE)


def _before(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Print release and commit.", is_eager=True, callback=_version)
    ] = False,
    quiet: OPTIONS[QUIET] = False,
) -> None:
    context.with_resource(progress.silenced(quiet))


def answering(name: str, verb: Callable[..., Any]) -> Callable[..., Any]:
    """Return a verb as the command line runs it.

    It gets ``--quiet``, and ``--json`` if it returns a `Result`. Ctrl-C and a missing package are answered in words.
    """
    signature = inspect.signature(verb, eval_str=True)
    added = [QUIET, *([JSON] if signature.return_annotation is Result else [])]

    @functools.wraps(verb)
    def run(*arguments: Any, **options: Any) -> Any:
        quiet, as_json = options.pop(QUIET, False), options.pop(JSON, False)
        try:
            with progress.silenced(quiet), redirect_stdout(sys.stderr) if as_json else nullcontext():
                result = verb(*arguments, **options)
        except KeyboardInterrupt as error:
            notes = last_words(error)
            remark = "" if notes else ": what was finished is kept"
            print("\n".join([f"interrupted{remark}", *notes]), file=sys.stderr)
            raise typer.Exit(Exit.INTERRUPTED) from None
        except ModuleNotFoundError as error:
            raise missing_package(error, name) or error from None
        except OSError as error:
            raise refused_by_system(error) or error from error
        if isinstance(result, Result):
            _end(result, as_json)
        return result

    extra = [
        inspect.Parameter(option, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=OPTIONS[option])
        for option in added
    ]
    parameters = [*signature.parameters.values(), *extra]
    run.__signature__ = signature.replace(parameters=parameters)  # ty: ignore[missing-attribute]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def last_words(error: BaseException | None) -> list[str]:
    """Return an error's notes on its end: its own, or those of the error that it came upon.

    A second Ctrl-C takes the place of the error that is on its way to the screen.
    """
    while error is not None:
        if notes := getattr(error, "__notes__", []):
            return [*notes]
        error = error.__context__
    return []


def _end(result: Result, as_json: bool) -> None:
    """Print a result as JSON if that was asked for, and end with the verb's exit code."""
    if as_json:
        print(result.text, flush=True)
    if isinstance(result.ends, TacdataError):
        raise result.ends
    if result.ends is not Exit.DONE:
        raise typer.Exit(result.ends)


MISTYPED: Any = typer.BadParameter.__mro__[1]
"""Typer's errors for a line that does not fit a verb."""


def in_words(error: Any) -> UsageError:
    """Return the fault of a typed line in three parts: given, allowed, remedy."""
    context, kind = error.ctx, type(error).__name__
    path = context.command_path if context else "tacdata"
    allowed = context.get_usage().removeprefix("Usage: ") if context else "tacdata VERB"
    remedy = f"{path} --help explains each"
    parameter = getattr(error, "param", None)
    if kind == "MissingParameter" and parameter is not None:
        name = parameter.name if parameter.param_type_name == "argument" else parameter.opts[0]
        return UsageError(f"{path} without {name}", allowed, f"name it; {remedy}")
    if kind == "BadOptionUsage":
        return UsageError(f"{error.option_name} without a value", "a value behind it", f"name it; {remedy}")
    if kind == "NoSuchOption":
        allowed_names = [
            option
            for parameter_info in context.command.get_params(context)
            for option in parameter_info.opts
            if option[:2] == "--"
        ]
        return UsageError(f"{path} with {error.option_name}", ", ".join(sorted(allowed_names)), remedy)
    if kind == "NoSuchCommand" or "No such command" in error.message:
        allowed_names = ", ".join(context.command.list_commands(context))
        problem = error.message.rstrip(".").replace("No such command", f"{path} has no verb")
        return UsageError(problem, allowed_names, remedy)
    if extra := re.search(r"unexpected extra arguments?(?:\(s\))? \((.*)\)", error.message):
        return UsageError(f"{path} with {extra[1]}, which it has no place for", allowed, f"leave it out; {remedy}")
    return UsageError(f"{path}: {error.format_message().rstrip('.')}", allowed, remedy)


def main() -> None:
    """Run the command line; an error meant for a person ends in words and a non-zero exit, never a traceback."""
    stages.follow()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A console without a sign shows a question mark in its place; a name that is no text shows its bytes.
            stream.reconfigure(errors="replace" if stream is sys.stdout else "backslashreplace")
    try:
        registry.add_project(Path.cwd())
        ended = _command(_verbs())(prog_name="tacdata", standalone_mode=False)
        # A verb that ends with a code returns it, a member of Exit.
        raise SystemExit(int(ended) if isinstance(ended, int) else 0)
    except MISTYPED as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            error.show()
            raise SystemExit(int(Exit.USAGE)) from None
        print(f"error: {in_words(error)}", file=sys.stderr)
        raise SystemExit(int(Exit.USAGE)) from None
    except typer.Abort:
        print("interrupted", file=sys.stderr)
        raise SystemExit(int(Exit.INTERRUPTED)) from None
    except TacdataError as error:
        print("\n".join([f"error: {error}", *last_words(error)]), file=sys.stderr)
        raise SystemExit(int(error.exit_code)) from None
    except KeyboardInterrupt as error:
        print("\n".join(["interrupted", *last_words(error)]), file=sys.stderr)
        raise SystemExit(int(Exit.INTERRUPTED)) from None


if __name__ == "__main__":
    main()
