"""The command line: finds the commands in `kybflow.cli.commands` and catches what they raise.
Everything heavy is imported where it is needed."""

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
from kybflow.core.errors import KybflowError
from kybflow.core.exit_codes import FAILED, INTERRUPTED, INVALID

YOUNG = 200_000
"""New objects between two collections of garbage. A command makes many and drops few; at Python's
700 a tenth of its start goes into looking for garbage. A flight has its own figure."""
UNUSED = {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "off"}
"""What libraries need not start, because a flight multiplies no large matrices and MuJoCo's window
brings its own OpenGL. Who sets these variables is obeyed."""
_SHOWN = 100
_NEVER = frozenset({errno.ENAMETOOLONG, errno.ELOOP})


def _useless(value: object) -> str:
    """Why no command can do anything with a value: a number that isn't finite, or a path at which
    nothing can ever be. Empty where one can."""
    if isinstance(value, float) and not math.isfinite(value):
        return f"{value} is not finite"
    if isinstance(value, Path):
        try:
            value.stat()
        except OSError as error:
            if error.errno in _NEVER:
                return f"`{str(value)[:_SHOWN]}` is no path: {error.strerror}"
    return ""


class Commands(TyperGroup):
    """The commands of a package. The module of a command is imported when that is called, so that
    none pays for the others."""

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
            if not is_text:  # no shell gives it, and paths in typer would raise
                raise BadParameter(f"{word[:_SHOWN]!r} is no text")
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


def _tell_version(asked: bool) -> None:
    if asked:
        echo(f"kybflow {__version__}")
        raise Exit


@app.callback()
def kybflow(
    version: Annotated[
        bool, Option("--version", callback=_tell_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Experiments with quadrotors, written in YAML, proven before take-off, flown."""


def main() -> None:
    """The console's entry."""
    gc.set_threshold(YOUNG)
    interrupts = _counted_interrupts()
    warnings.showwarning = lambda message, *_, **__: echo(f"warning: {message}", err=True)
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


def _open(stream: TextIO | None) -> TextIO:
    """`stream`, able to write every character; /dev/null for one that was closed (`>&-`)."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    return stream
