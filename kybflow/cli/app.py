"""The command line: each command is a module of `kybflow.cli.commands`; this file finds them and
catches what they raise. Everything heavy is imported where it is needed."""

from __future__ import annotations

import gc
import os
import signal
import sys
import warnings
from importlib import import_module
from types import FrameType
from typing import Any, TextIO, cast

import click
from click.exceptions import Exit

from kybflow import __version__
from kybflow.cli.output import GuardedStream, Unwritable, echo
from kybflow.core.errors import KybflowError
from kybflow.core.exit_codes import FAILED, INTERRUPTED, INVALID

YOUNG = 200_000
"""New objects between two collections of garbage. A command makes many and drops few; at Python's
700 a tenth of its start goes into looking for garbage. A flight has its own figure."""
UNUSED = {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "off"}
"""What libraries need not start, because a flight multiplies no large matrices and MuJoCo's window
brings its own OpenGL. Who sets these variables is obeyed."""
COMMANDS = (
    "run",
    "command",
    "validate",
    "rehearse",
    "test",
    "preflight",
    "record-input",
    "explain",
    "graph",
    "show",
    "new",
    "library",
    "mocap-server",
    "parts",
    "schema",
    "tags",
    "calibrate",
    "mavlink",
    "emulate",
    "ardrone",
)
"""In the order of the help. Each is the `command` of the module of its name."""


class _Commands(click.Group):
    """Imports the module of a command when that is called, so that none pays for the others."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*COMMANDS]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"kybflow.cli.commands.{cmd_name.replace('-', '_')}")
        return cast(click.Command, module.command)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Exit(INTERRUPTED) from None


@click.group(
    cls=_Commands,
    no_args_is_help=True,
    context_settings={"max_content_width": 100, "show_default": True},
)
@click.version_option(__version__, message="kybflow %(version)s", help="Print the version.")
def app() -> None:
    """Experiments with quadrotors, written in YAML, proven before take-off, flown."""


def main() -> None:
    """The console's entry."""
    gc.set_threshold(YOUNG)
    interrupts = _counted_interrupts()
    warnings.showwarning = _warn
    os.environ.update(UNUSED | os.environ)
    # a reader that went away (`| head`) has seen enough: the command goes on and ends as usual
    sys.stdout = cast(TextIO, GuardedStream(_open(sys.stdout), BrokenPipeError))
    sys.stderr = cast(TextIO, GuardedStream(_open(sys.stderr)))
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except Unwritable as error:
        echo(f"kybflow: the output can't be written: {error.strerror}", err=True)
        sys.exit(FAILED)
    except (Exception, KeyboardInterrupt) as error:
        if interrupts:  # a library may have turned the interrupt into an error of its own
            sys.exit(INTERRUPTED)
        if not isinstance(error, KybflowError):
            raise
        echo(f"kybflow: {error}", err=True)
        sys.exit(INVALID)


def _counted_interrupts() -> list[int]:
    """Make SIGTERM and a closed terminal what Ctrl-C is, KeyboardInterrupt; the signals so far."""
    numbers: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  # as handlers are
        numbers.append(number)
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` and `&` have it
            signal.signal(number, interrupt)
    return numbers


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    """Show a warning as a person reads it, without the line of code that gave it."""
    echo(f"warning: {message}", err=True)


def _open(stream: TextIO | None) -> TextIO:
    """`stream`, able to write every character; /dev/null for one that was closed (`>&-`)."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    return stream
