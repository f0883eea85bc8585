"""`kybflow record-input`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    compiled,
    examples,
    set_option,
    target_option,
)
from kybflow.cli.output import echo
from kybflow.core.errors import DriverError, UnitError
from kybflow.core.exit_codes import INVALID
from kybflow.core.signals import NS
from kybflow.core.units import DURATION, parse_quantity

if TYPE_CHECKING:
    from kybflow.core.signals import InputReading, Time

EXAMPLES = examples(
    "kybflow record-input missions/joystick.yaml --target hands --out operators/mine.csv",
    "kybflow record-input missions/joystick.yaml stick --target hands --for 30s --out mine.csv",
)
DEVICE_FAILED, UNWRITTEN = 3, 1


@click.command("record-input", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "The mission whose input it is.", type=PATH)
@click.argument("name", metavar="[INPUT]", required=False)
@target_option
@set_option
@click.option("--out", type=PATH, required=True, help="The table to write, for `use: script`.")
@click.option("--for", "lasts", metavar="TIME", help="How long; until Ctrl-C without it.")
def command(
    mission: Path,
    name: str | None,
    target: str | None,
    sets: tuple[str, ...],
    out: Path,
    lasts: str | None,
) -> None:
    """Write down what a person does with a gamepad, a keyboard or another input.

    Nothing flies. `{use: script, file: ...}` flies it, at the times that count from here.

    \b
    Exit codes:
    0: the table is written.
    1: it can't be written.
    2: the mission or the command line is invalid.
    3: the device can't be opened.
    """
    from kybflow.api.recorded_input import InputUnknown, input_named, record_input
    from kybflow.recording.run_folder import RunUnwritten

    plan, _ = compiled(mission, target, sets)
    try:
        own = input_named(plan, name)
        rows = record_input(own, out, _seconds(lasts), _show)
    except InputUnknown as error:
        echo(f"error: {error}", err=True)
        raise Exit(INVALID) from None
    except DriverError as error:
        echo(f"error: {error}", err=True)
        raise Exit(DEVICE_FAILED) from None
    except RunUnwritten as error:
        echo(f"error: {error}", err=True)
        raise Exit(UNWRITTEN) from None
    echo(f"{rows} rows in {out}")


def _seconds(text: str | None) -> float | None:
    try:
        return None if text is None else parse_quantity(text, DURATION)
    except UnitError as error:
        raise click.BadParameter(str(error), param_hint="--for") from None


def _show(now: Time, reading: InputReading | None, why: str) -> None:
    """Print what is new."""
    if reading is None:
        echo(f"{now / NS:8.2f} s  {why}")
        return
    axes = "  ".join(f"{axis} {value:+.2f}" for axis, value in reading.axes.items())
    echo(f"{now / NS:8.2f} s  {axes}  {' '.join(sorted(reading.held))}".rstrip())
