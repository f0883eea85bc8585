"""Which vehicles are emulated, and serving them in the wall's time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.exceptions import Exit

from kybflow.cli.output import echo
from kybflow.core.exit_codes import INVALID

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.emulation.breaking import Break
    from kybflow.drivers.emulation.fleet import Fleet
    from kybflow.parts import Seat
    from kybflow.parts.catalog import PartSpec

RATE = 250
APART = 2.0
"""Metres between vehicles that no mission places."""
MISSION = """kybflow: 1
mission: emulated
import: {{std: kybflow/airframes}}
vehicles:
{vehicles}
"""
VEHICLE = """  v{number}:
    like: std.{airframe}
    start: {{at: [0, {y}, 0]}}
    behaviors:
      up: {{do: take_off, height: 1 m, then: down}}
      down: {{do: land}}
"""
Given = TypeVar("Given")
Read = TypeVar("Read")


def seats_of(mission: Path | None, airframe: str, count: int, driver: PartSpec) -> list[Seat]:
    """The vehicles of a mission, or `count` of one kind; ends with what is wrong with it."""
    from tempfile import TemporaryDirectory

    if mission is not None:
        return _compiled(mission, mission, driver)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "emulated.yaml"
        vehicles = "".join(
            VEHICLE.format(number=number + 1, airframe=airframe, y=APART * number)
            for number in range(count)
        )
        path.write_text(MISSION.format(vehicles=vehicles), encoding="utf-8")
        return _compiled(path, None, driver)


def _compiled(path: Path, mission: Path | None, driver: PartSpec) -> list[Seat]:
    """The seats of a mission; ends with what is wrong with it."""
    from kybflow.api.opening import context_of
    from kybflow.api.validation import findings
    from kybflow.dsl.compiler import compile_mission
    from kybflow.parts import Seat
    from kybflow.parts.catalog import load_catalog

    result = compile_mission(path, catalog=load_catalog())
    if result.plan is None and mission is None:
        raise click.BadParameter(
            "the standard library has no such airframe", param_hint="--airframe"
        )
    if result.plan is None:
        for text in findings(result, path):
            echo(text, err=True)
        raise Exit(INVALID)
    plan, params = result.plan, driver.params()
    return [Seat(context_of(plan, vehicle), params) for vehicle in plan.vehicles]


def serve(fleet: Fleet[Any], breaks: Sequence[Break], speed: float) -> None:
    """Go on in the wall's time until Ctrl-C."""
    from kybflow.core.signals import NS
    from kybflow.runtime.clock import SimulatedClock

    def tell(failure: Break, now: Time) -> None:
        echo(f"{now / NS:.1f} s: {failure}")
        sys.stdout.flush()

    clock = SimulatedClock(RATE, speed)
    with suppress(KeyboardInterrupt):
        fleet.serve(iter(clock.step, None), breaks, tell)


def given(option: str, read: Callable[[Given], Read], given: Given) -> Read:
    """What is read of an option; ends with what is wrong with it."""
    from kybflow.core.errors import DriverError

    try:
        return read(given)
    except DriverError as error:
        raise click.BadParameter(str(error), param_hint=option) from None
