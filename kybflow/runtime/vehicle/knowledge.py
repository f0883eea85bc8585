"""Stores everything that a vehicle knows: measurements of its link and sensors ─► monitors ─►
estimate.

This module only receives; `LinkOut` sends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import (
    NEVER,
    NOBODY,
    NS,
    Battery,
    Estimate,
    Frame,
    Imu,
    InputReadings,
    Measurement,
    MeasurementKind,
    Payload,
    PayloadState,
    Pose,
    SeenObjects,
    SeenObstacles,
    Sticks,
    Tick,
    Time,
    kind_name,
    made,
)
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.frame_check import FrameCheck
from kybflow.parts import GROUND, Entry, Flight
from kybflow.parts.events import PayloadAlreadyReleased, PayloadLoaded, PayloadReleased
from kybflow.runtime.events import Events, VehicleObserver
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.runtime.monitoring.bodies import Bodies, BodyMonitor
from kybflow.runtime.monitoring.cameras import CameraMonitor, EstimateHistory
from kybflow.runtime.monitoring.sensing import OpenSensor, Sensing
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.control import Control
from kybflow.runtime.vehicle.estimation import Estimation
from kybflow.runtime.vehicle.link import LinkIn, LinkOut
from kybflow.world.vehicle_context import VehicleContext


class PayloadTracker:
    """Tracks a vehicle's payload. After a release the servo opens again only once it has closed.

    state: the payload's state according to the vehicle's reports, None while unknown.
    releases: how often the vehicle has released its payload.
    """

    def __init__(self, vehicle: str, events: Events) -> None:
        self.state: PayloadState | None = None
        self.releases = 0
        self._vehicle, self._events = vehicle, events
        self._report: Payload | None = None
        self._requested: Time | None = None

    def wants(self, is_open: bool, now: Time, at: str) -> bool:
        """Return whether the servo must still be requested to open or close; False if it already
        has, or if the payload was released before."""
        if is_open and self.state is PayloadState.RELEASED:
            self._events.emit(PayloadAlreadyReleased(), self._vehicle, at)
            return False
        if not is_open:
            self._requested = None
        elif self._requested is None:
            self._requested = now
        return self._report is None or self._report.is_open is not is_open

    def update(self, report: Payload, estimate: Estimate | None, now: Time) -> None:
        """Process a report on the payload; emit an event if it was released or loaded."""
        self._report = report
        before, self.state = self.state, self._meant(report)
        if self.state is before:
            return
        if self.state is PayloadState.RELEASED:
            took = None if self._requested is None else (now - self._requested) / NS
            self._requested = None
            self.releases += 1
            x, y, z = (None, None, None) if estimate is None else estimate.position
            self._events.emit(PayloadReleased(x=x, y=y, z=z, took=took), self._vehicle)
        elif self.state is PayloadState.ABOARD and before is not None:
            self._events.emit(PayloadLoaded(), self._vehicle)

    def _meant(self, report: Payload) -> PayloadState | None:
        """Return the payload state that a report implies, None if it is unclear. An open servo has
        released a payload that was aboard or whose release was requested, unless the vehicle
        reports the payload as still aboard."""
        if report.is_open and report.aboard:
            return self.state
        if report.is_open:
            had = self.state in (PayloadState.ABOARD, PayloadState.RELEASED)
            released = had or self._requested is not None
            return PayloadState.RELEASED if released else PayloadState.ABSENT
        if report.aboard is None:
            return None
        return PayloadState.ABOARD if report.aboard else PayloadState.ABSENT


REST_TIME_S = 0.1
"""Seconds at rest after which the bias is known to a few cm/s^2."""
MAX_BIAS = 1.5
"""Largest plausible bias, m/s^2; a larger difference from gravity is ignored."""


class RestingBias:
    """Measures the accelerometer's bias along body z while the rotors rest, for a descent without a
    position. The measured bias includes the effect of a sloping floor.

    The measurement restarts whenever the rotors stop. rotors_turn: whether the last command let the
    rotors turn, or the vehicle reports itself armed: an autopilot may lift off while it is being
    armed.
    """

    __slots__ = ("_felt", "_time", "rotors_turn")

    def __init__(self) -> None:
        self.rotors_turn = False
        self._felt = self._time = 0.0

    def turn(self, rotors_turn: bool) -> None:
        """Record that the rotors start or stop turning."""
        if not rotors_turn:
            self._felt = self._time = 0.0
        self.rotors_turn = rotors_turn

    def add(self, imu: Imu) -> None:
        """Add a sample that was measured at rest."""
        self._felt += imu.dt * imu.specific_force[2]
        self._time += imu.dt

    @property
    def is_known(self) -> bool:
        """Whether the vehicle has rested for long enough."""
        return self._time >= REST_TIME_S

    @property
    def specific_force(self) -> float:
        """The specific force along body z at rest, m/s^2; gravity if it is unknown or
        implausible."""
        if not self.is_known:
            return GRAVITY
        lift = self._felt / self._time
        return lift if abs(lift - GRAVITY) <= MAX_BIAS else GRAVITY


_Take = Callable[[Any, Time], None]


class _Stream:
    """The measurements of one kind. began: when the first one arrived. count: how many have
    arrived. take: is called with each of them."""

    __slots__ = ("began", "count", "take")

    def __init__(self, began: Time, take: _Take | None) -> None:
        self.began, self.take = began, take
        self.count = 0


class Knowledge:
    """The estimate and the latest battery, IMU and stick measurements, each None before the first.

    resting: the accelerometer's bias at rest.
    frame: compares the poses with the IMU.
    late: by how much later than usual commands take effect since the rotors began to turn, as a
    supervisor found, s.
    needs: the kinds of measurement that the estimators use.
    now: the time of the last update.
    report: is called with the failure of a part.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        link: LinkIn,
        events: Events,
        observer: VehicleObserver,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
        sensors: Sequence[OpenSensor] = (),
        bodies: Bodies | None = None,
        fleet: EstimateHistory | None = None,
    ) -> None:
        self.now: Time = 0
        self.estimate: Estimate | None = None
        self.battery: Battery | None = None
        self.imu: Imu | None = None
        self.sticks: Sticks | None = None
        self.resting = RestingBias()
        self.frame = FrameCheck()
        self.late = 0.0
        self.payload = PayloadTracker(plan.name, events)
        self.link_in = link
        self.estimation = Estimation(plan, context, events, score, report, self._known)
        self.sensing = Sensing(plan, sensors, events)
        self._name, self._observer, self._score = plan.name, observer, score
        self._faults = link.faults
        self._listen, self._accept = link.listen, self._accepted
        self._fleet = fleet or EstimateHistory()
        self._body = BodyMonitor(plan, bodies or Bodies(), events, lambda: self.estimate)
        self.cameras = CameraMonitor(plan, self._fleet, events)
        self._streams: dict[MeasurementKind, _Stream] = {}
        needs = [e.part.cls.uses(e.part.params) for e in plan.estimators]
        self.needs: frozenset[MeasurementKind] = frozenset().union(*needs)
        tracker = plan.tracker
        kinds = self.needs | tracker.cls.uses(tracker.params)
        self._confirms = False
        if Pose not in self.needs:
            self.frame.due = NEVER
        elif plan.driver.cls.streams_imu:
            self._confirms = Imu not in kinds
        else:
            kinds |= {Imu}
        link.subscribe(kinds)
        self._hides_imu = self._confirms  # estimators must not depend on what stops soon
        if self._confirms:
            link.subscribe_briefly(frozenset({Imu}))

    def update(self, now: Time, airborne: bool, in_land_mode: bool = False) -> Estimate | None:
        """Read the measurements; update and return the estimate. airborne: whether the vehicle
        is off the ground and its rotors turn. in_land_mode: whether it is in its own land mode."""
        self.now = now
        measurements = self._listen(now, self._accept)
        if self.sensing.streams:
            measurements = self.sensing.merged(measurements, now, self._note)
        if measurements or now >= self._body.due:
            measurements = self._body.measured(measurements, now, airborne)
        if now >= self.frame.due:
            self.frame.add_poses(measurements, self.resting.rotors_turn, in_land_mode)
            if self._confirms and self.frame.is_confirmed:
                self._confirms = not self.link_in.subscribe_briefly(frozenset())
        if self._hides_imu:
            measurements = [m for m in measurements if not isinstance(m, Imu)]
        if self.cameras.is_asked:
            measurements = self.cameras.measured(measurements, now, airborne)
        if self._faults is not None and self._faults.estimators:
            self.estimation.kill(self._faults.estimators)
        self.estimate = estimate = self.estimation.update(measurements, now)
        if self.cameras.is_asked:
            self._judge_cameras(now, airborne)
        if self._fleet.is_asked and estimate is not None:
            self._fleet.note(self._name, estimate)
        return estimate

    def _judge_cameras(self, now: Time, airborne: bool) -> None:
        """Judge the poses found in images, and record the estimates that depend on them."""
        self.cameras.judge(self.estimation.candidates, airborne)
        for candidate in self.estimation.candidates:
            if Frame in candidate.uses:
                self._observer.located(now, candidate.name, candidate.estimate)

    def rate(self, kind: MeasurementKind) -> float:
        """Return the average rate (Hz) of measurements of `kind`; zero before the third one."""
        stream, now = self._streams.get(kind), self.link_in.heard
        if stream is None or stream.count < 3 or now is None or now == stream.began:
            return 0.0
        return (stream.count - 1) * NS / (now - stream.began)

    def parts(self) -> dict[str, Any]:
        """Return the estimators that have not failed, by label."""
        return self.estimation.parts()

    def _known(self, kinds: frozenset[MeasurementKind]) -> str:
        """Return a description of the known faults of these kinds of measurement; empty without
        any."""
        found = [self.sensing.trouble(kind) for kind in sorted(kinds, key=kind_name)]
        if Frame in kinds:
            found.append(self.cameras.trouble)
        return "; ".join(dict.fromkeys(words for words in found if words))

    def _accepted(self, measurements: Sequence[Measurement], now: Time) -> Sequence[Measurement]:
        """Record and return those measurements of the link that are plausible and that no sensor
        replaces."""
        measurements = self.sensing.of_link(measurements, now)
        self._note(measurements, now)
        return measurements

    def _note(self, measurements: Sequence[Measurement], now: Time) -> None:
        record, streams = self._observer.measurement, self._streams
        for measurement in measurements:
            record(now, measurement)
            kind = type(measurement)
            stream = streams.get(kind) or self._open_stream(kind, now)
            stream.count += 1
            if stream.take is not None:
                stream.take(measurement, now)

    def _open_stream(self, kind: MeasurementKind, now: Time) -> _Stream:
        """Begin to count the measurements of a kind. Kinds that no `_take_` method handles are used
        only by the estimators."""
        takers: dict[MeasurementKind, _Take] = {
            Imu: self._take_imu,
            Battery: self._take_battery,
            Sticks: self._take_sticks,
            Payload: self._take_payload,
        }
        stream = self._streams[kind] = _Stream(now, takers.get(kind))
        return stream

    def _take_imu(self, imu: Imu, now: Time) -> None:
        self.imu = imu
        self.frame.add_imu(imu)
        if not self.resting.rotors_turn:
            self.resting.add(imu)

    def _take_battery(self, battery: Battery, now: Time) -> None:
        self.battery = battery
        self._score.battery(battery.remaining)

    def _take_sticks(self, sticks: Sticks, now: Time) -> None:
        self.sticks = sticks

    def _take_payload(self, payload: Payload, now: Time) -> None:
        self.payload.update(payload, self.estimate, now)


class TickBuilder:
    """Builds the ticks and entries of one vehicle. fleet: the estimate of each vehicle in the
    newest tick, None for a vehicle without an estimate. share: what the coordinator of the
    vehicle's flow gives it."""

    def __init__(
        self,
        context: VehicleContext,
        knowledge: Knowledge,
        control: Control,
        link_out: LinkOut,
        inputs: InputReadings,
        broadcasts: Broadcasts | None,
        moving: SeenObstacles,
        objects: SeenObjects,
    ) -> None:
        self.fleet: dict[str, Estimate | None] = {}
        self.share: float | None = None
        self._context, self._knowledge, self._control = context, knowledge, control
        self._link_out, self._inputs, self._moving = link_out, inputs, moving
        self._objects = objects
        self._neighbours = broadcasts or NOBODY

    def tick(
        self,
        now: Time,
        dt: float,
        entered: Time,
        fleet: dict[str, Estimate | None],
        touches: str = "",
    ) -> Tick:
        """Return the tick at `now`, `dt` seconds after the last one, of a vehicle whose state was
        entered at `entered`, and whose behavior means to touch the object `touches`."""
        self.fleet = fleet
        knowledge, link = self._knowledge, self._knowledge.link_in
        frame, wrong = knowledge.frame, knowledge.frame.wrong
        return made(
            Tick,
            (
                now, dt, (now - entered) / NS, knowledge.estimate, knowledge.battery,
                self._control.followed, fleet, knowledge.imu, link.age, link.delay,
                knowledge.payload.state, self._inputs, self._neighbours, self._moving,
                wrong,
                frame.motion(now) if wrong is not None and frame.is_current(now) else None,
                link.rejection,
                self._link_out.sent,
                frame.uncompared,
                self._objects,
                self.share,
                touches,
            ),
        )  # fmt: skip

    def standing(self, entered: Time, fleet: dict[str, Estimate | None]) -> Tick:
        """Return a tick of zero duration at the time of the newest measurements. fleet: the
        estimates of all vehicles."""
        now = self._knowledge.now
        return self.tick(now, 0.0, entered, self.fleet)._replace(fleet=fleet)

    def entry(self, flight: Flight) -> Entry:
        """Return the conditions in which a behavior would be entered now. The hover thrust (N) is
        the tracker's estimate in the air, and the airframe's weight on the ground and in a wrong
        frame, in which the tracker has learnt by wrong positions."""
        knowledge, control, context = self._knowledge, self._control, self._context
        frame, late = knowledge.frame, knowledge.late
        trusts = flight is not GROUND and frame.wrong is None
        thrust = control.hover_thrust() if trusts else context.airframe.hover_thrust
        lift = knowledge.resting.specific_force
        return Entry(
            knowledge.now, context, knowledge.estimate, None if late else control.followed, thrust,
            flight, lift, self._inputs, knowledge.estimation.lost,
            None if frame.wrong is None else frame.motion(knowledge.now), knowledge.imu, late,
            control.lean() if trusts else (0.0, 0.0),
        )  # fmt: skip
