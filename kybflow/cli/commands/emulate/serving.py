"""The options of emulators, and the loop that serves them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from kybflow.cli.arguments import compiled, refusing, repeated, wrong
from kybflow.cli.output import echo

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.emulation.breaking import Break, Failures
    from kybflow.drivers.emulation.fleet import Fleet
    from kybflow.parts import Seat

Mission = Annotated[Path | None, Option(help="A mission with the vehicles and obstacles.")]
Count = Annotated[int, Option(min=1, max=50, help="The number of vehicles without a mission.")]
Pace = Annotated[float, Option(min=0.01, max=100.0, help="Pace: 2 is twice as fast as real time.")]


def fails(names: str) -> Any:
    """Return the option `--fail`. names: the names of the emulator's failures."""
    return repeated("--fail", metavar="NAME[=VALUE][@SECONDS]", help=f"A failure: {names}.")


def breaks_of(given: list[str], kind: type[Failures]) -> list[Break]:
    """Parse the values of `--fail`. kind: the emulator's class of failures."""
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulation.breaking import read_break

    with refusing("--fail", DriverError):
        return [read_break(text, kind) for text in given]


def seats_for(mission: Path | None, driver: str, airframe: str, count: int) -> list[Seat]:
    """Return a seat for each vehicle of a mission, or for `count` vehicles with the given
    airframe."""
    from kybflow.api.emulation import plan_of, seats_of

    plan = plan_of(airframe, count) if mission is None else compiled(mission)[0]
    if plan is None:
        raise wrong("--airframe", f"the standard library has no airframe `{airframe}`")
    return seats_of(plan, driver)


def served(fleet: Fleet[Any], breaks: Sequence[Break], speed: float) -> None:
    """Serve the fleet until Ctrl-C."""
    from kybflow.api.emulation import serve
    from kybflow.core.signals import NS

    def began(failure: Break, now: Time) -> None:
        echo(f"{now / NS:.1f} s: {failure}")
        sys.stdout.flush()

    sys.stdout.flush()
    with suppress(KeyboardInterrupt):
        serve(fleet, breaks, speed, began)
