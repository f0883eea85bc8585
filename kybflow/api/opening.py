"""Opens and assembles everything that a flight needs: the sessions of the drivers, the other
sensors, a clock, the vehicles, the engine and the judge of the values that commands give."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from kybflow.core.errors import DriverError, FileError, KybflowError, Refused, described
from kybflow.core.geometry import Vec3
from kybflow.core.params import Field
from kybflow.core.signals import Sticks
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.entry_values import OF_ENTRIES, OF_OPTIONS
from kybflow.dsl.diagnostics import Collector, Diagnostic, Severity, Span
from kybflow.dsl.expanding.flows import entry_values, with_options
from kybflow.dsl.expanding.world import Points
from kybflow.dsl.language.records import Source
from kybflow.dsl.plan import InputPlan, PartPlan, Plan, Values, VehiclePlan
from kybflow.dsl.reading import nodes
from kybflow.dsl.reading.reader import compose
from kybflow.flight.loops.position_loop import delay_margin
from kybflow.parts import Driver, InputLink, Link, Seat, Session, Stream
from kybflow.parts.catalog import Catalog
from kybflow.parts.true_objects import TrueObjects
from kybflow.runtime.clock import Clock, SimulatedClock, WallClock
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.engine import Engine, Observer
from kybflow.runtime.events import Events, VehicleObserver, WorldObserver
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.runtime.fleet.inputs import Inputs, NoteInput, unnoted
from kybflow.runtime.fleet.moving_obstacles import moving_obstacles
from kybflow.runtime.fleet.tracked_objects import tracked_objects
from kybflow.runtime.monitoring.bodies import Bodies
from kybflow.runtime.monitoring.cameras import EstimateHistory
from kybflow.runtime.monitoring.sensing import OpenSensor
from kybflow.runtime.options import Options
from kybflow.runtime.scores import Score
from kybflow.runtime.vehicle.requests import EntryJudge
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.sensors.simulated_motion_capture import (
    BodyStream,
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams,
    truth_of,
)
from kybflow.world.shapes import MovingSphere
from kybflow.world.vehicle_context import VehicleContext

NOTHING: Mapping[str, str] = MappingProxyType({})
_SIMULATED = PartPlan(
    "simulated_motion_capture",
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams(),
    "simulated_motion_capture",
)
"""The motion capture that tracks moving obstacles and objects if all vehicles are simulated and no
vehicle has a system that could see them."""


class Devices(NamedTuple):
    """The open devices.

    sessions: the sessions of the drivers. sensors: for each vehicle, the sensors that its driver
    doesn't open. inputs: the input devices, by name. vehicles: the vehicles that use the devices,
    by name; inputs may read their sticks. watching: the pose stream of each moving obstacle and
    object, by name.
    """

    sessions: list[Session]
    sensors: dict[str, list[OpenSensor]]
    inputs: dict[str, InputLink]
    vehicles: dict[str, Vehicle]
    watching: dict[str, Stream]

    def close(self) -> list[str]:
        """Close all devices and return a message for each one that can't be closed."""
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
    """Return the plan with each driver's own view switched on. Raises KybflowError if a driver has
    none."""
    vehicles = []
    for vehicle in plan.vehicles:
        driver = vehicle.driver
        if not hasattr(driver.params, "live"):
            raise KybflowError(f"the driver `{driver.name}` has no view of its own for --live")
        driver = replace(driver, params=replace(driver.params, live=True))
        vehicles.append(replace(vehicle, driver=driver))
    return replace(plan, vehicles=tuple(vehicles))


def real_time_part(plan: Plan, again: Mapping[str, str] = NOTHING) -> PartPlan | None:
    """Return a sensor, input or driver that needs real time although all vehicles are simulated, or
    None. again: the inputs that are replayed from a record."""
    if not plan.simulated:
        return None
    sensors = (s.part for v in plan.vehicles for s in v.sensors)
    inputs = (i.part for i in plan.inputs if i.name not in again)
    drivers = (v.driver for v in plan.vehicles)
    return next((p for p in (*sensors, *inputs, *drivers) if p.cls.real_time(p.params)), None)


def pace_of(plan: Plan, asked: float | None, again: Mapping[str, str] = NOTHING) -> float | None:
    """Return the pace of the simulated clock: real time if a part needs it, otherwise `asked`.
    Raises DriverError if a part needs real time but another pace was requested."""
    part = real_time_part(plan, again)
    if part is None:
        return asked
    if asked not in (None, 1.0):
        reason = f"`{part.name}` ({part.at}) works in real time, so the simulation must too"
        raise DriverError(f"{reason}: fly with `--speed 1` or without `--speed`")
    return 1.0


def open_devices(plan: Plan, seed: int, again: Mapping[str, str] = NOTHING) -> Devices:
    """Open all devices of the plan. again: the recorded table of each input that is replayed
    instead of opened. Raises DriverError and then leaves no device open."""
    devices = Devices([], {}, {}, {}, {})
    try:
        generator = random.Random(seed)
        by_driver: dict[type[Driver[Any]], list[VehiclePlan]] = {}
        for vehicle in plan.vehicles:
            by_driver.setdefault(vehicle.driver.cls, []).append(vehicle)
        for driver, vehicles in by_driver.items():
            seats = [Seat(context_of(plan, v), v.driver.params) for v in vehicles]
            devices.sessions.append(driver.open(seats, generator))
        links = _links(devices)
        for vehicle in plan.vehicles:
            opened = devices.sensors[vehicle.name] = []
            context, link = context_of(plan, vehicle), links[vehicle.name]
            for sensor in vehicle.sensors:
                own = random.Random(f"{seed} {vehicle.name} {sensor.part.label}")
                opened.append(OpenSensor(sensor, _stream(sensor.part, context, own, link)))
        context = context_of(plan, plan.vehicles[0])
        objects = TrueObjects(plan.objects, devices.sessions)
        for name, body in plan.tracked.items():
            tracked, part = plan.watching.get(name, ("", _SIMULATED))
            own = random.Random(f"{seed} obstacle {name}")
            opens = partial(_stream, part, context._replace(vehicle=name), own)
            truth = truth_of(body) if isinstance(body, MovingSphere) else objects.truth_of(name)
            is_simulated = part.cls.simulated
            faults = objects.faults.get(name)
            stream = BodyStream(truth, opens, faults) if is_simulated else opens(links[tracked])
            devices.watching[name] = stream
        for plan_input in plan.inputs:
            devices.inputs[plan_input.name] = open_input(plan_input, devices, again)
    except BaseException:
        devices.close()
        raise
    return devices


def _stream(part: PartPlan, context: VehicleContext, own: random.Random, link: Link) -> Stream:
    try:
        stream: Stream = part.cls.open(part.params, context, link, own)
    except DriverError as error:
        raise DriverError(f"`{part.name}` ({part.at}): {error}") from error
    return stream


def open_input(plan: InputPlan, devices: Devices, again: Mapping[str, str]) -> InputLink:
    """Open an input, or its recorded table in `again`. Raises DriverError."""

    def sticks_of(vehicle: str) -> Sticks | None:
        return devices.vehicles[vehicle].knowledge.sticks if devices.vehicles else None

    part = plan.part
    try:
        if plan.name in again:
            from kybflow.inputs.rows import parse
            from kybflow.inputs.script import RowsLink

            named = {name: button for button, name in plan.button_names.items()}
            rows = parse(again[plan.name]).rows  # whose buttons have the mission's names
            return RowsLink(
                tuple(
                    row._replace(held=frozenset(named.get(b, b) for b in row.held)) for row in rows
                )
            )
        link: InputLink = part.cls.open(part.params, sticks_of)
    except (DriverError, FileError) as error:
        raise DriverError(f"`{plan.name}` ({part.name}, {part.at}): {error}") from error
    return link


def _links(devices: Devices) -> dict[str, Link]:
    return {name: link for session in devices.sessions for name, link in session.links.items()}


def context_of(plan: Plan, vehicle: VehiclePlan) -> VehicleContext:
    """Return the facts about a vehicle and its surroundings that its parts may use."""
    sizes = {other.name: other.airframe.diameter for other in plan.vehicles}
    starts = {other.name: other.start for other in plan.vehicles}
    airframe, tracker, period = vehicle.airframe, vehicle.tracker, 1.0 / plan.control_rate
    inner = vehicle.driver.cls.inner_loop(vehicle.driver.params, airframe)
    outer = tracker.cls.outer_loop(tracker.params, airframe, inner, period)
    return VehicleContext(
        vehicle.name, airframe, vehicle.start, vehicle.heading, plan.fence,
        period, vehicle.home, plan.obstacles, sizes, plan.tags, vehicle.cameras,
        vehicle.payload, inner, starts, plan.groups, plan.touchable, plan.moving,
        delay_margin(outer, inner), plan.objects,
    )  # fmt: skip


def assemble(
    plan: Plan,
    devices: Devices,
    events: Events,
    clock: Clock,
    score: Score,
    *,
    vehicle_observer: Callable[[str], VehicleObserver] = lambda _: VehicleObserver(),
    world_observer: WorldObserver | None = None,
    observers: Sequence[Observer] = (),
    seed: int = 0,
    commands: CommandQueue | None = None,
    judge: EntryJudge | None = None,
    note: NoteInput = unnoted,
    options: Sequence[tuple[str, str]] = (),
    interrupts: int = 0,
) -> Engine:
    """Build the engine that flies, inspects or rehearses `plan` with the open devices.

    vehicle_observer: returns the observer of the vehicle with the given name. world_observer: that
    of moving obstacles and objects. judge: checks the
    values given with a request for a state. note: receives the readings of the inputs. options:
    parameters of parts to change, as (name, value). interrupts: the number of signals received so
    far. Raises PartFailed if a part can't be made, OptionRefused for an option that can't be
    changed.
    """
    links, bodies, fleet = _links(devices), Bodies(), EstimateHistory()
    inputs = Inputs(plan.inputs, devices.inputs, events, note)
    behaviors = {state.behavior.cls for v in plan.vehicles for state in v.states.values()}
    broadcasts = Broadcasts() if any(cls.hears for cls in behaviors) else None
    moving = moving_obstacles(plan.moving, events, devices.watching, world_observer)
    objects = tracked_objects(plan.objects, events, devices.watching, world_observer)
    settable = Options(devices.vehicles, events, OptionJudge(plan))
    for vehicle in plan.vehicles:
        name, context = vehicle.name, context_of(plan, vehicle)
        devices.vehicles[name] = Vehicle(
            vehicle, context, links[name], events, vehicle_observer(name), score.vehicle(name),
            settable.set, judge, devices.sensors[name], bodies, fleet, inputs.readings, broadcasts,
            moving.seen, objects.seen,
        )  # fmt: skip
    engine = Engine(
        plan, clock, devices.sessions, [*devices.vehicles.values()], events, settable, inputs,
        moving, objects, observers, seed, commands, interrupts, world_observer,
    )  # fmt: skip
    for option, value in options:
        settable.set(option, value, "command line")
    return engine


def clock_for(plan: Plan, speed: float | None) -> Clock:
    if plan.simulated:
        return SimulatedClock(plan.control_rate, speed)
    return WallClock(plan.control_rate)


_HERE = Span("the command", 1, 1, 1, 1)
"""The source location of values that a command gives."""


class PlanEntryJudge:
    """Checks the values that a command gives for a state (`EntryJudge`). The compiler's checks run
    on the mission as if the vehicle began in that state, with those values, at its present
    position."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def read(self, vehicle: str, state: str, written: Values) -> Values:
        own = self._plan.fleet[vehicle].states[state]
        if own.built_in:
            raise Refused(f"`{state}` is built in and takes no values")
        entries: dict[str, nodes.MappingEntry] = {}
        for name, text in written:
            found = Collector()
            node = compose(text, _HERE.file, found)
            if node is not None:
                node = Points(self._plan.points, found).apply(node)
            if node is None or found.all:
                raise Refused(f"`{name}`: {_in_a_line(found.all[0])}")
            entries[name] = nodes.MappingEntry(nodes.Scalar(name, _HERE), node)
        found = Collector()
        values = entry_values(Source(_HERE, nodes.Mapping(entries, _HERE)), own.behavior, found)
        if found.all:
            raise Refused(_in_a_line(found.all[0]))
        return values

    def objection(
        self, vehicle: str, state: str, params: Any, points: Sequence[Vec3]
    ) -> str | None:
        own = self._plan.fleet[vehicle]
        entered = own.states[state]
        entered = entered.but(behavior=entered.behavior.but(params=params))
        for point in points:
            begins = own.but(start=point, begin=state, states={state: entered.but(transitions=())},
                estimators=(), supervisors=(), sensors=(), requested=frozenset(),
                requested_first=frozenset(),
            )  # fmt: skip
            alone = self._plan.but(vehicles=(begins,), flows=(), callbacks=(), faults=(), inputs=(),
                groups={}, moving={},
            )  # fmt: skip
            case = Case(alone, Catalog({}))
            first = next((f for check in OF_ENTRIES for f in check(case)), None)
            if first is not None:
                return _in_a_line(first)
        return None


class OptionJudge:
    """Checks the values to which options are changed during a run (`Objection`). The compiler's
    checks run on the mission as if it declared the value where the part is used, with all other
    values as the mission has them."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def __call__(self, vehicle: str, label: str, field: Field, value: Any) -> str | None:
        option = (vehicle, label, field, value)
        changed = with_options(self._plan, (option,), nodes.Scalar("", _HERE))
        if changed is None:
            return None
        case = Case(changed, Catalog({}))
        found = (f for check in OF_OPTIONS for f in check(case))
        wrong = (f for f in found if f.span == _HERE and f.severity is Severity.ERROR)
        first = next(wrong, None)
        return None if first is None else _in_a_line(first)


def _in_a_line(finding: Diagnostic) -> str:
    label = f": {finding.label}" if finding.label else ""
    hint = f"; {finding.help}" if finding.help else ""
    return f"{finding.message}{label}{hint}"
