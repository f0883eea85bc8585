"""Take off: climb straight up to a height above the ground.

The setpoint rises from the estimate's position at entry along a rest-to-rest profile
(`kybflow.flight.motion`) with at most `speed` and `acceleration`. If the vehicle stays more than
0.3 m behind, the profile waits for it, so that the setpoint doesn't run away from a vehicle that
can't lift; if it is more than 0.1 m ahead, lifted by its autopilot, the profile continues from
there. It is done when the profile has ended and the height has settled: for `dwell` the height must
be within `tolerance` and move by no more than a seventh of that, so that a vehicle that only passes
the height is not done.

Fails if it is not done `patience` after the profile should have ended. Speed 0.3 m/s and
tolerance 10 cm are TeleKyb's. `height` is in metres above the ground of the start.
"""

from __future__ import annotations

from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Length, Speed, Vec3
from kybflow.flight.motion import Dwell, Profile
from kybflow.parts import AIR, GROUND, Behavior, Entry, Footprint, param, params

_HEIGHT_LEASH, _LEAD_HEIGHT = 0.3, 0.1
_SETTLED_SHARE = 0.15
"""The fraction of `tolerance` by which a settled height may move."""
_LEAP_S = 0.02
"""Step (s) by which the profile advances towards the height of a vehicle that is ahead of it."""


@params
class TakeOffParams:
    height: Length = param("Height above the ground of the start.", above=0.0, read_only=True)
    speed: Speed = param("Largest climbing speed.", default=0.3, above=0.0, read_only=True)
    acceleration: Acceleration = param(
        "Largest vertical acceleration.", default=0.5, above=0.0, read_only=True
    )
    tolerance: Length = param(
        "Height error that counts as arrived.", default=0.1, above=0.0, room="up"
    )
    dwell: Duration = param(
        "Time that the vehicle must stay there.", default=0.3, at_least=0.0, limited_by="patience"
    )
    patience: Duration = param(
        "Time past the planned end after which the behavior fails.", default=5.0, above=0.0
    )


class TakeOff(Behavior[TakeOffParams], flight=GROUND >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: TakeOffParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._ground = entry.estimate.position if entry.estimate else entry.context.start
        self._heading = entry.heading
        speed = entry.cruise_speed(min(params.speed, entry.context.airframe.climb))
        self._profile = Profile.within(params.height, speed, params.acceleration)
        self._reach(0.0)
        self._there, self._resting = Dwell(), 0.0

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        p, profile = self.params, self._profile
        climbed = tick.known().position[2] - self._ground[2]
        while self._progress[0] < climbed - _LEAD_HEIGHT and self._time < profile.duration:
            self._reach(self._time + _LEAP_S)
        waits = self._progress[0] - climbed > _HEIGHT_LEASH
        if not waits:
            self._reach(min(self._time + tick.dt, profile.duration))
        height, speed, acceleration, jerk = self._progress
        if waits:
            speed = acceleration = jerk = 0.0
        x, y, z = self._ground
        setpoint = Setpoint(
            SetpointKind.POSITION, (x, y, z + height), (0.0, 0.0, speed), (0.0, 0.0, acceleration),
            (0.0, 0.0, jerk), self._heading,
        )  # fmt: skip
        stays = abs(climbed - self._resting) <= _SETTLED_SHARE * p.tolerance
        if not stays:
            self._resting = climbed
        near = stays and abs(climbed - p.height) <= p.tolerance
        if self._there.reached(near and self._time >= profile.duration, p.dwell, tick.dt):
            return Done(setpoint)
        if tick.elapsed > profile.duration + p.patience:
            return Failed(setpoint, f"climbed {climbed:.2f} m of {p.height:g} m")
        return setpoint

    def _reach(self, time: float) -> None:
        """Advance the setpoint to this time (s) of the profile."""
        self._time, self._progress = time, self._profile.at(time)

    @classmethod
    def footprint(cls, params: TakeOffParams, entry: Vec3 | None) -> Footprint | None:
        profile = Profile.within(params.height, params.speed, params.acceleration)
        duration = profile.duration + params.dwell
        if entry is None:
            return Footprint((), params.speed, None, duration=duration)
        top = (entry[0], entry[1], entry[2] + params.height)
        return Footprint((entry, top), params.speed, top, duration=duration)
