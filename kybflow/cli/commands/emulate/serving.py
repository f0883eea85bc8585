"""Which vehicles are emulated, and serving them in the wall's time."""

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

Mission = Annotated[Path | None, Option(help="A mission whose vehicles and obstacles are taken.")]
Count = Annotated[int, Option(min=1, max=50, help="How many, where there is no mission.")]
Pace = Annotated[float, Option(min=0.01, max=100.0, help="Pace: 2 is twice as fast as real time.")]


def fails(names: str) -> Any:
    """The option `--fail`. names: of what can fail."""
    told = f"What fails, and when: {names}."
    return repeated("--fail", metavar="NAME[=VALUE][@SECONDS]", help=told)


def breaks_of(given: list[str], kind: type[Failures]) -> list[Break]:
    """What `--fail` says. kind: the failures that the emulator knows."""
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulation.breaking import read_break

    with refusing("--fail", DriverError):
        return [read_break(text, kind) for text in given]


def seats_for(mission: Path | None, driver: str, airframe: str, count: int) -> list[Seat]:
    """The vehicles of a mission, or `count` of one kind."""
    from kybflow.api.emulation import plan_of, seats_of

    plan = plan_of(airframe, count) if mission is None else compiled(mission)[0]
    if plan is None:
        raise wrong("--airframe", "the standard library has no such airframe")
    return seats_of(plan, driver)


def served(fleet: Fleet[Any], breaks: Sequence[Break], speed: float) -> None:
    """Go on in the wall's time until Ctrl-C."""
    from kybflow.api.emulation import serve
    from kybflow.core.signals import NS

    def tell(failure: Break, now: Time) -> None:
        echo(f"{now / NS:.1f} s: {failure}")
        sys.stdout.flush()

    sys.stdout.flush()
    with suppress(KeyboardInterrupt):
        serve(fleet, breaks, speed, tell)
