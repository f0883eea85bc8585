"""Land at a point or where the vehicle is: descend, detect the ground and stop the rotors.

With a `position` it first flies level to above that point, with at most `approach`, and begins to
descend when it has been within `tolerance` of the vertical through the point for half a second. The
descent pauses while the vehicle is more than twice `tolerance` off, for `patience` in total at
most; then it descends anyway, because a landing must end on the ground. It fails if the vehicle is
not above the point `patience` after the planned time. The ground is expected at the height of the
point; without a point, at the height of the start.

It descends at `speed`, and at `slow_speed` from the height `slow_below` above the expected ground
on. The speed of the setpoint follows v(z) = min(speed, sqrt(slow_speed^2 + 2 a (z - z_slow))), with
a slope of at most the acceleration a. The setpoint has no lowest height: the ground is where the
vehicle stops although the setpoint continues below it. The ground is detected when the height has
stayed within 1.5 cm of one value for `dwell` with the setpoint at least 5 cm below (after TeleKyb's
ViconFreeLand, which used the vertical speed; the height is less noisy, and the setpoint's depth
guards against gusts). If the estimate is too noisy for that, the height averaged over a second must
stay within 5 cm for four times as long.

The setpoint never runs more than 0.3 m ahead, so that no position error builds up on the ground,
and never stays more than 0.3 m behind, so that a vehicle that is lower already, because of a fence
or a fall, doesn't wait for it. It fails if it comes no lower for `patience`; the landing that
follows then needs no height.

It does not land on another vehicle (`kybflow.flight.landing_place`): the descent pauses while one
is below. Without a `position` it moves to a free place beside that vehicle; with one it waits for
`patience` and then fails. Without a `position` it lands neither on the edge of an obstacle of the
world nor against an object: it moves to a free place beside it. Without a free place it reports
this, waits for `patience` and then descends, because the edge won't go away and a landing must end
on the ground.

If the vehicle is already on the ground, the behavior ends at once. Its last setpoint is IDLE. A
velocity at entry is reduced to zero on the way. World frame, metres; the heading is kept.
"""

from __future__ import annotations

from math import hypot, sqrt

from kybflow.core.geometry import distance
from kybflow.core.signals import Done, Estimate, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Length, Position, Speed, Vec3
from kybflow.flight.landing_place import Below, place_beside, what_is_below
from kybflow.flight.motion import (
    COAST_ACCELERATION,
    IDLE,
    Coast,
    Dwell,
    Profile,
    Straight,
)
from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry, Footprint, param, params

_STILL_HEIGHT = 0.015
_AVERAGING_S, _LEVEL_HEIGHT, _DWELL_FACTOR = 1.0, 0.05, 4.0
"""For a noisy height: the averaging time (s), by how much the average may move (m), and for how
many times `dwell` it must stay within that."""
_PROGRESS_HEIGHT = 0.1
"""Distance (m) by which the average must fall to count as progress."""
_SETPOINT_DEPTH = 0.05
_HEIGHT_LEASH = 0.3
_LOOK_PERIOD_S = 0.1
"""Seconds between two checks for vehicles below, which are costly when a whole fleet lands."""
_ABOVE_TIME_S = 0.5
"""Seconds for which the vehicle must be above the point before it descends."""


_FRESH_S = 0.3
"""Seconds without new measurements after which a constant height doesn't prove that the vehicle is
on the ground."""
_LONGEST_TICK_S = 0.25
"""Seconds since the last tick after which the program hung: the descent goes on from where the
vehicle is, not from where the setpoint would have been, which would pull it down faster."""


@params
class LandParams:
    position: Position | None = param(
        "Position on the ground to land at; by default the vehicle lands where it is.",
        default=None, read_only=True,
    )  # fmt: skip
    approach: Speed = param(
        "Largest speed on the way above the position.", default=0.5, above=0.0, read_only=True
    )
    tolerance: Length = param(
        "Distance from the vertical through the position that counts as above it.",
        default=0.05, above=0.0, room="across",
    )  # fmt: skip
    patience: Duration = param(
        "Time past the planned arrival above the position after which the behavior fails; also "
        "the longest wait in the descent, and the longest time without getting lower.",
        default=10.0, above=0.0,
    )  # fmt: skip
    speed: Speed = param("Descent speed.", default=0.5, above=0.0, at_most=1.0)
    slow_speed: Speed = param("Descent speed near the ground.", default=0.2, above=0.1, at_most=0.5)
    slow_below: Length = param(
        "Height above the expected ground at which the descent slows down.",
        default=0.4,
        at_least=0.0,
    )
    acceleration: Acceleration = param("Largest vertical acceleration.", default=0.7, above=0.0)
    dwell: Duration = param(
        "Time without motion after which the vehicle counts as on the ground.",
        default=0.6,
        above=0.0,
    )


class Land(
    Behavior[LandParams],
    flight=(AIR >> GROUND, MOVING >> GROUND, GROUND >> GROUND),
    emits=SetpointKind.POSITION,
):
    def __init__(self, params: LandParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._grounded, self._context = entry.flight is GROUND, entry.context
        self._point = params.position
        self._ground = (entry.context.start if self._point is None else self._point)[2]
        self._heading = entry.heading
        start, (east, north, climb), *_ = entry.motion
        self._coast = Coast(start, (east, north, 0.0), COAST_ACCELERATION)
        self._height, self._climb = entry.position[2], climb
        self._resting = entry.position[2]
        self._average = self._level = self._lowest = entry.position[2]
        self._stopped, self._settled, self._above = Dwell(), Dwell(), Dwell()
        self._stalled = 0.0
        self._goal: Vec3 | None = self._point
        x, y, _ = self._point or self._coast.end
        goal = (x, y, self._coast.end[2])
        self._speed = entry.cruise_speed(params.approach)
        self._way, self._began = self._to(self._coast.end, goal), 0.0
        self._arrival = max(self._coast.duration, self._way.duration)
        self._descends = self._point is None
        self._waited = self._barred = self._look = 0.0
        self._under: Below | None = None

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        if self._grounded:
            return Done(IDLE)
        p, estimate = self.params, tick.known()
        own, heard = estimate.position, min(tick.link_age, estimate.age) <= _FRESH_S
        if self._descends and heard and self._has_stopped(own[2], tick.dt):
            return Done(IDLE)
        below = self._below(tick, own)
        goal, gap = self._goal, 0.0
        if goal is not None:
            gap = hypot(own[0] - goal[0], own[1] - goal[1])
        if not self._descends and tick.elapsed >= self._arrival:
            self._descends = self._above.reached(gap <= p.tolerance, _ABOVE_TIME_S, tick.dt)
        waits = below is not None or not self._descends
        if self._descends and gap > 2.0 * p.tolerance and self._waited < p.patience:
            self._waited += tick.dt
            waits = True
        pull = self._descend(tick.dt, estimate, waits)
        setpoint = self._setpoint(tick.elapsed, pull)
        self._stalled += 0.0 if waits else tick.dt
        if self._stalled > p.patience:
            return Failed(setpoint, f"no lower for {p.patience:g} s, and no ground reached")
        if self._barred > p.patience and below is not None and not below.is_fixed:
            return Failed(setpoint, f"{self.waits_for} for {p.patience:g} s")
        if not self._descends and tick.elapsed > self._arrival + p.patience:
            if self._point is None:
                self._descends = True
                return setpoint
            return Failed(setpoint, f"still {gap:.2f} m from above the point")
        return setpoint

    def _below(self, tick: Tick, own: Vec3) -> Below | None:
        """Return the vehicle or edge below that prevents the descent, or None. Without a
        `position`, choose a new goal beside it."""
        if tick.elapsed >= self._look:
            self._look = tick.elapsed + _LOOK_PERIOD_S
            below = what_is_below(self._context, own, tick.fleet, tick.objects)
            if below is not None and below.is_fixed:
                tolerated = self._point is not None or self._barred > self.params.patience
                below = None if tolerated else below
            self._under = below
            self.waits_for = None if below is None else f"{below.words} is {below.where}"
        below = self._under
        if below is None or not self._descends or tick.elapsed < self._arrival:
            return below
        if self._point is not None:
            self._barred += tick.dt
            return below
        x, y, _ = self._way.at(tick.elapsed - self._began).position
        here = (x, y, self._height)
        goal = place_beside(self._context, here, tick.fleet, below.away, tick.objects)
        if goal is not None:
            self._goal, self._way, self._began = goal, self._to(here, goal), tick.elapsed
            self._arrival, self._descends = tick.elapsed + self._way.duration, False
        elif below.is_fixed:
            self._barred += tick.dt
            self.waits_for = f"{below.words} is {below.where}, and no place beside it is free"
        return below

    def _to(self, start: Vec3, goal: Vec3) -> Straight:
        return Straight(start, goal, self._speed, self.params.acceleration)

    def _setpoint(self, time: float, pull: float) -> Setpoint:
        level = self._way.at(time - self._began)
        if time < self._coast.duration:
            level = level.plus(self._coast.shift(time))
        (x, y, _), (vx, vy, _), (ax, ay, _), jerk = level
        return Setpoint(
            SetpointKind.POSITION,
            (x, y, self._height),
            (vx, vy, self._climb),
            (ax, ay, pull),
            jerk,
            self._heading,
        )

    def _has_stopped(self, own: float, dt: float) -> bool:
        """Return whether the height, or its average, has stayed where it is for long enough."""
        stays = abs(own - self._resting) <= _STILL_HEIGHT and own - self._height >= _SETPOINT_DEPTH
        if not stays:
            self._resting = own
        stopped = self._stopped.reached(stays, self.params.dwell, dt)
        self._average += (own - self._average) * dt / (_AVERAGING_S + dt)
        if self._average < self._lowest - _PROGRESS_HEIGHT:
            self._lowest, self._stalled = self._average, 0.0
        deep = self._average - self._height >= _SETPOINT_DEPTH
        stays = abs(self._average - self._level) <= _LEVEL_HEIGHT and deep
        if not stays:
            self._level = self._average
        return self._settled.reached(stays, _DWELL_FACTOR * self.params.dwell, dt) or stopped

    def _descend(self, dt: float, estimate: Estimate, waits: bool) -> float:
        """Lower the setpoint by one tick, or slow it to a stop if the descent `waits`. Return its
        vertical acceleration (m/s^2)."""
        p, own = self.params, estimate.position[2]
        if dt > _LONGEST_TICK_S:
            self._height, self._climb, dt = own, min(estimate.velocity[2], 0.0), _LONGEST_TICK_S
        slow = min(p.slow_speed, p.speed)
        above = max(self._height - self._ground - p.slow_below, 0.0)
        wanted = -min(p.speed, sqrt(slow * slow + 2.0 * p.acceleration * above))
        wanted = 0.0 if waits else wanted
        step = p.acceleration * dt
        climb = self._climb + min(max(wanted - self._climb, -step), step)
        pull = (climb - self._climb) / dt if dt > 0.0 else 0.0
        lower = self._height + 0.5 * (self._climb + climb) * dt
        lower = lower if waits else min(lower, own + _HEIGHT_LEASH)
        self._height, self._climb = max(lower, own - _HEIGHT_LEASH), climb
        return pull

    @classmethod
    def footprint(cls, params: LandParams, entry: Vec3 | None) -> Footprint | None:
        at = params.position
        speed = max(params.speed, params.approach)
        if entry is None:
            return None if at is None else Footprint((at,), speed, at, duration=params.dwell)
        if at is None:
            ground = (entry[0], entry[1], min(entry[2], 0.0))
            down = _least_descent(params, entry[2] - ground[2])
            return Footprint((entry, ground), params.speed, ground, duration=down)
        above = (at[0], at[1], entry[2])
        points = (entry, above, at)
        way = Profile.within(distance(entry, above), params.approach, params.acceleration)
        duration = way.duration + _ABOVE_TIME_S + _least_descent(params, entry[2] - at[2])
        return Footprint(points, speed, at, path=points, duration=duration)


def _least_descent(params: LandParams, height: float) -> float:
    """Return the least time (s) of a landing from `height` (m) above the ground, without the time
    for changes of speed; zero on the ground."""
    if height <= 0.0:
        return 0.0
    slow = min(height, params.slow_below)
    slowest = min(params.slow_speed, params.speed)
    return (height - slow) / params.speed + slow / slowest + params.dwell
