"""Opens and assembles what a plan needs to fly: the drivers' sessions, the sensors beside them, a
clock, the vehicles, and the engine."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

from kybflow.api.watching import watching_streams
from kybflow.core.errors import DriverError, FileError, KybflowError, described
from kybflow.core.signals import Sticks
from kybflow.dsl.plan import InputPlan, PartPlan, Plan, VehiclePlan
from kybflow.parts import Driver, InputLink, Link, Seat, Session, Stream
from kybflow.runtime.clock import Clock, SimulatedClock, WallClock
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.engine import Engine, Observer
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.runtime.fleet.inputs import Inputs, NoteInput, unnoted
from kybflow.runtime.fleet.moving_obstacles import MovingObstacles
from kybflow.runtime.monitoring.bodies import Bodies
from kybflow.runtime.monitoring.estimate_history import EstimateHistory
from kybflow.runtime.monitoring.sensing import OpenSensor
from kybflow.runtime.observer import VehicleObserver
from kybflow.runtime.options import Options
from kybflow.runtime.scores import Score
from kybflow.runtime.vehicle.requests import EntryJudge
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.vehicle_context import VehicleContext

NOTHING: Mapping[str, str] = MappingProxyType({})


class Devices(NamedTuple):
    """The open devices: the drivers' sessions, each vehicle's sensors beside them, and the inputs,
    by name. vehicles: those that are built on them, which inputs may listen to. watching: what
    sees each moving obstacle."""

    sessions: list[Session]
    sensors: dict[str, list[OpenSensor]]
    inputs: dict[str, InputLink]
    vehicles: dict[str, Vehicle]
    watching: dict[str, Stream]

    def close(self) -> list[str]:
        """Close everything; a text for each device that could not be closed."""
        streams = [sensor.stream for opened in self.sensors.values() for sensor in opened]
        devices: list[Stream | Session | InputLink] = [
            *self.inputs.values(), *streams, *self.watching.values(), *self.sessions,
        ]  # fmt: skip
        reasons = []
        for device in devices:
            try:
                device.close()
            except Exception as error:  # a part may raise anything; the others are closed too
                reasons.append(f"{type(device).__name__} can't be closed: {described(error)}")
        return reasons


def with_window(plan: Plan) -> Plan:
    """The plan with its drivers' own view switched on. Raises KybflowError where there is none."""
    vehicles = []
    for vehicle in plan.vehicles:
        driver = vehicle.driver
        if not hasattr(driver.params, "live"):
            raise KybflowError(f"the driver `{driver.name}` has no view of its own for --live")
        params = replace(driver.params, live=True)
        driver = replace(driver, params=params)
        vehicles.append(replace(vehicle, driver=driver))
    return replace(plan, vehicles=tuple(vehicles))


def real_time_part(plan: Plan, again: Mapping[str, str] = NOTHING) -> PartPlan | None:
    """A sensor, an input or a driver that needs real time although all vehicles are simulated; None
    for none. again: the inputs that a record stands in for."""
    if not plan.simulated:
        return None
    sensors = (s.part for v in plan.vehicles for s in v.sensors)
    inputs = (i.part for i in plan.inputs if i.name not in again)
    drivers = (v.driver for v in plan.vehicles)
    return next((p for p in (*sensors, *inputs, *drivers) if p.cls.real_time(p.params)), None)


def pace_of(plan: Plan, asked: float | None, again: Mapping[str, str] = NOTHING) -> float | None:
    """The pace of the simulated clock: what was asked for, else real time where a sensor, a person
    or a driver needs that. Raises DriverError for a pace that they can't keep."""
    part = real_time_part(plan, again)
    if part is None:
        return asked
    if asked not in (None, 1.0):
        reason = f"`{part.name}` ({part.at}) works in real time, which the simulation must keep"
        raise DriverError(f"{reason}: fly with `--speed 1` or without `--speed`")
    return 1.0


def open_devices(plan: Plan, seed: int, again: Mapping[str, str] = NOTHING) -> Devices:
    """Open everything that the plan names. again: for each input that isn't opened, what an earlier
    run recorded of it. Raises DriverError, and nothing is open then."""
    devices = Devices(_open_sessions(plan, seed), {}, {}, {}, {})
    links = _links(devices)
    try:
        for vehicle in plan.vehicles:
            opened = devices.sensors[vehicle.name] = []
            context, link = context_of(plan, vehicle), links[vehicle.name]
            for sensor in vehicle.sensors:
                own = random.Random(f"{seed} {vehicle.name} {sensor.part.label}")
                opened.append(OpenSensor(sensor, _stream(sensor.part, context, link, own)))
        context = context_of(plan, plan.vehicles[0])
        devices.watching.update(watching_streams(plan, links, context, seed))
        for plan_input in plan.inputs:
            devices.inputs[plan_input.name] = _input(plan_input, devices, again)
    except BaseException:
        devices.close()
        raise
    return devices


def _stream(part: PartPlan, context: VehicleContext, link: Link, own: random.Random) -> Stream:
    try:
        stream: Stream = part.cls.open(part.params, context, link, own)
    except DriverError as error:
        raise DriverError(f"`{part.name}` ({part.at}): {error}") from error
    return stream


def _input(plan: InputPlan, devices: Devices, again: Mapping[str, str]) -> InputLink:
    def sticks_of(vehicle: str) -> Sticks | None:
        return devices.vehicles[vehicle].knowledge.sticks if devices.vehicles else None

    part = plan.part
    try:
        if plan.name in again:
            from kybflow.inputs.rows import parse
            from kybflow.inputs.script import RowsLink

            return RowsLink(parse(again[plan.name]).rows)
        link: InputLink = part.cls.open(part.params, sticks_of)
    except (DriverError, FileError) as error:
        raise DriverError(f"`{plan.name}` ({part.name}, {part.at}): {error}") from error
    return link


def _links(devices: Devices) -> dict[str, Link]:
    return {name: link for session in devices.sessions for name, link in session.links.items()}


def _open_sessions(plan: Plan, seed: int) -> list[Session]:
    """One session for each driver, with every vehicle that flies on it."""
    generator = random.Random(seed)
    by_driver: dict[type[Driver[Any]], list[VehiclePlan]] = {}
    for vehicle in plan.vehicles:
        by_driver.setdefault(vehicle.driver.cls, []).append(vehicle)
    sessions: list[Session] = []
    try:
        for driver, vehicles in by_driver.items():
            seats = [Seat(context_of(plan, v), v.driver.params) for v in vehicles]
            sessions.append(driver.open(seats, generator))
    except BaseException:
        Devices(sessions, {}, {}, {}, {}).close()
        raise
    return sessions


def context_of(plan: Plan, vehicle: VehiclePlan) -> VehicleContext:
    """The facts about a vehicle and its surroundings that its parts may use."""
    return VehicleContext(
        vehicle.name,
        vehicle.airframe,
        vehicle.start,
        vehicle.heading,
        plan.fence,
        1.0 / plan.control_rate,
        vehicle.home,
        plan.obstacles,
        {other.name: other.airframe.diameter for other in plan.vehicles},
        plan.tags,
        vehicle.cameras,
        vehicle.payload,
        vehicle.driver.cls.inner_loop(vehicle.driver.params, vehicle.airframe),
        {other.name: other.start for other in plan.vehicles},
        plan.groups,
        plan.touchable,
        plan.moving,
    )


def assemble(
    plan: Plan,
    devices: Devices,
    events: Events,
    clock: Clock,
    score: Score,
    *,
    vehicle_observer: Callable[[str], VehicleObserver] = lambda _: VehicleObserver(),
    observers: Sequence[Observer] = (),
    seed: int = 0,
    commands: CommandQueue | None = None,
    judge: EntryJudge | None = None,
    note: NoteInput = unnoted,
    options: Sequence[tuple[str, str]] = (),
    interrupts: int = 0,
) -> Engine:
    """The engine that flies, inspects or rehearses `plan` on the open devices, with all that it
    needs. vehicle_observer: gives the observer of a vehicle's name. judge: judges the values that
    states are asked for with. note: takes what the inputs say. options: values for options, as
    (name, value). interrupts: the signals so far. Raises PartFailed where a part can't be made,
    OptionRefused for an option that can't be changed."""
    links, bodies, fleet = _links(devices), Bodies(), EstimateHistory()
    broadcasts, inputs = _broadcasts(plan), Inputs(plan.inputs, devices.inputs, events, note)
    moving = MovingObstacles(plan.moving, events, devices.watching)
    settable = Options(devices.vehicles, events)
    for vehicle in plan.vehicles:
        name, context = vehicle.name, context_of(plan, vehicle)
        devices.vehicles[name] = Vehicle(
            vehicle, context, links[name], events, vehicle_observer(name), score.vehicle(name),
            settable.set, judge, devices.sensors[name], bodies, fleet, inputs.readings, broadcasts,
            moving.seen,
        )  # fmt: skip
    engine = Engine(
        plan, clock, devices.sessions, [*devices.vehicles.values()], events, settable, inputs,
        moving, observers, seed, commands, interrupts,
    )  # fmt: skip
    for option, value in options:
        settable.set(option, value, "command line")
    return engine


def _broadcasts(plan: Plan) -> Broadcasts | None:
    """What the vehicles will publish to each other, None where nobody would listen."""
    behaviors = {state.behavior.cls for v in plan.vehicles for state in v.states.values()}
    listening = [cls for cls in behaviors if cls.hears]
    for cls in listening:
        cls.prepare()
    return Broadcasts() if listening else None


def clock_for(plan: Plan, speed: float | None) -> Clock:
    if plan.simulated:
        return SimulatedClock(plan.control_rate, speed)
    return WallClock(plan.control_rate)
