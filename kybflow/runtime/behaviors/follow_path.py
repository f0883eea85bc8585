"""Fly along straight legs from corner to corner, stopping at each; done at the last.

Each leg is a rest-to-rest profile with at most `speed` and `acceleration`
(`kybflow.flight.motion`). The next leg begins when the vehicle has been within `tolerance` of
the corner for `dwell`, and within `heading_tolerance` of its heading if that is given; it begins at
the corner itself, so the trajectory has no step. The vehicle turns to a `heading` on the first leg,
in the shorter direction.

Refuses an empty path. Fails if a corner is not reached `patience` after the planned end of its leg.
World frame, metres.
"""

from __future__ import annotations

from itertools import pairwise

from kybflow.core.errors import Refused
from kybflow.core.geometry import distance
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Angle, AngularRate, Duration, Length, Path, Speed, Vec3
from kybflow.flight.motion import Coast, Dwell, Profile, Straight, Turn
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params


@params
class FollowPathParams:
    path: Path = param("The corners, in the order in which they are flown.", read_only=True)
    speed: Speed = param("Largest speed along a leg.", default=1.0, above=0.0)
    acceleration: Acceleration = param(
        "Largest acceleration and deceleration.", default=0.7, above=0.0
    )
    tolerance: Length = param(
        "Distance from a corner that counts as arrived.", default=0.05, above=0.0, room="across"
    )
    heading: Angle | None = param(
        "Heading on the path; by default the heading is kept.", default=None, read_only=True
    )
    turn_rate: AngularRate = param(
        "Largest rate of turning to the heading.",
        default=1.0, above=0.0, read_only=True, only_with="heading",
    )  # fmt: skip
    heading_tolerance: Angle | None = param(
        "Heading error that counts as arrived at a corner; by default any heading does.",
        default=None, above=0.0,
    )  # fmt: skip
    dwell: Duration = param(
        "Time that the vehicle must stay there.", default=0.1, at_least=0.0, limited_by="patience"
    )
    patience: Duration = param(
        "Time past the planned end of a leg after which the behavior fails.",
        default=10.0,
        above=0.0,
    )


class FollowPath(Behavior[FollowPathParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: FollowPathParams, entry: Entry) -> None:
        super().__init__(params, entry)
        if not params.path:
            raise Refused("the path has no corner")
        self._entry = entry
        self._turn = Turn(entry.heading, params.heading, params.turn_rate)
        self._coast = Coast.after(entry.motion)
        self._corner = 0
        self._begin_leg(self._coast.end, 0.0)

    def _begin_leg(self, start: Vec3, now: float) -> None:
        speed = self._entry.cruise_speed(self.params.speed)
        goal = self.params.path[self._corner]
        self._leg = Straight(start, goal, speed, self.params.acceleration)
        self._begun = now
        waits = max(self._coast.duration, self._turn.duration)
        self._end = max(now + self._leg.duration, waits)
        self._there = Dwell()

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        time = tick.elapsed
        motion = self._leg.at(time - self._begun)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        setpoint = motion.setpoint(*self._turn.at(time))
        if time < self._end:
            return setpoint
        corner = self.params.path[self._corner]
        gap = distance(tick.known().position, corner)
        off = self._turn.off(tick.known(), self.params.heading_tolerance)
        there = gap <= self.params.tolerance and not off
        if self._there.reached(there, self.params.dwell, tick.dt):
            if self._corner + 1 == len(self.params.path):
                return Done(setpoint)
            self._corner += 1
            self._begin_leg(corner, time)
        elif time > self._end + self.params.patience:
            return Failed(setpoint, f"still {gap:.3f} m from corner {self._corner + 1}{off}")
        return setpoint

    @classmethod
    def footprint(cls, params: FollowPathParams, entry: Vec3 | None) -> Footprint | None:
        if not params.path:
            return None
        points = params.path if entry is None else (entry, *params.path)
        gaps = [distance(a, b) for a, b in pairwise(points)]
        legs = [Profile.within(gap, params.speed, params.acceleration).duration for gap in gaps]
        duration = sum(legs) + params.dwell * len(params.path)
        goals = tuple((corner, params.tolerance) for corner in params.path)
        return Footprint(
            points, params.speed, params.path[-1], path=points, duration=duration, goals=goals
        )
