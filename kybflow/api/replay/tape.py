"""The devices of a recorded run: they deliver what was measured then, and send nothing.

A link gives the recorded answers again when it is asked. Faults act on this program's side only,
because the measurements already show what they did to the vehicle. Images are not recorded: the
estimates of estimators that use them come from the record, and so do the findings on cameras and on
devices that failed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from kybflow.api.opening import Devices, open_input
from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import Vec3
from kybflow.core.signals import (
    NS,
    Battery,
    BatteryWarning,
    Command,
    Estimate,
    Event,
    Frame,
    Measurement,
    MeasurementKind,
    Payload,
    Pose,
    Sticks,
    Time,
    Truth,
    kind_name,
)
from kybflow.dsl.plan import EstimatorPlan, Plan, VehiclePlan
from kybflow.parts import ActiveFaults, Check, Estimator, Link, Session, Stream
from kybflow.parts.events import ENGINE_EVENTS, PreflightPassed, RunInterrupted
from kybflow.parts.link import Contact, Override, Touch
from kybflow.recording.layout import CONTACTS_TOPIC, EVENTS_TOPIC, dtype_spec, layout_of
from kybflow.recording.messages import TICK, Messages, Recording
from kybflow.runtime.clock import Clock
from kybflow.runtime.events import Events
from kybflow.runtime.interrupts import Counting
from kybflow.runtime.monitoring.sensing import OpenSensor
from kybflow.runtime.vehicle.link import OFFERED
from kybflow.world.objects import ObjectState
from kybflow.world.vehicle_context import VehicleContext

T = TypeVar("T")
VECTOR = np.dtype(dtype_spec("Vector"))
UNASKED = {Payload, Sticks}
"""What a link may deliver besides what its driver provides."""


class TapeEnded(DriverError):
    """The replay stops here: the record ends, or a decision differs from the recorded one."""


class _Turn:
    """Tells the last tick of the preflight from the first one of the flight, which has the same
    time: what arrived in the latter is given out 1 ns later. is_flight: whether the flight has
    begun."""

    def __init__(self, log: Recording) -> None:
        self.is_flight = False
        events = log[EVENTS_TOPIC]
        passed = (
            (place, time)
            for place, time, event in zip(
                events.places.tolist(), events.times.tolist(), events.json(), strict=True
            )
            if event["event"] == PreflightPassed.name
        )
        first: tuple[int, Time] = next(passed, (0, -1))
        self._place, self._time = first
        self._read: dict[object, Time] = {}

    def begin(self, now: Time, reader: object) -> None:
        """Note that a device is read; the flight begins when one is read at the same time again."""
        self.is_flight = self.is_flight or self._read.get(reader) == now
        self._read[reader] = now

    def times(self, messages: Messages) -> list[Time]:
        """Return the times at which messages are given out."""
        return [
            time + (time == self._time and place > self._place)
            for time, place in zip(messages.times.tolist(), messages.places.tolist(), strict=True)
        ]


class Queue(Generic[T]):
    """Recorded values in order, decoded and given out when their time has come."""

    def __init__(self, turn: _Turn, entries: Iterable[tuple[Time, T]]) -> None:
        self._turn, self._entries = turn, iter(entries)
        self._next = next(self._entries, None)

    def __bool__(self) -> bool:
        return self._next is not None

    def take(self, now: Time) -> list[T]:
        """Return the values up to `now` that were not given out yet."""
        taken = []
        until = now + self._turn.is_flight
        while self._next is not None and self._next[0] <= until:
            taken.append(self._next[1])
            self._next = next(self._entries, None)
        return taken


class Latest(Generic[T]):
    """A recorded value that holds until the next one."""

    def __init__(self, queue: Queue[T], first: T) -> None:
        self._queue, self._value = queue, first

    def at(self, now: Time) -> T:
        for value in self._queue.take(now):
            self._value = value
        return self._value


class Tape:
    """A record as devices. folder: that of its run. outside: the recorded events that its devices
    can't cause, by vehicle. watch: is called after each tick with its time, and may raise
    TapeEnded."""

    def __init__(
        self,
        folder: Path,
        log: Recording,
        outside: Mapping[str, Sequence[Event]],
        watch: Callable[[Time], None],
    ) -> None:
        self.folder = folder
        self._log, self._outside, self._watch = log, outside, watch
        self._turn = _Turn(log)
        interrupts = (e for e in outside.get("", ()) if e.name == RunInterrupted.name)
        self._interrupts = Queue(self._turn, ((e.time, str(e.fields["by"])) for e in interrupts))
        self._engine: Counting | None = None
        ticks = [log[f"/{name}/tick"].times for name in log.mission["vehicles"]]
        self._ticks: list[Time] = next((times.tolist() for times in ticks if len(times)), [])
        self.end: Time = self._ticks[-1] if self._ticks else log.end

    def interrupts(self, engine: Counting) -> None:
        """From now on, interrupt `engine` as the run was interrupted."""
        self._engine = engine

    def _after_tick(self, now: Time) -> None:
        self._watch(now)
        engine = self._engine
        if engine is not None:
            for by in self._interrupts.take(now):
                engine.interrupts += 1
                engine.interrupted_by = by

    def clock(self, plan: Plan) -> Clock:
        return _TapeClock(plan.control_rate, self._ticks)

    def plan(self, plan: Plan) -> Plan:
        """Return the plan without what needs images."""
        return plan.but(vehicles=tuple(self._without_images(v) for v in plan.vehicles))

    def devices(self, plan: Plan, events: Events, inputs: Mapping[str, str]) -> Devices:
        """Open the devices of `plan`. inputs: the recorded table of each input."""
        session = _TapeSession(plan, self._scene(plan), self.end, self._after_tick)
        devices = Devices([session], {}, {}, {}, {})
        for vehicle in plan.vehicles:
            name = vehicle.name
            session.links[name] = self._link(vehicle, events)
            kinds = _of_sensors(vehicle)
            devices.sensors[name] = []
            for sensor in vehicle.sensors:
                provided = sensor.part.cls.provides & kinds
                kinds -= provided
                devices.sensors[name].append(OpenSensor(sensor, self._stream(name, provided)))
        for name in plan.tracked:
            devices.watching[name] = self._stream(name, {Pose})
        for own_input in plan.inputs:
            devices.inputs[own_input.name] = open_input(own_input, devices, inputs)
        return devices

    def _link(self, vehicle: VehiclePlan, events: Events) -> _TapeLink:
        name, replaced = vehicle.name, _of_sensors(vehicle)
        answers: dict[str, list[tuple[Time, Any]]] = {}
        messages = self._log[f"/{name}/link"]
        for time, answer in zip(self._turn.times(messages), messages.json(), strict=True):
            for of, value in answer.items():
                answers.setdefault(of, []).append((time, value))
        return _TapeLink(
            name,
            self._turn,
            self._measured(name, (vehicle.driver.cls.provides | UNASKED) - replaced),
            next(iter(replaced), None),
            {of: Queue(self._turn, values) for of, values in answers.items()},
            Latest(self._queue(f"/{name}/tick", _truths), None),
            Latest(self._queue(f"/{name}/true_payload", _places), None),
            self._emitted(name, events),
            simulated=self._log.mission["simulated"],
        )

    def _stream(self, name: str, kinds: Iterable[MeasurementKind]) -> _TapeStream:
        return _TapeStream(self._turn, self._measured(name, kinds))

    def _queue(self, topic: str, decode: Callable[[Messages], Iterator[T]]) -> Queue[T]:
        messages = self._log[topic]
        return Queue(self._turn, zip(self._turn.times(messages), decode(messages), strict=True))

    def _measured(self, name: str, kinds: Iterable[MeasurementKind]) -> Queue[Measurement]:
        found: list[tuple[int, Time, Measurement]] = []
        for kind in kinds:
            layout = layout_of(kind)
            if not layout.has_topics:  # as images have, one for each camera
                messages = self._log[f"/{name}/{kind_name(kind)}"]
                times, values = self._turn.times(messages), layout.unpacked(messages.content)
                found += zip(messages.places.tolist(), times, values, strict=True)
        found.sort(key=itemgetter(0))
        return Queue(self._turn, ((time, measured) for _, time, measured in found))

    def _emitted(self, name: str, events: Events) -> Callable[[Time], None]:
        """Return the function that emits what the vehicle's devices can't cause again."""
        recorded = Queue(self._turn, ((e.time, e) for e in self._outside.get(name, ())))

        def emit(now: Time) -> None:
            for event in recorded.take(now):
                events.emit(ENGINE_EVENTS[event.name](**event.fields), event.vehicle, event.at)

        return emit

    def _without_images(self, vehicle: VehiclePlan) -> VehiclePlan:
        estimators = (self._from_record(vehicle.name, one) for one in vehicle.estimators)
        return vehicle.but(estimators=tuple(estimators))

    def _from_record(self, vehicle: str, estimator: EstimatorPlan) -> EstimatorPlan:
        part = estimator.part
        uses = part.cls.uses(part.params)
        if Frame not in uses:
            return estimator
        topic = f"/{vehicle}/located/{part.alias}"
        estimates = self._queue(topic, lambda located: _estimates(located, part.name))
        params = _RecordedEstimates(estimates, uses - {Frame})
        return estimator.but(part=part.but(cls=_TapeEstimator, params=params))

    def _scene(self, plan: Plan) -> _TapeScene | None:
        states = {name: self._queue(f"/{name}/true", _states) for name in plan.objects}
        if not any(states.values()):
            return None
        contacts = self._queue(CONTACTS_TOPIC, Messages.json)
        return _TapeScene(
            {name: Latest(queue, None) for name, queue in states.items()}, Latest(contacts, {})
        )


def _of_sensors(vehicle: VehiclePlan) -> set[MeasurementKind]:
    return {kind for sensor in vehicle.sensors for kind in sensor.part.cls.provides}


def _tuples(row: Any) -> list[Any]:
    """Return the fields of a message as numbers and tuples of numbers."""
    return [tuple(one.tolist()) if isinstance(one, np.ndarray) else one.item() for one in row]


def _truths(messages: Messages) -> Iterator[Truth | None]:
    for row in messages.decoded(TICK).values["truth"]:
        present, *known = _tuples(row)
        yield Truth(*known) if present else None


def _places(messages: Messages) -> Iterator[Vec3 | None]:
    for row in messages.decoded(VECTOR).values.tolist():
        x, y, z = row
        yield x, y, z


def _estimates(messages: Messages, source: str) -> Iterator[Estimate | None]:
    rows = messages.decoded(TICK["estimate"]).values
    for time, row in zip(messages.times.tolist(), rows, strict=True):
        present, p, v, q, w, age, spread = _tuples(row)
        yield Estimate(time, p, v, q, w, source, age, spread) if present else None


def _states(messages: Messages) -> Iterator[ObjectState | None]:
    kind: Any = ObjectState
    return layout_of(kind).unpacked(messages.content)


class _TapeClock(Clock):
    """Steps through the ticks of the record: those that were missed then are missed again."""

    def __init__(self, rate: int, ticks: Sequence[Time]) -> None:
        super().__init__(rate)
        self._ticks = deque(ticks)
        self._begins = ticks[0] if ticks else None

    def step(self) -> Time:
        self.now += self.period
        while self._ticks and self._ticks[0] < self.now:
            self._ticks.popleft()
        if self._begins is not None and self.now > self._begins and self._ticks:
            self.missed += (self._ticks[0] - self.now) // self.period
            self.now = self._ticks[0]
        return self.now


@dataclass(frozen=True)
class _RecordedEstimates:
    """The estimates of an estimator, and the kinds of measurement that it used besides images."""

    queue: Queue[Estimate | None]
    uses: frozenset[MeasurementKind]


class _TapeEstimator(Estimator[_RecordedEstimates]):
    """Returns the estimates of the record."""

    needs = frozenset()

    def __init__(self, params: _RecordedEstimates, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._estimate = Latest(params.queue, None)

    @classmethod
    def uses(cls, params: _RecordedEstimates) -> frozenset[MeasurementKind]:
        return params.uses

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        return self._estimate.at(now)


class _TapeStream(Stream):
    def __init__(self, turn: _Turn, measured: Queue[Measurement]) -> None:
        self._turn, self._measured = turn, measured

    def read(self, now: Time) -> Sequence[Measurement]:
        self._turn.begin(now, self)
        return self._measured.take(now)

    def close(self) -> None:
        """There is nothing to release."""


class _TapeScene:
    """The objects of the recorded simulator. now: the time of the tick."""

    def __init__(
        self,
        states: Mapping[str, Latest[ObjectState | None]],
        contacts: Latest[Mapping[str, float]],
    ) -> None:
        self.now: Time = 0
        self._states, self._contacts = states, contacts
        self._faults = {name: ActiveFaults(name) for name in states}

    def states(self) -> Mapping[str, ObjectState]:
        found = {name: state.at(self.now) for name, state in self._states.items()}
        return {name: state for name, state in found.items() if state is not None}

    def contacts(self) -> Mapping[Contact, float]:
        felt = self._contacts.at(self.now)
        return {Contact(*name.split("|")): force for name, force in felt.items()}

    def faults(self) -> Mapping[str, ActiveFaults]:
        return self._faults


class _TapeSession(Session):
    def __init__(
        self, plan: Plan, scene: _TapeScene | None, end: Time, watch: Callable[[Time], None]
    ) -> None:
        self.links: dict[str, Link] = {}
        self.scene = scene
        self._scene, self._end, self._watch = scene, end, watch
        self._period = NS // plan.control_rate

    def advance(self, now: Time) -> None:
        for link in self.links.values():
            assert isinstance(link, _TapeLink)
            link.touch()
        if self._scene is not None:
            self._scene.now = now
        self._watch(now)
        if now > self._end + self._period:
            raise TapeEnded("the record ends here")

    def close(self) -> None:
        """There is nothing to release."""


class _TapeLink(Link):
    """The link of a recorded vehicle. It offers the protocols that the vehicle's link offered.

    measured: what the link delivered. replaced: a kind that a sensor replaces, None without any.
    emit: emits the recorded events that nothing else causes.
    """

    def __init__(
        self,
        name: str,
        turn: _Turn,
        measured: Queue[Measurement],
        replaced: MeasurementKind | None,
        answers: Mapping[str, Queue[Any]],
        truths: Latest[Truth | None],
        payloads: Latest[Vec3 | None],
        emit: Callable[[Time], None],
        *,
        simulated: bool,
    ) -> None:
        self.faults = ActiveFaults(name) if simulated else None
        self._now: Time = 0
        self._turn, self._measured, self._replaced = turn, measured, replaced
        self._answers, self._emit = answers, emit
        self._truths, self._payloads = truths, payloads
        self._last: dict[str, Any] = {}
        self._failing: dict[str, str] = {}
        self._touched: Callable[[Touch], None] = lambda _: None
        for protocol in OFFERED:
            if protocol.__name__ in self._latest("offers", ()):
                [method] = (one for one in vars(protocol) if not one.startswith("_"))
                self._offer(method)

    def _offer(self, method: str) -> None:
        known: dict[str, Callable[..., Any]] = {
            "checks": self._checks,
            "status_texts": lambda: self._said(method),
            "foreign_commands": lambda: self._said(method),
            "report_touches": self._report_touches,
        }
        setattr(self, method, known.get(method, lambda *_: self._answered(method)))

    def read(self, now: Time) -> Sequence[Measurement]:
        self._turn.begin(now, self)
        self._now = now
        self._emit(now)
        self._update("state")
        self._failing = dict(self._moments("failed"))
        self._fail_in("read")
        measured = [*map(self._warned, self._measured.take(now))]
        kind: Any = self._replaced
        if self._moments("ignored") and kind is not None:  # an empty one, which is ignored again
            measured.append(kind(now, *(None,) * (len(kind._fields) - 1)))
        return measured

    def truth(self) -> Truth | None:
        truth = self._truths.at(self._now)
        return None if truth is None else truth._replace(payload=self._payloads.at(self._now))

    def send(self, command: Command, now: Time) -> None:
        self._fail_in("send")

    def touch(self) -> None:
        """Report the contacts that the simulator reported after the last tick."""
        for touch in self._moments("touch"):
            self._touched(Touch(*touch))

    def _report_touches(self, tell: Callable[[Touch], None]) -> None:
        self._touched = tell

    def _warned(self, measured: Measurement) -> Measurement:
        if not isinstance(measured, Battery):
            return measured
        warning = self._latest("battery_warning", None)
        return measured._replace(warning=BatteryWarning(*warning) if warning else None)

    def _checks(self, now: Time) -> Sequence[Check]:
        self._fail_in("checks")
        return [Check(*check) for check in self._latest("checks", ())]

    def _said(self, method: str) -> list[Any]:
        self._fail_in(method)
        return [text for texts in self._moments(method) for text in texts]

    def _answered(self, method: str) -> Any:
        """Return what the link answered to `method`, or raise Refused as it did."""
        self._fail_in(method)
        answer = self._latest(method, None)
        self._update("state_after")
        if isinstance(answer, dict):
            raise Refused(answer["refused"])
        return answer

    def _update(self, of: str) -> None:
        said = self._moments(of)
        if said:
            armed, override, self.is_heard, self.delay, self.rejection = said[-1]
            self.armed, self.override = armed, Override(*override) if override else None

    def _moments(self, of: str) -> list[Any]:
        queue = self._answers.get(of)
        return queue.take(self._now) if queue else []

    def _latest(self, of: str, first: Any) -> Any:
        for value in self._moments(of):
            self._last[of] = value
        return self._last.get(of, first)

    def _fail_in(self, method: str) -> None:
        if method in self._failing:
            raise DriverError(self._failing[method].removeprefix("DriverError: "))
