"""The command line: parse, call, print, exit code. Everything is imported where it is needed."""

from __future__ import annotations

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import IO, Annotated, cast

import typer

from kybflow.errors import KybflowError

app = typer.Typer(
    help="Experiments with quadrotors, written in YAML, proven before take-off, flown.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

INVALID = 2
"""The exit code of a mission or a command line that is invalid."""


class Format(StrEnum):
    TEXT = "text"
    JSON = "json"


class Drawing(StrEnum):
    MERMAID = "mermaid"
    SVG = "svg"


Target = Annotated[str | None, typer.Option("--target", help="Where to fly; `sim` by default.")]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter of the mission."),
]


@app.callback()
def _version(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from kybflow import __version__

        typer.echo(f"kybflow {__version__}")
        raise typer.Exit


@app.command(
    epilog="Examples:  kybflow run missions/figure_eight.yaml  |  kybflow run "
    "missions/figure_eight.yaml --set lap=8s --seed 3  |  kybflow run missions/first_flight.yaml "
    "--speed 1 --live"
)
def run(
    mission: Annotated[Path, typer.Argument(help="The mission to fly.")],
    target: Target = None,
    sets: Sets = None,
    seed: Annotated[int, typer.Option(help="Seed of everything that is drawn by chance.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Run folder; runs/MISSION-TIME by default.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            min=0.01, help="Pace of a simulation, 1 is real time; else as fast as it goes."
        ),
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option(
            "--option",
            metavar="NAME=VALUE",
            help="Change a parameter of a part, like mk.processors.limit_speed.speed=50cm/s.",
        ),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the simulation in a window.")] = False,
    plain: Annotated[bool, typer.Option("--plain", help="Events as lines, no table.")] = False,
    report: Annotated[bool, typer.Option(help="Write report.html.")] = True,
) -> None:
    """Fly a mission and report.

    Exit code 0: it ended as it should and every expectation held. 1: it did not. 2: the mission or
    the command line is invalid. 3: a driver or device failed. 130: interrupted.
    """
    from rich.console import Console

    from kybflow.panel import Outlet
    from kybflow.running import Asked, run_mission
    from kybflow.runtime.flight import Request

    pace = 1.0 if live and speed is None else speed
    request = Request(seed, out, pace, tuple(_pair(option) for option in options or ()))
    asked = Asked(mission, target, tuple(sets or ()), request, live, plain, report)
    screen, errors = (Console(file=cast(IO[str], Outlet(s))) for s in (sys.stdout, sys.stderr))
    raise typer.Exit(run_mission(asked, screen, errors))


def _pair(option: str) -> tuple[str, str]:
    name, equals, value = option.partition("=")
    if not equals:
        raise typer.BadParameter(f"`{option}` is not NAME=VALUE", param_hint="--option")
    return name.strip(), value.strip()


@app.command(
    epilog="Examples:  kybflow graph missions/figure_eight.yaml  |  kybflow graph "
    "missions/figure_eight.yaml --format svg --out eight.svg"
)
def graph(
    mission: Annotated[Path, typer.Argument(help="The mission to draw.")],
    format: Annotated[Drawing, typer.Option(help="How to draw it.")] = Drawing.MERMAID,
    out: Annotated[Path | None, typer.Option(help="Write it to this file.")] = None,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """Draw each vehicle's state machine, with flight types and conditions."""
    from kybflow.drawing import draw_mission

    drawn = draw_mission(mission, format.value, target, tuple(sets or ()))
    for text in drawn.reports:
        echo(text, err=True)
    if drawn.text is None:
        raise typer.Exit(INVALID)
    if out is None:
        typer.echo(drawn.text, nl=False)
    else:
        _write(out, drawn.text, "--out")


@app.command(
    epilog="Examples:  kybflow validate missions/figure_eight.yaml  |  kybflow validate missions "
    "--format json  |  kybflow validate missions/figure_eight.yaml --set lap=8s"
)
def validate(
    paths: Annotated[list[Path], typer.Argument(help="Missions, or folders of missions.")],
    format: Annotated[Format, typer.Option(help="For people or for programs.")] = Format.TEXT,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """Prove all of a mission that can be proven before take-off.

    Exit code 0: every mission is valid. 2: one is not.
    """
    raise typer.Exit(_validate(paths, format, target, tuple(sets or ())))


def _validate(paths: list[Path], format: Format, target: str | None, sets: tuple[str, ...]) -> int:
    from kybflow.validation import report_text, validate_paths

    files = []
    for one in validate_paths(paths, target, sets):
        files.append(one.summary if format is Format.JSON else {"valid": one.valid})
        for text in one.reports if format is Format.TEXT else ():
            echo(text)
    if format is Format.JSON:
        echo(report_text(files))
    if not files:
        echo(f"no mission is under {', '.join(map(str, paths))}", err=True)
    return 0 if files and all(file["valid"] for file in files) else INVALID


@app.command(epilog="Examples:  kybflow parts  |  kybflow parts circle")
def parts(
    name: Annotated[str | None, typer.Argument(help="A part; without it, all are listed.")] = None,
) -> None:
    """What behaviors, estimators, processors, trackers, supervisors and drivers there are."""
    from kybflow.catalog import load_catalog
    from kybflow.listing import list_parts, show_part, unknown_part

    catalog = load_catalog()
    text = list_parts(catalog) if name is None else show_part(catalog, name)
    if text is None:
        raise typer.BadParameter(unknown_part(catalog, name or ""), param_hint="NAME")
    echo(text)


@app.command(
    epilog="Examples:  kybflow schema > mission.schema.json  |  kybflow schema --check "
    "schemas/mission.schema.json"
)
def schema(
    write: Annotated[Path | None, typer.Option(help="Write it to this file.")] = None,
    check: Annotated[Path | None, typer.Option(help="Fail unless this file is current.")] = None,
) -> None:
    """The JSON Schema of a mission, made from the parts that are installed; editors complete from
    it."""
    from kybflow.catalog import load_catalog
    from kybflow.dsl.published import schema_text

    text = schema_text(load_catalog())
    if write is not None:
        _write(write, text, "--write")
    elif check is not None:
        if not check.is_file() or check.read_text(encoding="utf-8") != text:
            echo(f"{check} is not current; mend it with: kybflow schema --write {check}", err=True)
            raise typer.Exit(INVALID)
    else:
        typer.echo(text, nl=False)


def _write(path: Path, text: str, option: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        message = f"`{path}` can't be written: {error.strerror}"
        raise typer.BadParameter(message, param_hint=option) from None


def echo(text: str, err: bool = False) -> None:
    """Print `text`, in colour where there is a terminal."""
    stream = sys.stderr if err else sys.stdout
    if stream.isatty():
        from kybflow.colour import coloured

        text = coloured(text)
    stream.write(f"{text}\n")


def main() -> None:
    """The console's entry."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")
    try:
        _run(sys.argv[1:])
    except KybflowError as error:
        echo(f"kybflow: {error}", err=True)
        sys.exit(INVALID)
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


def _run(arguments: list[str]) -> None:
    paths = arguments[1:]
    if arguments[:1] == ["validate"] and paths and not any(p.startswith("-") for p in paths):
        # typer builds a pydantic adapter for each parameter: 60 ms that the plainest call is spared
        sys.exit(_validate([Path(path) for path in paths], Format.TEXT, None, ()))
    app()
