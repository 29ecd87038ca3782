"""The one command: finds the verbs in `tacdata/commands`, orders them by task, turns errors into words."""

from __future__ import annotations

import difflib
import functools
import inspect
import io
import itertools
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, redirect_stdout, suppress
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from tacdata.errors import Exit, TacdataError, UsageError, refused_by_system

try:
    import typer

    from tacdata import progress, registry, stages
    from tacdata.commands.command import Result, members
    from tacdata.extras import missing_package
except KeyboardInterrupt:  # these imports take most of the first half second
    print("interrupted", file=sys.stderr)
    raise SystemExit(int(Exit.INTERRUPTED)) from None

ROOM, BASE = "tacdata.commands", "command"
QUIET, JSON = "quiet", "as_json"
HELP_OPTIONS = {"help_option_names": ["-h", "--help"]}
OPTIONS = {
    QUIET: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no hints: only results and errors.")],
    JSON: Annotated[bool, typer.Option("--json", help="Print the result as JSON; words go to standard error.")],
}
"""Options that the command line adds to verbs: the first to all, the second to those that return a `Result`."""


def application() -> typer.Typer:
    """Build the command line from the folder `tacdata/commands`: one file, one verb."""
    app = typer.Typer(
        name="tacdata",
        help="The data engine for soft tactile skins. Verbs by task, in the order in which a person meets them.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
        context_settings=HELP_OPTIONS,
        callback=_before,
    )
    for module, name in members(ROOM, BASE):
        if _is_group(module):
            app.add_typer(_group(module, name), name=name, help=module.run.__doc__, rich_help_panel=module.PANEL)
        else:
            verb = answering(f"tacdata {name}", module.run)
            app.command(name=name, help=module.run.__doc__, epilog=_examples(module), rich_help_panel=module.PANEL)(
                verb
            )
    return app


def _is_group(verb: ModuleType) -> bool:
    return hasattr(verb, "__path__")


def _verbs(room: str = ROOM) -> tuple[Callable[..., Any], ...]:
    """Return the functions of a room's verbs, those of its groups among them."""
    modules = [module for module, _ in members(room, BASE)]
    below = [_verbs(module.__name__) for module in modules if _is_group(module)]
    return (*(module.run for module in modules), *itertools.chain(*below))


@functools.lru_cache(maxsize=1)
def _command(verbs: tuple[Callable[..., Any], ...]) -> Any:
    """Return the command line as it is run, built once for a process that runs several verbs, or again for others."""
    return typer.main.get_command(application())


def _group(room: ModuleType, name: str) -> typer.Typer:
    """Return a verb that is a folder: each file in it is a verb below it."""
    group = typer.Typer(no_args_is_help=True, rich_markup_mode="markdown")
    for module, below in members(room.__name__, BASE):
        verb = answering(f"tacdata {name} {below}", module.run)
        group.command(name=below, help=module.run.__doc__, epilog=_examples(module))(verb)
    return group


def _examples(verb: ModuleType) -> str:
    """Return a verb's examples as the last part of its help; a verb of a plug-in may have none."""
    examples = getattr(verb, "EXAMPLES", ())
    return "\n\n".join(["**Examples**", *(f"- `{line}`" for line in examples)]) if examples else ""


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


def closest(name: str, names: Iterable[str]) -> str:
    """Return the question whether the most similar of some names was meant; an empty text if none is similar."""
    words = {option.lstrip("-"): option for option in names}  # dashes would make all options similar
    close = difflib.get_close_matches(name.lstrip("-"), words, n=1)
    return f"did you mean {words[close[0]]}? " if close else ""


def missing_path(error: TacdataError, arguments: Sequence[str]) -> str:
    """Return the question whether a neighbour was meant, for a path that was typed and does not exist.

    Args:
        error: The error; a path counts only where its message names it.
        arguments: The words that were typed, the verb first.
    """
    names = [word for word in arguments if not word.startswith("-")]
    for word in names[1:]:  # the first is the verb
        path = Path(word)
        if path.exists() or not path.name or word not in error.given:
            continue
        folder = next((parent for parent in path.parents if parent.is_dir()), None)
        first = path.parts[len(folder.parts)] if folder and folder != Path() else path.parts[0]
        with suppress(OSError):
            neighbours = [entry.name for entry in folder.iterdir()] if folder else []
            if close := difflib.get_close_matches(first, neighbours, n=1):
                return f"did you mean {folder / close[0]}? " if folder else ""
    return ""


def in_words(error: Any) -> UsageError:
    """Return a typed line's fault in three parts: given, allowed, remedy."""
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
        suggestion = closest(error.option_name, allowed_names)
        return UsageError(f"{path} with {error.option_name}", ", ".join(sorted(allowed_names)), suggestion + remedy)
    if kind == "NoSuchCommand" or "No such command" in error.message:
        verbs = context.command.list_commands(context)
        name = re.search(r"No such command '([^']*)'", error.message)
        problem = f"{path} has no verb '{name[1] if name else ''}'"
        return UsageError(problem, ", ".join(verbs), (closest(name[1], verbs) if name else "") + remedy)
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
        error.remedy = missing_path(error, sys.argv[1:]) + error.remedy
        print("\n".join([f"error: {error}", *last_words(error)]), file=sys.stderr)
        raise SystemExit(int(error.exit_code)) from None
    except KeyboardInterrupt as error:
        print("\n".join(["interrupted", *last_words(error)]), file=sys.stderr)
        raise SystemExit(int(Exit.INTERRUPTED)) from None


if __name__ == "__main__":
    main()
