"""Fly in a straight line to a position and stop there.

It is done when the vehicle has been within `tolerance` of the goal for `dwell`, and within
`heading_tolerance` of its heading if that is given. The setpoint follows a rest-to-rest profile
with at most `speed` and `acceleration`; over a short distance the peak speed is lower,
V = sqrt(distance * acceleration / (15/8)), so the setpoint stops at the goal for any distance
(`kybflow.flight.motion`; TeleKyb's SmoothLinearFlyTo had a negative cruise time there). The
planned speed is at most 95 % of the airframe's limit, because tracking needs the rest. A velocity
at entry is reduced to zero on the way. The vehicle turns to a `heading` in the shorter direction.

Fails if it is not done `patience` after the planned end. World frame, metres; heading from east.
"""

from __future__ import annotations

from kybflow.core.geometry import distance
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import (
    Acceleration,
    Angle,
    AngularRate,
    Duration,
    Length,
    Position,
    Speed,
    Vec3,
)
from kybflow.flight.motion import Coast, Dwell, Pace, Profile, Straight, Turn
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params


@params
class FlyToParams:
    position: Position = param("Where to fly, world frame.", read_only=True)
    speed: Speed = param("Largest speed.", default=1.0, above=0.0, read_only=True)
    acceleration: Acceleration = param(
        "Largest acceleration and deceleration.", default=0.7, above=0.0, read_only=True
    )
    heading: Angle | None = param(
        "Heading at the goal; by default the heading is kept.", default=None, read_only=True
    )
    turn_rate: AngularRate = param(
        "Largest rate of turning to the heading.",
        default=1.0, above=0.0, read_only=True, only_with="heading",
    )  # fmt: skip
    tolerance: Length = param(
        "Distance from the goal that counts as arrived.", default=0.02, above=0.0, room="across"
    )
    heading_tolerance: Angle | None = param(
        "Heading error that counts as arrived; by default any heading does.",
        default=None, above=0.0,
    )  # fmt: skip
    dwell: Duration = param(
        "Time that the vehicle must stay there.", default=0.3, at_least=0.0, limited_by="patience"
    )
    patience: Duration = param(
        "Time past the planned end after which the behavior fails.", default=10.0, above=0.0
    )


class FlyTo(Behavior[FlyToParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    keeps_pace = True

    def __init__(self, params: FlyToParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._coast = Coast.after(entry.motion)
        speed = entry.cruise_speed(params.speed)
        self._way = Straight(self._coast.end, params.position, speed, params.acceleration)
        self._turn = Turn(entry.heading, params.heading, params.turn_rate)
        self.pace = self._way.pace
        self._end = max(self._coast.duration, self._way.duration, self._turn.duration)
        self._there = Dwell()

    def keep(self, pace: Pace) -> None:
        self._way.keep(pace)
        self._end = max(self._end, pace.duration)

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        time = tick.elapsed
        motion = self._way.at(time)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        setpoint = motion.setpoint(*self._turn.at(time))
        if time < self._end:
            return setpoint
        gap = distance(tick.known().position, self.params.position)
        off = self._turn.off(tick.known(), self.params.heading_tolerance)
        there = gap <= self.params.tolerance and not off
        if self._there.reached(there, self.params.dwell, tick.dt):
            return Done(setpoint)
        if time > self._end + self.params.patience:
            return Failed(setpoint, f"still {gap:.3f} m from the goal{off}")
        return setpoint

    @classmethod
    def footprint(cls, params: FlyToParams, entry: Vec3 | None) -> Footprint | None:
        goals = ((params.position, params.tolerance),)
        if entry is None:
            points: tuple[Vec3, ...] = (params.position,)
            return Footprint(
                points, params.speed, params.position, duration=params.dwell, goals=goals
            )
        gap = distance(entry, params.position)
        way = Profile.within(gap, params.speed, params.acceleration)
        duration = way.duration + params.dwell
        points = (entry, params.position)
        return Footprint(points, params.speed, params.position, duration=duration, goals=goals)
