"""Fly home: up to a safe height, then level and straight to the point above home.

Home is the vehicle's `home` in the mission, or its start if the mission gives none. The height is
the present one, or `height` above the ground of the start if that is more, but always 0.3 m below
the fence's top. Both legs are rest-to-rest profiles (`kybflow.flight.motion`); a velocity at
entry is reduced to zero on the way. It is done when the vehicle is within `tolerance` of the point
above home, and `patience` after the planned end in any case: the next behavior lands the vehicle
wherever it is.

Refuses to start if an obstacle is closer to the level leg than the vehicle's diameter plus 20 cm;
the vehicle then lands where it is. World frame, metres; the heading is kept.
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Length, Speed
from kybflow.flight.motion import Coast, Straight
from kybflow.parts import AIR, MOVING, Behavior, Entry, Footprint, param, params

_UNDER_TOP = 0.3
_CLEARANCE = 0.2
_STEP = 0.05


@params
class GoHomeParams:
    height: Length = param(
        "Smallest height of the flight above the ground of the start.",
        default=1.0, above=0.0, read_only=True, room="up",
    )  # fmt: skip
    speed: Speed = param("Largest speed.", default=0.5, above=0.0, read_only=True)
    acceleration: Acceleration = param(
        "Largest acceleration and deceleration.", default=0.7, above=0.0, read_only=True
    )
    tolerance: Length = param(
        "Distance from the goal that counts as arrived.", default=0.1, above=0.0, room="across"
    )
    patience: Duration = param(
        "Time past the planned end at which the behavior is done in any case.",
        default=5.0,
        at_least=0.0,
    )


class GoHome(
    Behavior[GoHomeParams], flight=(AIR >> AIR, MOVING >> AIR), emits=SetpointKind.POSITION
):
    def __init__(self, params: GoHomeParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._heading = entry.heading
        self._coast = Coast.after(entry.motion)
        stop = self._coast.end
        height, fence = max(stop[2], entry.context.start[2] + params.height), entry.context.fence
        if fence is not None:
            height = max(min(height, fence.high[2] - _UNDER_TOP), min(stop[2], height))
        above = (*stop[:2], height)
        x, y, _ = entry.context.home or entry.context.start
        self._goal: Vec3 = (x, y, height)
        speed = entry.cruise_speed(params.speed)
        self._up = Straight(stop, above, speed, params.acceleration)
        self._over = Straight(above, self._goal, speed, params.acceleration)
        self._turns = max(self._coast.duration, self._up.duration)
        self._end = self._turns + self._over.duration
        _check_clear(entry, above, self._goal)

    def update(self, tick: Tick) -> Setpoint | Done:
        time = tick.elapsed
        motion = self._up.at(time) if time < self._turns else self._over.at(time - self._turns)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        setpoint = motion.setpoint(self._heading)
        if time < self._end:
            return setpoint
        there = distance(tick.known().position, self._goal) <= self.params.tolerance
        return Done(setpoint) if there or time > self._end + self.params.patience else setpoint

    @classmethod
    def footprint(cls, params: GoHomeParams, entry: Vec3 | None) -> Footprint | None:
        return None


def _check_clear(entry: Entry, above: Vec3, goal: Vec3) -> None:
    """Raise Refused for the first obstacle that is too close to the level path home."""
    keep = entry.context.airframe.diameter + _CLEARANCE
    steps = max(1, round(distance(above, goal) / _STEP))
    for name, shape in entry.context.obstacles.items():
        for i in range(steps + 1):
            s = i / steps
            x, y, z = (a + s * (b - a) for a, b in zip(above, goal, strict=True))
            if shape.distance((x, y, z)) < keep:
                raise Refused(f"the obstacle `{name}` is in the way home")
