"""The command line: each command is a module of `kybflow.cli.commands`; this file gathers them and
catches what they raise. Everything heavy is imported where it is needed."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, TextIO, cast

import typer

from kybflow.cli.arguments import INVALID
from kybflow.cli.commands import (
    emulate,
    explain,
    graph,
    library,
    mavlink,
    mocap_server,
    new,
    parts,
    preflight,
    run,
    schema,
    show,
    tags,
    test,
    validate,
)
from kybflow.cli.output import UNWRITTEN, GuardedStream, Unwritable, echo
from kybflow.core.errors import KybflowError

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from kybflow import __version__

        echo(f"kybflow {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Experiments with quadrotors, written in YAML, proven before take-off, flown."""


for _name, _command, _examples in (
    ("run", run.run, run.EXAMPLES),
    ("validate", validate.validate, validate.EXAMPLES),
    ("test", test.fly_tests, test.EXAMPLES),
    ("preflight", preflight.preflight, preflight.EXAMPLES),
    ("explain", explain.explain, explain.EXAMPLES),
    ("graph", graph.graph, graph.EXAMPLES),
    ("show", show.show, show.EXAMPLES),
    ("new", new.new, new.EXAMPLES),
    ("library", library.library, library.EXAMPLES),
    ("mocap-server", mocap_server.mocap_server, mocap_server.EXAMPLES),
    ("parts", parts.parts, parts.EXAMPLES),
    ("schema", schema.schema, schema.EXAMPLES),
    ("tags", tags.tags, tags.EXAMPLES),
):
    app.command(_name, epilog=_examples)(_command)
app.add_typer(mavlink.app, name="mavlink")
app.add_typer(emulate.app, name="emulate")


def main() -> None:
    """The console's entry."""
    # a reader that went away (`| head`) has seen enough: the command goes on and ends as usual
    sys.stdout = cast(TextIO, GuardedStream(_open(sys.stdout), BrokenPipeError))
    sys.stderr = cast(TextIO, GuardedStream(_open(sys.stderr)))
    try:
        try:
            _run(sys.argv[1:])
        finally:
            sys.stdout.flush()
    except Unwritable as error:
        echo(f"kybflow: the output can't be written: {error.strerror}", err=True)
        sys.exit(UNWRITTEN)
    except KybflowError as error:
        echo(f"kybflow: {error}", err=True)
        sys.exit(INVALID)


def _open(stream: TextIO | None) -> TextIO:
    """`stream`, able to write every character; /dev/null for one that was closed (`>&-`)."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    return stream


def _run(arguments: list[str]) -> None:
    paths = arguments[1:]
    if arguments[:1] == ["validate"] and paths and not any(p.startswith("-") for p in paths):
        # typer builds a pydantic adapter for each parameter: 60 ms that the plainest call is spared
        text = validate.Format.TEXT
        sys.exit(validate.validate_all([Path(path) for path in paths], text, None, ()))
    app()
