"""What a plan needs to fly: the drivers' sessions, the vehicles on them, and a clock."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.errors import DriverError
from kybflow.parts import Driver, Seat, Session
from kybflow.runtime.clock import Clock, SimulatedClock, WallClock
from kybflow.runtime.events import Events
from kybflow.runtime.recorder import Recorder
from kybflow.runtime.score import Score
from kybflow.runtime.vehicle import Vehicle
from kybflow.site import Site


def open_sessions(plan: Plan, seed: int) -> list[Session]:
    """One session for each driver, with every vehicle that flies on it."""
    generator = random.Random(seed)
    by_driver: dict[type[Driver[Any]], list[VehiclePlan]] = {}
    for vehicle in plan.vehicles:
        by_driver.setdefault(vehicle.driver.cls, []).append(vehicle)
    sessions: list[Session] = []
    try:
        for driver, vehicles in by_driver.items():
            seats = [Seat(_site(plan, v), v.driver.params) for v in vehicles]
            sessions.append(driver.open(seats, generator))
    except DriverError:
        for session in sessions:
            session.close()
        raise
    return sessions


def _site(plan: Plan, vehicle: VehiclePlan) -> Site:
    return Site(
        vehicle.name,
        vehicle.airframe,
        vehicle.start,
        vehicle.heading,
        plan.fence,
        1.0 / plan.control_rate,
        vehicle.home,
        plan.obstacles,
        {other.name: other.airframe.diameter for other in plan.vehicles},
    )


def build_vehicles(
    plan: Plan, sessions: Sequence[Session], events: Events, recorder: Recorder, score: Score
) -> list[Vehicle]:
    links = {name: link for session in sessions for name, link in session.links.items()}
    return [
        Vehicle(
            vehicle,
            _site(plan, vehicle),
            links[vehicle.name],
            events,
            recorder.vehicle(vehicle.name),
            score.vehicle(vehicle.name),
        )
        for vehicle in plan.vehicles
    ]


def clock_for(plan: Plan, speed: float | None) -> Clock:
    if plan.simulated:
        return SimulatedClock(plan.control_rate, speed)
    return WallClock(plan.control_rate)
