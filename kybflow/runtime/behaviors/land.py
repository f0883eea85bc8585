"""Descend where the vehicle is, notice the ground, and stop the rotors there.

Down at `speed`; from the height `slow_below` above the ground of the start, at `slow_speed`. The
speed of the setpoint follows v(z) = min(speed, sqrt(slow_speed^2 + 2 a (z - z_slow))), slewed with
the acceleration a. It has no lowest height: the ground is where the vehicle stops although the
setpoint runs on below it. That is noticed when the height stays within 3 cm for `dwell` with the
setpoint at least 5 cm below (after TeleKyb's ViconFreeLand, which judged the vertical speed; the
height is less noisy, and the setpoint's depth is a second witness against gusts). The setpoint
never runs more than 0.3 m ahead, so that no position error builds up on the ground.

On the ground it is done at once. Its last setpoint is IDLE. A velocity at entry is shed on the
way. World frame, metres; the heading is kept.
"""

from __future__ import annotations

from math import sqrt

from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry, Footprint, param, params
from kybflow.runtime.motion import COAST_ACCELERATION, IDLE, Coast, Dwell, Motion, entry_motion
from kybflow.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.units import Acceleration, Duration, Length, Speed, Vec3

_STILL = 0.03
_DEPTH = 0.05
_LEASH = 0.3


@params
class LandParams:
    speed: Speed = param("Descent speed.", default=0.5, above=0.0, at_most=1.0)
    slow_speed: Speed = param("Descent speed near the ground.", default=0.2, above=0.1, at_most=0.5)
    slow_below: Length = param(
        "Height above the ground of the start where it slows down.", default=0.4, at_least=0.0
    )
    acceleration: Acceleration = param("Largest vertical acceleration.", default=0.7, above=0.0)
    dwell: Duration = param(
        "How long the vehicle must have stopped to be on the ground.", default=0.6, above=0.0
    )


class Land(
    Behavior[LandParams],
    flight=(AIR >> GROUND, MOVING >> GROUND, GROUND >> GROUND),
    emits=SetpointKind.POSITION,
):
    def __init__(self, params: LandParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._grounded = entry.flight is GROUND
        self._ground = entry.site.start[2]
        self._heading = entry.heading
        start, (east, north, climb), *_ = entry_motion(entry)
        self._coast = Coast(start, (east, north, 0.0), COAST_ACCELERATION)
        self._height, self._climb = entry.position[2], climb
        self._resting = entry.position[2]
        self._stopped = Dwell()

    def update(self, tick: Tick) -> Setpoint | Done:
        if self._grounded:
            return Done(IDLE)
        own = tick.known().position[2]
        if self._has_stopped(own, tick.dt):
            return Done(IDLE)
        pull = self._descend(tick.dt, own)
        level = self._coast.at(tick.elapsed)
        (x, y, _), (vx, vy, _), (ax, ay, _) = level.position, level.velocity, level.acceleration
        motion = Motion((x, y, self._height), (vx, vy, self._climb), (ax, ay, pull), level.jerk)
        return motion.setpoint(self._heading)

    def _has_stopped(self, own: float, dt: float) -> bool:
        stays = abs(own - self._resting) <= _STILL and own - self._height >= _DEPTH
        if not stays:
            self._resting = own
        return self._stopped.reached(stays, self.params.dwell, dt)

    def _descend(self, dt: float, own: float) -> float:
        """Take the setpoint down by one tick; returns its vertical acceleration."""
        p = self.params
        slow = min(p.slow_speed, p.speed)
        above = max(self._height - self._ground - p.slow_below, 0.0)
        wanted = -min(p.speed, sqrt(slow * slow + 2.0 * p.acceleration * above))
        step = p.acceleration * dt
        climb = self._climb + min(max(wanted - self._climb, -step), step)
        pull = (climb - self._climb) / dt if dt > 0.0 else 0.0
        self._height = max(self._height + 0.5 * (self._climb + climb) * dt, own - _LEASH)
        self._climb = climb
        return pull

    @classmethod
    def footprint(cls, params: LandParams, entry: Vec3 | None) -> Footprint | None:
        if entry is None:
            return None
        ground = (entry[0], entry[1], min(entry[2], 0.0))
        return Footprint((entry, ground), params.speed, ground)
