"""Flies a plan and writes its run folder, or only runs the preflight checks."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from math import hypot
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.api.opening import (
    Devices,
    OptionJudge,
    PlanEntryJudge,
    assemble,
    clock_for,
    open_devices,
    pace_of,
)
from kybflow.core.errors import DriverError, PartFailed, described
from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Event, Time
from kybflow.dsl import expressions as ex
from kybflow.dsl.plan import ExpectationPlan, Plan
from kybflow.parts.events import (
    CommandGiven,
    CommandsFailed,
    RecordingStopped,
    RehearsalSkipped,
    RunEnded,
)
from kybflow.recording.outcome import EXIT_CODES, Ending, summarise
from kybflow.recording.pictures import Pictures
from kybflow.recording.recorder import Recorder
from kybflow.recording.run_folder import LAYOUT, create_run_folder
from kybflow.runtime.clock import Clock
from kybflow.runtime.commanding.command_queue import CommandQueue, RecordedCommand
from kybflow.runtime.commanding.legal import check_emitted
from kybflow.runtime.commanding.orders import SCHEDULE
from kybflow.runtime.engine import Engine, Observer
from kybflow.runtime.events import Events
from kybflow.runtime.expectations import Verdict
from kybflow.runtime.interrupts import Interrupts
from kybflow.runtime.options import check_options
from kybflow.runtime.preflight import PreflightResult
from kybflow.runtime.scores import Score
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.ground import STAND_HEIGHT, height_above_ground
from kybflow.world.vehicle_context import LEGS

if TYPE_CHECKING:
    from kybflow.api.replay.tape import Tape

Server = Callable[[CommandQueue, Path], AbstractContextManager[object]]
"""Returns a context manager that accepts commands for the run in the given folder."""
FAULT = "fault"
COLLECTED_IN_FLIGHT = (700, 10, 10)
"""The garbage collector's thresholds in flight: Python's defaults. The command line raises them to
start faster."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The settings of a run that are not in its plan.

    out: the run folder; None for a new one in `runs/`. speed: pace of a simulated clock, 1 for real
    time; None for as fast as the sensors and inputs allow. options: parameters of parts to change
    before take-off, as (name, value). emitted: the operator's events, as (seconds, name). sets: the
    `NAME=VALUE` arguments with which the plan was compiled, for `provenance.json` only. again: the
    commands of an earlier run, to repeat in the same ticks. inputs: the recorded table of each
    input that replaces its device. skips_rehearsal: whether hardware flies without a rehearsal; the
    run then emits an event that says so. tape: a record whose measurements replace the devices.
    """

    seed: int = 0
    out: Path | None = None
    speed: float | None = None
    options: tuple[tuple[str, str], ...] = ()
    emitted: tuple[tuple[float, str], ...] = ()
    sets: tuple[str, ...] = ()
    again: tuple[RecordedCommand, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    skips_rehearsal: bool = False
    tape: Tape | None = None

    def record(self) -> dict[str, Any]:
        """Return the request for `provenance.json`, with options as on the command line."""
        return {
            "seed": self.seed,
            "speed": self.speed,
            "set": [*self.sets],
            "option": [f"{name}={value}" for name, value in self.options],
            "emit": [f"{name}@{seconds!r}s" for seconds, name in self.emitted],
            **({} if self.tape is None else {"replay_of": str(self.tape.folder)}),
        }


@dataclass(frozen=True, slots=True)
class Flown:
    """A finished run. summary: the content of `summary.json`. never_given: the operator's events
    that were due only after the run's end."""

    folder: Path
    summary: dict[str, Any]
    never_given: tuple[tuple[float, str], ...] = ()

    @property
    def exit_code(self) -> int:
        return EXIT_CODES[self.summary["outcome"]]


def fly(
    plan: Plan,
    request: RunRequest,
    listeners: Sequence[Callable[[Event], None]] = (),
    observers: Sequence[Observer] = (),
    servers: Sequence[Server] = (),
) -> Flown:
    """Fly `plan`.

    listeners: called with every event. observers: called with the engine after every tick. servers:
    accept commands for the run. Raises RunFolderError if the folder can't be used, RunUnwritten if
    it can't be written, OptionRefused for an option that can't be changed, and EventRefused for an
    event that nothing waits for. Later failures are not raised but listed in the summary.
    """
    began, started = time.monotonic(), datetime.now().astimezone()
    check_options(plan, request.options, OptionJudge(plan))
    check_emitted(plan, (name for _, name in request.emitted))
    commands = CommandQueue(request.emitted, request.again)
    record = _Record(plan, request, started)
    recorder, folder = record.recorder, record.folder
    try:
        events = Events((recorder.event, folder.event, *listeners))
        run = _Run(plan, request, events, record, commands)
        watching: list[Observer] = [record]
        if plan.moving:
            watching.append(lambda e: recorder.obstacles(e.clock.now, e.moving.seen))
        if plan.objects:
            watching.append(
                lambda e: recorder.shown_objects(
                    e.clock.now,
                    e.true_objects.states if e.true_objects.is_known else {},
                    e.objects.seen,
                    e.contacts.forces,
                    {name: touched.object for name, touched in e.inferred.touching.items()},
                )
            )
        watching += observers
        if any(vehicle.cameras for vehicle in plan.vehicles):
            watching.append(Pictures(folder))
        if request.skips_rehearsal:
            events.emit(RehearsalSkipped())
        with Interrupts(run), _served(servers, commands, folder.path, events):
            run.fly(watching)
            record.close()
            wall_time_s = time.monotonic() - began
            summary = run.summary(wall_time_s, record.failed)
            if not folder.finish(summary):
                summary = run.summary(wall_time_s, record.failed)
    finally:
        record.close()
    return Flown(folder.path, summary, commands.never_given)


@contextmanager
def _served(
    servers: Sequence[Server], commands: CommandQueue, folder: Path, events: Events
) -> Iterator[None]:
    """Start the command servers. A server that can't start emits an event and is left out. On exit,
    answer every pending command."""
    with ExitStack() as stack:
        for serve in servers:
            try:
                stack.enter_context(serve(commands, folder))
            except Exception as error:  # a command server must not stop the flight
                events.emit(CommandsFailed(reason=described(error)))
        stack.callback(commands.close)
        yield


class _Record:
    """The recording and the folder of a run. As an observer of the engine it checks once a second
    that both still exist; if one is lost, it emits an event and checks no more."""

    def __init__(self, plan: Plan, request: RunRequest, started: datetime) -> None:
        from kybflow.recording.viewers.panels import layout  # loads in 70 ms

        self.folder = create_run_folder(plan, request.out, started)
        try:
            self.folder.describe(plan, request.record(), started)
            self.folder.add(LAYOUT, layout(plan).encode())
            self.recorder = Recorder(self.folder.log, plan, started)
        except BaseException:
            self.folder.close()
            raise
        self._due: Time | None = 0

    @property
    def failed(self) -> str | None:
        return self.recorder.failed or self.folder.failed

    def __call__(self, engine: Engine) -> None:
        if self._due is None or engine.clock.now < self._due:
            return
        self._due = engine.clock.now + NS
        self.recorder.check()
        self.folder.check()
        if self.failed:
            self._due = None
            engine.events.emit(RecordingStopped(reason=self.failed))

    def close(self) -> None:
        """Close the recording and the folder; may be called again."""
        self.recorder.close()
        self.folder.close()


class Inspected(NamedTuple):
    """The preflight checks of every vehicle. driver_failed: the error of a link that failed during
    the checks, for example because no autopilot answers; None if all links work."""

    lines: list[PreflightResult]
    driver_failed: str | None


def inspect(plan: Plan, seed: int = 0) -> Inspected:
    """Run the preflight checks of every vehicle. No vehicle arms and nothing is recorded. Raises
    DriverError if a device can't be opened, PartFailed if a part can't be made."""
    devices = open_devices(plan, seed)
    try:
        clock = clock_for(plan, pace_of(plan, None))
        engine = assemble(plan, devices, Events(), clock, Score(plan))
        lines = engine.inspect()
        failed = next((v.link_error for v in engine.vehicles if v.link_error), None)
        return Inspected(lines, failed)
    finally:
        devices.close()


_UNHEARD_S = 5.0
"""The age of a vehicle's last measurement (s) after which nobody knows where it is."""


def is_in_air(vehicle: Vehicle, vehicles: Iterable[Vehicle]) -> bool:
    """Return whether a vehicle is off the ground by its own state or, if it believes itself on the
    ground, in the air by a simulator's truth. vehicles: all vehicles, because it may lie on another
    one or on a payload."""
    truth = vehicle.truth
    if vehicle.runner.off_ground or truth is None:
        return vehicle.runner.off_ground
    x, y, z = truth.position
    reach = vehicle.context.airframe.diameter
    tops = list[float]()  # heights at which the vehicle would stand on another one or a payload
    for other in vehicles:
        below, parcel, things = other.truth, other.context.payload, list[tuple[Vec3, float]]()
        if below is not None:
            things.append((below.position, LEGS))
            if parcel is not None and below.payload is not None:
                things.append((below.payload, 0.5 * parcel.size + LEGS))
        for (ox, oy, oz), height in things:
            if hypot(ox - x, oy - y) < reach and oz < z - LEGS:
                tops.append(oz + height)
    return height_above_ground(vehicle.context, truth.position, truth.attitude, tops) > STAND_HEIGHT


@contextmanager
def _frozen_garbage() -> Iterator[None]:
    """Exclude the existing objects from garbage collection, because scanning them takes 0.1 s on a
    slow machine, and collect often, so that each collection is short."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*COLLECTED_IN_FLIGHT)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()


class _Run:
    """A run and its result. interrupts: the number of signals received while no engine flies."""

    def __init__(
        self,
        plan: Plan,
        request: RunRequest,
        events: Events,
        record: _Record,
        commands: CommandQueue,
    ) -> None:
        self._plan, self._request = plan, request
        self._events, self._record, self._commands = events, record, commands
        self._score = Score(plan)
        self.interrupts, self.interrupted_by = 0, ""
        self._engine: Engine | None = None
        self._reason: str | None = None
        self._driver_failed: str | None = None
        self._verdicts: tuple[Verdict, ...] = ()
        self._accepted: list[Event] = []
        events.listeners.append(self._note_command)

    def _note_command(self, event: Event) -> None:
        fields = event.fields
        if event.name == CommandGiven.name and fields["accepted"] and fields["by"] != SCHEDULE:
            self._accepted.append(event)

    def fly(self, observers: Sequence[Observer]) -> None:
        """Open the drivers, fly to the end, close the drivers and judge the expectations."""
        devices: Devices | None = None
        try:
            again = self._request.inputs
            tape = self._request.tape
            if tape is None:
                clock = clock_for(self._plan, pace_of(self._plan, self._request.speed, again))
                devices = open_devices(self._plan, self._request.seed, again)
            else:
                clock = tape.clock(self._plan)
                devices = tape.devices(self._plan, self._events, again)
            self._reason = self._flown(devices, clock, observers)
        except DriverError as error:
            self._driver_failed = str(error)
        except PartFailed as failure:
            self._reason = f"`{failure.part}` can't be made: {failure}"
        finally:
            if devices is not None:
                reasons = devices.close()
                self._driver_failed = self._driver_failed or "; ".join(reasons) or None
        engine = self._engine
        if engine is not None:
            if engine.flying:
                for vehicle in engine.vehicles:
                    vehicle.runner.close(engine.clock.now)
                engine.flows.close(engine.clock.now)
            ended_well = self._reason is None and self._driver_failed is None
            self._verdicts = engine.judge.verdicts(engine.mission_seconds() if ended_well else None)
            self._events.turn(engine.clock.now)
        self._events.emit(RunEnded(reason=self._reason or self._driver_failed))

    def _flown(self, devices: Devices, clock: Clock, observers: Sequence[Observer]) -> str | None:
        plan, request = self._plan, self._request
        engine = self._engine = assemble(
            plan, devices, self._events, clock, self._score,
            vehicle_observer=self._record.recorder.vehicle, world_observer=self._record.recorder,
            observers=observers, seed=request.seed,
            commands=self._commands, judge=PlanEntryJudge(plan), note=self._record.folder.input,
            options=request.options, interrupts=self.interrupts,
        )  # fmt: skip
        engine.interrupted_by = self.interrupted_by
        if request.tape is not None:
            request.tape.interrupts(engine)
        with Interrupts(engine), _frozen_garbage():
            try:
                reason = engine.run()
            finally:
                engine.commander.close()
                engine.inputs.end(clock.now, "the run ended")
        self._driver_failed = next((v.link_error for v in engine.vehicles if v.link_error), None)
        return reason

    def summary(self, wall_time_s: float, recording: str | None) -> dict[str, Any]:
        """Return the content of `summary.json`."""
        engine = self._engine
        vehicles = engine.vehicles if engine else ()
        ending = Ending(
            reason=self._reason,
            interrupted=engine is not None and engine.interrupts > 0,
            driver=self._driver_failed,
            recording=recording,
            in_air=[vehicle.name for vehicle in vehicles if is_in_air(vehicle, vehicles)],
            unheard=[
                vehicle.name
                for vehicle in vehicles
                if vehicle.truth is None and vehicle.link_age > _UNHEARD_S
            ],
            expected_faults=expected_faults(self._plan.expectations),
        )
        return summarise(
            self._plan,
            self._score,
            self._verdicts,
            ending,
            seed=self._request.seed,
            sim_time_s=engine.seconds() if engine else 0.0,
            wall_time_s=wall_time_s,
            missed_ticks=engine.clock.missed if engine else 0,
            flows=engine.flows.record() if engine else {},
            never_injected=engine.injection.never_injected if engine else self._plan.faults,
            commands=self._accepted,
        )


def expected_faults(expectations: Iterable[ExpectationPlan]) -> frozenset[str]:
    """Return the vehicles that the mission expects to end in `fault`. Their faults don't fail the
    run.

    An expectation names such a vehicle as `finally sick in fault`, `eventually sick in fault` or
    `sick.behavior == fault`, also as a member of a group and inside `and` and `or`, but not under
    `not`.
    """
    return frozenset(name for plan in expectations for name in _expected(plan.expression))


def _expected(expression: ex.Expression) -> Iterator[str]:
    match expression:
        case ex.Finally(condition) | ex.Eventually(condition, _):
            yield from _expected(condition)
        case ex.And(parts) | ex.Or(parts):
            for part in parts:
                yield from _expected(part)
        case ex.InState(vehicle, state) if state == FAULT:
            yield vehicle
        case ex.GroupInState(_, _, vehicles, state) if state == FAULT:
            yield from vehicles
        case ex.Compare("==", ex.Read(str(vehicle), "behavior"), ex.Word(state)) if state == FAULT:
            yield vehicle
