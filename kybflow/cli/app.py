"""The command line: finds the commands in `kybflow.cli.commands` and handles their errors. Large
modules are imported only where they are used."""

from __future__ import annotations

import errno
import functools
import gc
import inspect
import math
import os
import signal
import sys
import warnings
from importlib import import_module
from pathlib import Path
from types import FrameType, ModuleType
from typing import Annotated, Any, TextIO, cast

from typer import BadParameter, Exit, Option, Typer
from typer.core import TyperGroup
from typer.main import get_command

from kybflow import __version__
from kybflow.cli import commands
from kybflow.cli.output import GuardedStream, Unwritable, echo
from kybflow.core.errors import FAILED, INTERRUPTED, INVALID, KybflowError

GARBAGE_THRESHOLD = 200_000
"""New objects between two garbage collections. A command creates many objects and drops few; with
Python's default of 700, a tenth of its start would be collections. A flight sets its own
thresholds."""
UNUSED = {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "off"}
"""Environment variables that switch off library features to start faster: a flight multiplies no
large matrices, and MuJoCo's window has its own OpenGL. A value set by the user takes precedence."""
_SHOWN_CHARACTERS = 100
_NEVER = frozenset({errno.ENAMETOOLONG, errno.ELOOP})


def _useless(value: object) -> str:
    """Return why no command can accept this value: a number that isn't finite, or an impossible
    path. Empty for any other value."""
    if isinstance(value, float) and not math.isfinite(value):
        return f"{value} is not finite"
    if isinstance(value, Path):
        try:
            value.stat()
        except OSError as error:
            if error.errno in _NEVER:
                return f"`{str(value)[:_SHOWN_CHARACTERS]}` can't be a path: {error.strerror}"
    return ""


class Commands(TyperGroup):
    """The commands of a package. A command's module is imported only when the command runs."""

    def __init__(self, package: ModuleType = commands, **settings: Any) -> None:
        super().__init__(**settings)
        names: Any = dict.fromkeys(package.COMMANDS)
        self.commands, self._package = names, package

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for word in args:
            try:
                is_text = b"\0" not in os.fsencode(word)
            except UnicodeError:
                is_text = False
            if not is_text:  # a shell can't pass it, and typer's paths would raise
                raise BadParameter(f"{word[:_SHOWN_CHARACTERS]!r} is not valid text")
        return super().parse_args(ctx, args)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in self.commands:
            return None
        module = import_module(f"{self._package.__name__}.{cmd_name.replace('-', '_')}")
        if hasattr(module, "COMMANDS"):
            about = {"help": module.__doc__, "no_args_is_help": True, "rich_markup_mode": None}
            return Commands(module, name=cmd_name, **about)
        own = Typer(rich_markup_mode=None, add_completion=False)
        summary = " ".join((inspect.getdoc(module.command) or "").partition("\n\n")[0].split())
        settings = getattr(module, "SETTINGS", None)

        @own.command(cmd_name, short_help=summary, context_settings=settings)
        @functools.wraps(module.command)
        def checked(**given: Any) -> None:
            for param in command.params:
                values = given[str(param.name)]
                for value in values if isinstance(values, list) else [values]:
                    if reason := _useless(value):
                        raise BadParameter(reason, param=param)
            module.command(**given)

        command = get_command(own)
        return command


app = Typer(
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"max_content_width": 100},
)


def _print_version(asked: bool) -> None:
    if asked:
        echo(f"kybflow {__version__}")
        raise Exit


@app.callback()
def kybflow(
    version: Annotated[
        bool, Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Experiments with quadrotors, written in YAML, proven before take-off, flown."""


def main() -> None:
    """Run the command line; the entry point of the console script."""
    gc.set_threshold(GARBAGE_THRESHOLD)
    interrupts = _counted_interrupts()
    warnings.showwarning = lambda message, *_, **__: echo(f"warning: {message}", err=True)
    os.environ.update(UNUSED | os.environ)
    # a reader that goes away (`| head`) doesn't end the command
    sys.stdout = cast("TextIO", GuardedStream(_open(sys.stdout), BrokenPipeError))
    sys.stderr = cast("TextIO", GuardedStream(_open(sys.stderr)))
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except Unwritable as error:
        echo(f"kybflow: the output can't be written: {error.strerror}", err=True)
        sys.exit(FAILED)
    except (Exception, KeyboardInterrupt) as error:
        if interrupts:  # a library may raise its own error for an interrupt
            sys.exit(INTERRUPTED)
        if not isinstance(error, KybflowError):
            raise
        echo(f"kybflow: {error}", err=True)
        sys.exit(INVALID)


def _counted_interrupts() -> list[int]:
    """Make SIGTERM and SIGHUP raise KeyboardInterrupt, as Ctrl-C does. Return the list to which
    every received signal is appended."""
    numbers: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  # as handlers are
        numbers.append(number)
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # ignored under `nohup` and `&`
            signal.signal(number, interrupt)
    return numbers


def _open(stream: TextIO | None) -> TextIO:
    """Return a stream that can write every character; /dev/null if the stream is closed (`>&-`)."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    return stream
