"""The preflight alone: open the drivers, look, close them. Nothing arms, and no run is recorded."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.api.opening import build_vehicles, clock_for, goes_by_the_wall, open_devices
from kybflow.dsl.plan import Plan
from kybflow.runtime.engine import Engine
from kybflow.runtime.events import Events
from kybflow.runtime.observer import VehicleObserver
from kybflow.runtime.preflight import Line
from kybflow.runtime.scores import Score


class Inspected(NamedTuple):
    """Every line of every vehicle. driver_failed: what a link said that failed while it was looked
    at, as where nobody is at the other end; None where all work."""

    lines: list[Line]
    driver_failed: str | None


def inspect(plan: Plan, seed: int = 0) -> Inspected:
    """Look at every vehicle. Raises DriverError where one can't be opened, and PartFailed."""
    events = Events()
    devices = open_devices(plan, seed)
    try:
        vehicles = build_vehicles(plan, devices, events, lambda _: VehicleObserver(), Score(plan))
        clock = clock_for(plan, 1.0 if goes_by_the_wall(plan) else None)
        lines = Engine(plan, clock, devices.sessions, vehicles, events).inspect()
        failed = next((v.link_error for v in vehicles if v.link_error), None)
        return Inspected(lines, failed)
    finally:
        devices.close()
