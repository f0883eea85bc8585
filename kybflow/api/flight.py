"""From a plan to a run folder: opens the drivers, flies, and writes the run's files; or only runs
the preflight checks."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from math import hypot
from pathlib import Path
from typing import Any, NamedTuple

from kybflow.api.entry_judge import PlanEntryJudge
from kybflow.api.opening import (
    Devices,
    assemble,
    clock_for,
    open_devices,
    pace_of,
)
from kybflow.core.errors import DriverError, PartFailed, described
from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Event, Time
from kybflow.dsl.expressions import (
    And,
    Compare,
    Eventually,
    Expression,
    Finally,
    GroupInState,
    InState,
    Or,
    Read,
    Word,
)
from kybflow.dsl.plan import ExpectationPlan, Plan
from kybflow.parts.events import CommandsFailed, RecordingStopped, RehearsalSkipped, RunEnded
from kybflow.recording.outcome import EXIT_CODES, Ending, summarise
from kybflow.recording.pictures import Pictures
from kybflow.recording.recorder import Recorder
from kybflow.recording.run_folder import RunFolder, create_run_folder
from kybflow.runtime.commanding.awaited import check_emitted
from kybflow.runtime.commanding.command_queue import CommandQueue, RecordedCommand
from kybflow.runtime.engine import Engine, Observer
from kybflow.runtime.events import Events
from kybflow.runtime.expectations import Verdict
from kybflow.runtime.fleet.inputs import NoteInput, unnoted
from kybflow.runtime.interrupts import Interrupts
from kybflow.runtime.options import check_options
from kybflow.runtime.preflight import PreflightResult
from kybflow.runtime.scores import Score
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.ground import STANDS, height_above_ground
from kybflow.world.vehicle_context import LEGS

Server = Callable[[CommandQueue, Path], AbstractContextManager[object]]
"""Serves the commands of a run for as long as the context lasts, in the given run folder."""
FAULT = "fault"
COLLECTED_IN_FLIGHT = (700, 10, 10)
"""How many new objects are searched for garbage at a time in flight, as Python has it by default;
a program that only starts and ends may search more."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The settings of a run beside its plan.

    speed: pace of a simulated clock, 1 for real time, None for as fast as its sensors and inputs
    allow. options: changes of parts' parameters before take-off, as (name, value). emitted: the
    operator's events, as (seconds, name). out: the run folder, None for one under `runs/`. sets:
    the `NAME=VALUE` that the plan was compiled with, for `provenance.json` only. again: the
    commands of an earlier run, given at the same ticks; inputs: what its inputs said, by name, in
    place of the devices. skips_rehearsal: somebody wants to fly hardware without a rehearsal, which
    is told.
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

    def record(self) -> dict[str, Any]:
        """The request as `provenance.json` holds it: options as the command line takes them."""
        return {
            "seed": self.seed,
            "speed": self.speed,
            "set": [*self.sets],
            "option": [f"{name}={value}" for name, value in self.options],
            "emit": [f"{name}@{seconds!r}s" for seconds, name in self.emitted],
        }


@dataclass(frozen=True, slots=True)
class Flown:
    """A run that has ended. never_given: the operator's events whose time came after its end."""

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
    """Fly `plan`. listeners hear every event, observers look at the engine between ticks, servers
    give commands. Raises RunFolderError when the folder can't be used, RunUnwritten when it can't
    be written, OptionRefused for an option that can't be changed, EventRefused for an event that
    nothing waits for; whatever happens later is in the summary."""
    began, started = time.monotonic(), datetime.now().astimezone()
    check_options(plan, request.options)
    check_emitted(plan, (name for _, name in request.emitted))
    commands = CommandQueue(request.emitted, request.again)
    record = _record(plan, request, started)
    recorder, folder = record.recorder, record.folder
    try:
        events = Events((recorder.event, folder.event, *listeners))
        run = _Run(plan, request, events, recorder, commands, folder.input)
        if request.skips_rehearsal:
            events.emit(RehearsalSkipped())
        with Interrupts(run), _served(servers, commands, folder.path, events):
            run.fly((record, *_obstacles(plan, recorder), *observers, *_pictures(plan, folder)))
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
    """Let the servers give commands. One that can't begin is reported and left out; whatever waits
    at the end is answered."""
    with ExitStack() as stack:
        for serve in servers:
            try:
                stack.enter_context(serve(commands, folder))
            except Exception as error:  # who serves commands must not stop the flight
                events.emit(CommandsFailed(reason=described(error)))
        stack.callback(commands.close)
        yield


class _Record:
    """The record of a run under way: recording and folder. As an observer of the engine it looks
    once a second whether both are still in their place, and emits an event for the first loss."""

    def __init__(self, recorder: Recorder, folder: RunFolder) -> None:
        self.recorder, self.folder = recorder, folder
        self._due: Time | None = 0

    @property
    def failed(self) -> str | None:
        return self.recorder.failed or self.folder.failed

    def __call__(self, engine: Engine) -> None:
        if self._due is None or engine.clock.now < self._due:
            return
        self._due = engine.clock.now + NS
        self.recorder.look()
        self.folder.look()
        if self.failed:
            self._due = None
            engine.events.emit(RecordingStopped(reason=self.failed))

    def close(self) -> None:
        """Close both; may be called again."""
        self.recorder.close()
        self.folder.close()


def _record(plan: Plan, request: RunRequest, started: datetime) -> _Record:
    folder = create_run_folder(plan, request.out, started)
    try:
        folder.describe(plan, request.record(), started)
        return _Record(Recorder(folder.log, plan), folder)
    except BaseException:
        folder.close()
        raise


class Inspected(NamedTuple):
    """The preflight checks of every vehicle. driver_failed: the error of a link that failed during
    them, for example because nothing answers at the other end; None where all links work."""

    lines: list[PreflightResult]
    driver_failed: str | None


def inspect(plan: Plan, seed: int = 0) -> Inspected:
    """Run the preflight checks of every vehicle; nothing arms and nothing is recorded. Raises
    DriverError where a device can't be opened, PartFailed where a part can't be made."""
    events = Events()
    devices = open_devices(plan, seed)
    try:
        clock = clock_for(plan, pace_of(plan, None))
        engine = assemble(plan, devices, events, clock, Score(plan))
        lines = engine.inspect()
        failed = next((v.link_error for v in engine.vehicles if v.link_error), None)
        return Inspected(lines, failed)
    finally:
        devices.close()


def _obstacles(plan: Plan, recorder: Recorder) -> list[Observer]:
    if not plan.moving:
        return []
    return [lambda engine: recorder.obstacles(engine.clock.now, engine.moving.seen)]


def _pictures(plan: Plan, folder: RunFolder) -> list[Observer]:
    return [Pictures(folder)] if any(vehicle.cameras for vehicle in plan.vehicles) else []


def in_the_air(vehicle: Vehicle, vehicles: Iterable[Vehicle] = ()) -> bool:
    """Whether a vehicle is in the air, by its own state or, where a simulator knows the truth, by
    that: a vehicle that believes itself on the ground may be wrong. vehicles: all, on which or on
    whose payloads it may lie."""
    truth = vehicle.truth
    if vehicle.runner.off_ground or truth is None:
        return vehicle.runner.off_ground
    x, y, z = truth.position
    reach = vehicle.context.airframe.diameter
    tops = [
        top
        for other in vehicles
        for (ox, oy, oz), top in _tops(other)
        if hypot(ox - x, oy - y) < reach and oz < z - LEGS
    ]
    return height_above_ground(vehicle.context, truth.position, truth.attitude, tops) > STANDS


def _tops(vehicle: Vehicle) -> Iterator[tuple[Vec3, float]]:
    """Where a vehicle and its payload are in truth, and how high what lies on them is."""
    truth, parcel = vehicle.truth, vehicle.context.payload
    if truth is not None:
        yield truth.position, truth.position[2] + LEGS
        if parcel is not None and truth.payload is not None:
            yield truth.payload, truth.payload[2] + 0.5 * parcel.size + LEGS


def _airborne(vehicles: Sequence[Vehicle]) -> list[str]:
    return [vehicle.name for vehicle in vehicles if in_the_air(vehicle, vehicles)]


@contextmanager
def _frozen_garbage() -> Iterator[None]:
    """Exclude everything made so far from garbage collection, so that no tick waits for a search
    through every module (0.1 s on a slow machine), nor for one through many new objects."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*COLLECTED_IN_FLIGHT)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()


class _Run:
    """A run under way: what is open, and how it ended. `interrupts` counts signals while the engine
    doesn't fly."""

    def __init__(
        self,
        plan: Plan,
        request: RunRequest,
        events: Events,
        recorder: Recorder,
        commands: CommandQueue,
        note: NoteInput = unnoted,
    ) -> None:
        self._note = note
        self._plan, self._request = plan, request
        self._events, self._recorder = events, recorder
        self._score = Score(plan)
        self._commands = commands
        self.interrupts = 0
        self._engine: Engine | None = None
        self._reason: str | None = None
        self._driver_failed: str | None = None
        self._verdicts: tuple[Verdict, ...] = ()

    def fly(self, observers: Sequence[Observer]) -> None:
        """Open the drivers, fly to the end, close them."""
        devices: Devices | None = None
        try:
            again = self._request.inputs
            pace = pace_of(self._plan, self._request.speed, again)
            devices = open_devices(self._plan, self._request.seed, again)
            self._reason = self._flown(devices, pace, observers)
        except DriverError as error:
            self._driver_failed = str(error)
        except PartFailed as failure:
            self._reason = f"`{failure.part}` can't be made: {failure}"
        finally:
            if devices is not None:
                reasons = devices.close()
                self._driver_failed = self._driver_failed or "; ".join(reasons) or None
        self._judge()
        self._events.emit(RunEnded(reason=self._reason or self._driver_failed))

    def _flown(
        self, devices: Devices, pace: float | None, observers: Sequence[Observer]
    ) -> str | None:
        plan, request, clock = self._plan, self._request, clock_for(self._plan, pace)
        engine = self._engine = assemble(
            plan, devices, self._events, clock, self._score,
            vehicle_observer=self._recorder.vehicle, observers=observers, seed=request.seed,
            commands=self._commands, judge=PlanEntryJudge(plan), note=self._note,
            options=request.options, interrupts=self.interrupts,
        )  # fmt: skip
        with Interrupts(engine), _frozen_garbage():
            try:
                reason = engine.run()
            finally:
                engine.commander.close()
                engine.inputs.end(clock.now, "the run ended")
        self._driver_failed = next((v.link_error for v in engine.vehicles if v.link_error), None)
        return reason

    def _judge(self) -> None:
        engine = self._engine
        if engine is None:
            return
        if engine.flying:
            for vehicle in engine.vehicles:
                vehicle.runner.close(engine.clock.now)
            engine.flows.close(engine.clock.now)
        ended_well = self._reason is None and self._driver_failed is None
        self._verdicts = engine.judge.verdicts(engine.seconds() if ended_well else None)

    def summary(self, wall_time_s: float, recording: str | None) -> dict[str, Any]:
        """The content of `summary.json`."""
        engine = self._engine
        ending = Ending(
            reason=self._reason,
            interrupted=engine is not None and engine.interrupts > 0,
            driver=self._driver_failed,
            recording=recording,
            airborne=_airborne(engine.vehicles) if engine else (),
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
            flows=engine.flows.record() if engine else {},
        )


def expected_faults(expectations: Iterable[ExpectationPlan]) -> frozenset[str]:
    """The vehicles that the mission expects to end in `fault`, which is then no failure of the run.

    `finally sick in fault`, or `eventually`, says so, also as `sick.behavior == fault`, of a group,
    and as a part of `and` and `or`. What stands under `not` expects the opposite.
    """
    return frozenset(name for plan in expectations for name in _expected(plan.expression))


def _expected(expression: Expression) -> Iterator[str]:
    match expression:
        case Finally(condition) | Eventually(condition, _):
            yield from _expected(condition)
        case And(parts) | Or(parts):
            for part in parts:
                yield from _expected(part)
        case InState(vehicle, state) if state == FAULT:
            yield vehicle
        case GroupInState(_, _, vehicles, state) if state == FAULT:
            yield from vehicles
        case Compare("==", Read(str(vehicle), "behavior"), Word(state)) if state == FAULT:
            yield vehicle
