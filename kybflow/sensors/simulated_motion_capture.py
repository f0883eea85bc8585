"""Motion capture of a simulated vehicle: noisy poses at their own rate, with a delay.

It reads the true state from whatever simulates the vehicle, such as a firmware's own simulator. If
that state updates more slowly than poses are due, it is extrapolated up to 100 ms with constant
linear and angular velocity. Beyond that, and while there is no state, there are no poses, unless
the vehicle stands still; missed poses are not made up for. The noise is white, along and about each
axis.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import ceil
from typing import TYPE_CHECKING

from kybflow.core.geometry import LEVEL, ZERO, Vec3, add, integrate, scale, sub
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Command, Measurement, Pose, Time, Truth
from kybflow.core.units import DEG, Angle, Duration, Frequency, Length
from kybflow.parts import ActiveFaults, Link, Sensor, Stream
from kybflow.parts.link import truth_source
from kybflow.world.shapes import MovingSphere
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random

_MAX_EXTRAPOLATION_S = 0.1
"""Longest extrapolation of a vehicle's true state, seconds."""


@params
class SimulatedMotionCaptureParams:
    rate: Frequency = param(
        "Poses a second.", default=100.0, at_least=1.0, at_most=1000.0, read_only=True
    )
    latency: Duration = param(
        "Delay until a pose arrives.", default=0.010, at_least=0.0, at_most=1.0, read_only=True
    )
    position_noise: Length = param(
        "Noise of a pose's position along each axis, standard deviation.",
        default=0.0005, at_least=0.0, read_only=True,
    )  # fmt: skip
    attitude_noise: Angle = param(
        "Noise of a pose's attitude about each axis, standard deviation.",
        default=0.1 * DEG, at_least=0.0, read_only=True,
    )  # fmt: skip


class SimulatedMotionCapture(Sensor[SimulatedMotionCaptureParams]):
    provides = frozenset({Pose})
    simulated = True
    tracks_bodies = True

    @classmethod
    def tracking(
        cls, params: SimulatedMotionCaptureParams, body: str
    ) -> SimulatedMotionCaptureParams:
        return params

    @classmethod
    def open(
        cls,
        params: SimulatedMotionCaptureParams,
        context: VehicleContext,
        link: Link,
        generator: random.Random,
    ) -> SimulatedPoses:
        return SimulatedPoses(params, link, generator)


class SimulatedPoses(Stream):
    """The poses of one vehicle. The faults of its link change poses as they arrive."""

    def __init__(
        self, params: SimulatedMotionCaptureParams, link: Link, generator: random.Random
    ) -> None:
        self._params, self._link, self._generator = params, link, generator
        self._truth = truth_source(link)
        self._latency: Time = round(params.latency * NS)
        self._count: int | None = None
        self._known: tuple[Time, Truth] | None = None
        self._arriving: deque[Pose] = deque()

    def read(self, now: Time) -> Sequence[Measurement]:
        truth = self._truth()
        if truth is None:
            self._count = self._known = None
        else:
            if self._known is None or truth != self._known[1]:
                self._known = (now, truth)
            self._take(now, *self._known)
        arrived: list[Measurement] = []
        while self._arriving and self._arriving[0].time + self._latency <= now:
            arrived.append(self._arriving.popleft())
        faults = self._link.faults
        return arrived if faults is None else faults.filtered(arrived)

    def close(self) -> None:
        self._arriving.clear()

    def _take(self, now: Time, since: Time, body: Truth) -> None:
        """Queue every pose that is due by `now`, extrapolated from the body's state at `since`."""
        params, at_rest = self._params, body.velocity == body.angular_velocity == ZERO
        if self._count is None:
            self._count = ceil(now / NS * params.rate)
        while (at := round(self._count * NS / params.rate)) <= now:
            self._count += 1
            t = (at - since) / NS
            if abs(t) <= _MAX_EXTRAPOLATION_S or at_rest:
                place = add(body.position, scale(body.velocity, t))
                attitude = integrate(body.attitude, body.angular_velocity, t)
                off, turn = self._noise(params.position_noise), self._noise(params.attitude_noise)
                self._arriving.append(Pose(at, add(place, off), integrate(attitude, turn, 1.0)))

    def _noise(self, deviation: float) -> Vec3:
        gauss = self._generator.gauss
        return (gauss(0.0, deviation), gauss(0.0, deviation), gauss(0.0, deviation))


_SEARCH_STEP_S = 1e-3


class BodyStream(Stream):
    """Measurements of a body that is no vehicle by a simulated sensor. truth: returns its true
    state at a time. open: opens the sensor on the body's link. faults: those of the body."""

    def __init__(
        self,
        truth: Callable[[Time], Truth],
        open: Callable[[Link], Stream],
        faults: ActiveFaults | None = None,
    ) -> None:
        self._body = _Body(truth)
        self._body.faults = faults
        self._stream = open(self._body)

    def read(self, now: Time) -> Sequence[Measurement]:
        self._body.now = now
        return self._stream.read(now)

    def close(self) -> None:
        self._stream.close()


class _Body(Link):
    def __init__(self, truth: Callable[[Time], Truth]) -> None:
        self._truth = truth
        self.now: Time = 0

    def read(self, now: Time) -> Sequence[Measurement]:
        return ()

    def send(self, command: Command, now: Time) -> None:
        """It takes no commands."""

    def truth(self) -> Truth | None:
        return self._truth(self.now)


def truth_of(ball: MovingSphere) -> Callable[[Time], Truth]:
    """Return the true state of a moving obstacle as a function of time."""

    def truth(now: Time) -> Truth:
        place = ball.at(now / NS)
        gone = sub(place, ball.at(max(now / NS - _SEARCH_STEP_S, 0.0)))
        return Truth(place, scale(gone, 1.0 / _SEARCH_STEP_S), LEVEL, ZERO)

    return truth
