"""Fly on with a constant velocity until a condition, a distance or a time ends it.

Use it to search for something at an unknown place: "go east until the tag is seen". The condition
is a `next` of the mission; the behavior itself ends smoothly at `at_most` or after `for_time`,
whichever comes first, so that a condition that never comes true ends it too:

    search: {do: run_until, velocity: [0.4, 0, 0], at_most: 2 m, then: not_found,
             next: [{when: distance(a to b) < 80 cm, go: found}]}

TeleKyb has no such behavior; there a person at the joystick stopped the vehicle. It gives velocity
setpoints, because the distance flown until something happens matters, not a schedule: a vehicle
that was held back doesn't chase a setpoint that has moved ahead. The speed rises with the
smoothstep S and falls with its mirror image, with at most `acceleration`
(`kybflow.flight.motion`); if there is no room for the requested speed, it is lower. The vehicle
begins to slow down when the rest of `at_most`, measured by the estimate along the velocity, is the
distance that slowing down takes.

Done when it has come to rest. Fails if it has not begun to slow down `patience` after the planned
time, because something holds it back. If a transition ends it earlier, the next behavior starts
with the current velocity and reduces it. The heading is kept, and so is the height, as far as a
velocity setpoint can. World frame.
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3, add, dot, norm, scale, sub
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Length, Velocity
from kybflow.flight.motion import MAX_SLOPE, Coast, Profile, smoothstep
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params


@params
class RunUntilParams:
    velocity: Velocity = param("Velocity, world frame.", read_only=True)
    at_most: Length = param(
        "Horizontal distance after which the vehicle stops in any case.", above=0.0, read_only=True
    )
    for_time: Duration | None = param(
        "Time after which the vehicle stops in any case.", default=None, above=0.0, read_only=True
    )
    acceleration: Acceleration = param(
        "Largest acceleration and deceleration.", default=0.7, above=0.0, read_only=True
    )
    patience: Duration = param(
        "Time past the planned end after which the behavior fails.", default=10.0, above=0.0
    )


class RunUntil(Behavior[RunUntilParams], flight=AIR >> AIR, emits=SetpointKind.VELOCITY):
    def __init__(self, params: RunUntilParams, entry: Entry) -> None:
        super().__init__(params, entry)
        asked = norm(params.velocity)
        reason = self.refusal(params, entry.position)
        if reason is not None:
            raise Refused(reason)
        self._heading = entry.heading
        self._coast = Coast.after(entry.motion)
        self._direction = scale(params.velocity, 1.0 / asked)
        plan = Profile.within(params.at_most, entry.cruise_speed(asked), params.acceleration)
        self._speed = plan.speed
        if params.for_time is not None:
            self._speed = min(self._speed, 0.5 * params.for_time * params.acceleration / MAX_SLOPE)
        self._ramp = MAX_SLOPE * self._speed / params.acceleration
        self._end = self._ramp + params.at_most / self._speed
        self._slowing: float | None = None
        self._peak = self._speed

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        time, position = tick.elapsed, tick.known().position
        gone = dot(sub(position, self._coast.end), self._direction)  # beyond the coasting
        if self._slowing is None and self._must_slow(time, gone):
            self._slowing, (self._peak, *_) = time, self._rising(time)
        speed, pull, jolt = self._rising(time) if self._slowing is None else self._falling(time)
        _, (vx, vy, vz), (ax, ay, az), (jx, jy, jz) = self._coast.at(time)
        x, y, z = self._direction
        setpoint = Setpoint(
            SetpointKind.VELOCITY,
            None,
            (vx + x * speed, vy + y * speed, vz + z * speed),
            (ax + x * pull, ay + y * pull, az + z * pull),
            (jx + x * jolt, jy + y * jolt, jz + z * jolt),
            self._heading,
        )
        if self._slowing is not None:
            rests = time >= max(self._slowing + self._slowing_time, self._coast.duration)
            return Done(setpoint) if rests else setpoint
        if time > self._end + self.params.patience:
            return Failed(setpoint, f"only {gone:.2f} m of {self.params.at_most:g} m")
        return setpoint

    @property
    def _slowing_time(self) -> float:
        return MAX_SLOPE * self._peak / self.params.acceleration

    def _must_slow(self, time: float, gone: float) -> bool:
        speed, *_ = self._rising(time)
        takes = MAX_SLOPE * speed / self.params.acceleration
        if gone >= self.params.at_most - 0.5 * speed * takes:
            return True
        over = self.params.for_time
        return over is not None and time >= over - takes

    def _rising(self, time: float) -> tuple[float, float, float]:
        """Return speed, acceleration and jerk along the direction of flight before the vehicle
        begins to slow down."""
        if time >= self._ramp:
            return self._speed, 0.0, 0.0
        _, value, slope, bend = smoothstep(time / self._ramp)
        rate = self._speed / self._ramp
        return self._speed * value, rate * slope, rate / self._ramp * bend

    def _falling(self, time: float) -> tuple[float, float, float]:
        span = self._slowing_time
        left = 0.0 if self._slowing is None else self._slowing + span - time
        if left <= 0.0 or span <= 0.0:
            return 0.0, 0.0, 0.0
        _, value, slope, bend = smoothstep(min(left / span, 1.0))
        rate = self._peak / span
        return self._peak * value, -rate * slope, rate / span * bend

    @classmethod
    def footprint(cls, params: RunUntilParams, entry: Vec3 | None) -> Footprint | None:
        speed = norm(params.velocity)
        if entry is None or speed == 0.0:
            return None
        end = add(entry, scale(params.velocity, params.at_most / speed))
        return Footprint((entry, end), speed, end if params.for_time is None else None)

    @classmethod
    def refusal(cls, params: RunUntilParams, entry: Vec3) -> str | None:
        return None if norm(params.velocity) > 0.0 else "its velocity is zero"
