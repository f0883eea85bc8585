"""What several commands share: how their help looks, their arguments, and what becomes of them."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.exceptions import Exit

from kybflow.cli.output import echo
from kybflow.core.errors import UnitError
from kybflow.core.exit_codes import INVALID
from kybflow.core.files import write_whole
from kybflow.core.units import DURATION, parse_quantity

if TYPE_CHECKING:
    from kybflow.dsl.compiler import Result
    from kybflow.dsl.plan import Plan

_SHOWN = 100
_NEVER = frozenset({errno.ENAMETOOLONG, errno.ELOOP})
"""What makes a path that nothing can ever be at."""


class _Path(click.Path):
    """A path; one that is too long, has a NUL or leads in a circle is refused."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            os.stat(value)
        except ValueError as error:
            self.fail(f"`{str(value)[:_SHOWN]}` is no path: {error}", param, ctx)
        except OSError as error:
            if error.errno in _NEVER:
                self.fail(f"`{str(value)[:_SHOWN]}` is no path: {error.strerror}", param, ctx)
        return super().convert(value, param, ctx)


class FiniteRange(click.FloatRange):
    """A number in a range, and no infinity or NaN."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not finite", param, ctx)
        return number


PATH = _Path(path_type=Path)
Function = TypeVar("Function", bound=Callable[..., Any])


class Argument(click.Argument):
    """A positional argument that the help of its command explains."""

    def __init__(self, declarations: Sequence[str], said: str, **rest: Any) -> None:
        super().__init__(declarations, **rest)
        self.row = (self.human_readable_name, said)


def argument(name: str, help: str, **rest: Any) -> Callable[[Function], Function]:
    """Give a command the positional argument `name`."""
    return click.argument(name, cls=Argument, said=help, **rest)


class Subcommand(click.Command):
    """A command whose help explains its arguments; a list of commands has its first paragraph."""

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        if rows := [one.row for one in self.params if isinstance(one, Argument)]:
            with formatter.section("Arguments"):
                formatter.write_dl(rows)
        self.format_options(ctx, formatter)
        self.format_epilog(ctx, formatter)

    def get_short_help_str(self, limit: int = 45) -> str:
        return " ".join((self.help or "").partition("\n\n")[0].split())


target_option = click.option("--target", help="Where to fly; `sim` by default.")
set_option = click.option(
    "--set", "sets", multiple=True, metavar="NAME=VALUE", help="Set a parameter of the mission."
)
seed_option = click.option("--seed", default=0, help="Seed of everything that is drawn by chance.")
emit_option = click.option(
    "--emit",
    "emits",
    multiple=True,
    metavar="NAME@TIME",
    help="Give an event while it flies, like operator.go@2s; TIME is that of the run. "
    "operator.pause, .resume, .land, .reset and .stop act on every vehicle.",
)
option_option = click.option(
    "--option",
    "options",
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a parameter of a part, like mk.processors.limit_speed.speed=50cm/s.",
)
out_option = click.option("--out", type=PATH, help="Run folder; runs/MISSION-TIME by default.")


def examples(*lines: str) -> str:
    """The end of a command's help: an example a line, which click is told not to join."""
    return "\n".join(("\b", "Examples:", *(f"  {line}" for line in lines)))


def compiled(
    mission: Path, target: str | None = None, sets: tuple[str, ...] = ()
) -> tuple[Plan, Result]:
    """Compile a mission and print its findings. Exits with INVALID where it has no plan."""
    from kybflow.api.validation import findings
    from kybflow.dsl.compiler import compile_mission
    from kybflow.parts.catalog import load_catalog

    result = compile_mission(mission, catalog=load_catalog(), target=target, sets=sets)
    for text in findings(result, mission):
        echo(text, err=True)
    if result.plan is None:
        raise Exit(INVALID)
    return result.plan, result


def timed(emit: str) -> tuple[float, str]:
    """(seconds, name) of `NAME@TIME`."""
    name, at, time = emit.rpartition("@")
    if not at or not name.strip():
        raise click.BadParameter(f"`{emit}` is not NAME@TIME", param_hint="--emit")
    try:
        seconds = parse_quantity(time, DURATION)
    except UnitError as error:
        reason = f"`{emit}`: {error}; {error.hint}" if error.hint else f"`{emit}`: {error}"
        raise click.BadParameter(reason, param_hint="--emit") from None
    if seconds < 0.0:
        raise click.BadParameter(f"`{emit}` is before the run", param_hint="--emit")
    return seconds, name.strip()


def pair(option: str) -> tuple[str, str]:
    """(name, value) of `NAME=VALUE`."""
    name, equals, value = option.partition("=")
    if not equals:
        raise click.BadParameter(f"`{option}` is not NAME=VALUE", param_hint="--option")
    return name.strip(), value.strip()


def write(path: Path, text: str, option: str) -> None:
    """Write the file that `option` names."""
    try:
        write_whole(path, text.encode())
    except OSError as error:
        message = f"`{path}` can't be written: {error.strerror}"
        raise click.BadParameter(message, param_hint=option) from None


def published(
    text: Callable[[], str], command: str, write_to: Path | None, check: Path | None
) -> bool:
    """Write the generated file to `write_to`, or exit with INVALID unless `check` is current;
    whether either was asked for. command: what makes the file, for the message."""
    if write_to is not None:
        write(write_to, text(), "--write")
    elif check is not None and not (
        check.is_file() and check.read_text(encoding="utf-8") == text()
    ):
        echo(f"{check} is not current; mend it with: {command} --write {check}", err=True)
        raise Exit(INVALID)
    return write_to is not None or check is not None
