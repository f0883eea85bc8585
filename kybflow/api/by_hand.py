"""Checks motion capture by hand: a person moves a vehicle as asked, and the poses are judged by its
IMU and by what was asked. No vehicle arms, and none is sent a command.

A simulated vehicle is moved by a simulated hand, so that the check can be rehearsed; the mission's
faults act as in a flight.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from math import degrees
from types import MappingProxyType
from typing import NamedTuple

from kybflow.api.opening import assemble, clock_for, open_devices, pace_of
from kybflow.core.errors import DriverError, KybflowError
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Imu, Measurement, Pose, Time
from kybflow.core.units import DEG
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.flight.hand_check.motions import (
    LEAST_DIP,
    LEAST_WAY,
    HandMotion,
    HandStep,
    HandWatch,
)
from kybflow.flight.hand_check.verdict import ASKED_WAY, DeclaredStream, judge, named_way
from kybflow.parts.link import Carriable
from kybflow.runtime.events import Events, VehicleObserver
from kybflow.runtime.preflight import PreflightResult
from kybflow.runtime.scores import Score

STEP_TIMEOUT_S = 60.0
"""Seconds that each step may take."""
SILENCE_S = 2.0
"""Seconds without a pose after which poses are said to be missing."""
_MOVES: MappingProxyType[HandStep, tuple[Vec3, Vec3]] = MappingProxyType(
    {
        HandStep.LIFT: ((0.0, 0.0, ASKED_WAY), ZERO),
        HandStep.ALONG_X: ((ASKED_WAY, 0.0, 0.0), ZERO),
        HandStep.ALONG_Y: ((0.0, ASKED_WAY, 0.0), ZERO),
        HandStep.DIP: (ZERO, (0.0, 30.0 * DEG, 0.0)),
    }
)
"""The displacement (m, world) and the rotation vector (rad, body) of each step."""


class HandCheckResult(NamedTuple):
    """The result of a check by hand. lines: the verdict, empty without any pose. stopped: why the
    check ended before its last step, None if it did not."""

    lines: list[PreflightResult]
    stopped: str | None


class Tell(NamedTuple):
    """What the check tells the person. ask: is called when a step begins. done: is called with what
    a step has shown; None after the rest. warn: is called when poses stop arriving. simulated: is
    called if a simulated hand moves the vehicle."""

    ask: Callable[[HandStep], None]
    done: Callable[[HandMotion | None], None]
    warn: Callable[[str], None]
    simulated: Callable[[], None]


def objection(own: VehiclePlan) -> str | None:
    """Return why a vehicle can't be checked by hand; None if it can."""
    parts = [estimator.part for estimator in own.estimators]
    if any(Pose in part.cls.uses(part.params) for part in parts):
        return None
    names = ", ".join(f"`{part.name}`" for part in parts)
    return f"`{own.name}` has no motion capture to check: it is estimated by {names}"


def check_by_hand(
    plan: Plan, name: str, tell: Tell, seed: int = 0, timeout: float = STEP_TIMEOUT_S
) -> HandCheckResult:
    """Check the motion capture of the vehicle `name` by hand. timeout: seconds for each step.

    Raises DriverError if a device can't be opened or the vehicle's link fails, PartFailed if a part
    can't be made, KybflowError if a simulated vehicle can't be moved."""
    own = plan.fleet[name]
    plan = plan.but(
        flows=(), callbacks=(), inputs=(), moving={}, watching={}, expectations=()
    )  # opens no device that the check doesn't need
    devices = open_devices(plan, seed)
    try:
        link = next(s.links[name] for s in devices.sessions if name in s.links)
        hand = None
        if own.driver.cls.simulated:
            if not isinstance(link, Carriable):
                raise KybflowError(f"no hand can move `{name}` on `{own.driver.name}`")
            hand = link
            tell.simulated()
        clock, watch = clock_for(plan, pace_of(plan, None)), HandWatch()
        observers = {name: _Passing(watch)}
        engine = assemble(
            plan, devices, Events(), clock, Score(plan), seed=seed,
            vehicle_observer=lambda of: observers.get(of) or VehicleObserver(),
        )  # fmt: skip
        vehicle = devices.vehicles[name]
        vehicle.knowledge.link_in.subscribe(frozenset({Imu}))
        generator, sensing = random.Random(f"{seed} hand"), vehicle.knowledge.sensing
        session = _Session(watch, tell, hand, generator, lambda: sensing.trouble(Pose), timeout)

        def is_over() -> bool:
            if vehicle.link_error is not None:
                raise DriverError(vehicle.link_error)
            return session.is_over(clock.now, vehicle.link_out.armed)

        engine.watch(is_over)
    finally:
        devices.close()
    return HandCheckResult(_lines(own, watch), session.stopped)


class _Passing(VehicleObserver):
    """Passes the poses and the IMU samples of a vehicle on."""

    def __init__(self, watch: HandWatch) -> None:
        self._watch = watch

    def measurement(self, now: Time, measurement: Measurement) -> None:
        if isinstance(measurement, Imu):
            self._watch.add_imu(measurement)
        elif isinstance(measurement, Pose):
            self._watch.add_pose(measurement)


class _Session:
    """Leads a person, or a simulated hand, through the steps. trouble: returns why no poses arrive,
    if that is known. stopped: why it ended early."""

    def __init__(
        self,
        watch: HandWatch,
        tell: Tell,
        hand: Carriable | None,
        generator: random.Random,
        trouble: Callable[[], str | None],
        timeout: float,
    ) -> None:
        self.stopped: str | None = None
        self._watch, self._tell, self._hand = watch, tell, hand
        self._generator, self._trouble, self._timeout = generator, trouble, timeout
        self._asked: HandStep | None = None
        self._since: Time = 0
        self._is_silent = False

    def is_over(self, now: Time, armed: bool | None) -> bool:
        """Return whether all steps are done or the check was stopped; ask for a step that begins.
        armed: whether the vehicle reports that it is armed."""
        if armed:
            self.stopped = "the vehicle is armed: put it down and disarm it"
            return True
        step = self._watch.step
        if step is self._asked:
            silence = self._silence(now)
            if silence is not None and not self._is_silent:
                self._tell.warn(silence)
            self._is_silent = silence is not None
            if now - self._since > self._timeout * NS:
                self.stopped = silence or self._why_not()
            return self.stopped is not None
        if self._asked is not None:
            self._tell.done(self._watch.motions[-1] if self._watch.motions else None)
        self._asked, self._since = step, now
        if step is None:
            return True
        self._tell.ask(step)
        if self._hand is not None and step in _MOVES:
            self._hand.carry(*_MOVES[step], self._generator)
        return False

    def _silence(self, now: Time) -> str | None:
        """Return why no poses arrive; None if they do."""
        age = self._watch.age(now)
        if (now / NS if age is None else age) <= SILENCE_S:
            return None
        trouble = self._trouble()
        return f"no pose arrives: {trouble}" if trouble else "no pose arrives"

    def _why_not(self) -> str:
        """Return why the present step was not done in time."""
        watch, within = self._watch, f"within {self._timeout:.0f} s"
        if watch.step is HandStep.REST:
            return f"it did not rest {within}"
        if watch.step is HandStep.DIP:
            return f"it was not dipped by {degrees(LEAST_DIP):.0f} deg and held still {within}"
        way = f"{100.0 * LEAST_WAY:.0f} cm"
        return (
            f"it was not moved by {way} or more, within a second or two, and held still"
            f" {within}; the poses show {named_way(watch.moved)}"
        )


def _lines(own: VehiclePlan, watch: HandWatch) -> list[PreflightResult]:
    """Return the verdict; nothing if no pose has arrived."""
    if watch.age(0) is None:
        return []
    sensors = (sensor.part for sensor in own.sensors)
    sensor = next((part for part in sensors if Pose in part.cls.provides), None)
    asking = next(e.part for e in own.estimators if Pose in e.part.cls.uses(e.part.params))
    params = None if sensor is None else sensor.params
    stream = DeclaredStream(getattr(params, "units", None), getattr(params, "axes", None))
    at = (sensor or asking).at
    lines = judge(watch.motions, stream, watch.imu_trouble)
    return [PreflightResult(own.name, *line, at) for line in lines]
