"""`kybflow record-input`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from kybflow.cli.arguments import Sets, Target, compiled, duration, failing
from kybflow.cli.output import echo
from kybflow.core.errors import DRIVER_FAILED, FAILED, INVALID, DriverError
from kybflow.core.signals import NS

if TYPE_CHECKING:
    from kybflow.core.signals import InputReading, Time


def command(
    mission: Annotated[Path, Argument(help="The mission with the input.")],
    name: Annotated[
        str | None, Argument(metavar="[INPUT]", help="The input; by default the only one.")
    ] = None,
    *,
    target: Target = None,
    sets: Sets,
    out: Annotated[Path, Option(help="The table to write, for `use: script`.")],
    lasts: Annotated[
        float | None,
        Option("--for", parser=duration, metavar="TIME", help="Duration; by default until Ctrl-C."),
    ] = None,
) -> None:
    """Record a gamepad, a keyboard or another input of a mission.

    Nothing flies. A mission replays the record with `{use: script, file: ...}`.

    \b
    Exit codes:
    0: the table is written.
    1: the table can't be written.
    2: the mission or the command line is invalid.
    3: the device can't be opened.

    \b
    Examples:
      kybflow record-input missions/joystick.yaml --target hands --out operators/mine.csv
      kybflow record-input missions/joystick.yaml stick --target hands --for 30s --out mine.csv
    """
    from kybflow.api.recorded_input import InputUnknown, input_named, record_input
    from kybflow.recording.run_folder import RunUnwritten

    def show(now: Time, reading: InputReading | None, why: str) -> None:
        if reading is None:
            echo(f"{now / NS:8.2f} s  {why}")
            return
        axes = "  ".join(f"{axis} {value:+.2f}" for axis, value in reading.axes.items())
        echo(f"{now / NS:8.2f} s  {axes}  {' '.join(sorted(reading.held))}".rstrip())

    plan, _ = compiled(mission, target, sets)
    with failing(INVALID, InputUnknown):
        own = input_named(plan, name)
    with failing(DRIVER_FAILED, DriverError), failing(FAILED, RunUnwritten):
        rows = record_input(own, out, lasts, show)
    echo(f"{rows} rows in {out}")
