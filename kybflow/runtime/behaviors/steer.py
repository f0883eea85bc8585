"""Steer by hand: the axes of an input become the motion of the setpoint.

The axes are `x` forward, `y` to the left, `z` up and `turn` counter-clockwise, each -1 to 1; `x`
and `y` count in the heading of the setpoint, or with `frame: world` east and north, and are no
longer than 1 together. With `by: velocity` they set the velocity v = speed (x, y), which changes
with at most `acceleration`. With `by: tilt` they set the attitude, while the height is held:

    v' = g tan(tilt) (x, y) - v g tan(tilt) / speed,

so that a full stick first tilts by `tilt` and finally gives `speed`. `by: signals` is the mode of
the four signals of an AR.Drone: like `tilt`, but with all four at zero the vehicle brakes by
itself. `z` is always a fraction of `climb`, `turn` a fraction of `turn_rate`. The setpoint is a
position moved with this velocity, so that it comes to rest when the sticks are released, without
drift.

It starts at the setpoint's position and velocity. No transition of the mission and no request
enters it while the sticks are off their centres or the input is lost; if it is entered anyway, it
obeys once the sticks have been centred. The setpoint stays `margin` inside the fence, `lowest`
above the ground of the start, and keeps the vehicle's hubs `clearance` away from obstacles and
other vehicles: it stops in time, and slides along them (`kybflow.flight.avoidance.clearance`).

If the dead-man switch is released, the vehicle brakes. If the input is lost, it brakes at once and
fails after `patience`. After the input has recovered, or the vehicle was held, the sticks steer
again once they have been at their centres. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import cos, hypot, pi, sin, tan
from typing import ClassVar, Literal

from kybflow.core.errors import Refused
from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, norm, scale, sub, wrap
from kybflow.core.signals import Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Angle, AngularRate, Duration, Length, Speed
from kybflow.flight.avoidance.clearance import Surface, bounded, reach_of, stopping_speed, walls
from kybflow.flight.avoidance.surroundings import Nearby
from kybflow.flight.governor import shortened
from kybflow.flight.motion import Motion
from kybflow.parts import AIR, AXES, Behavior, Entry, Footprint, param, params
from kybflow.parts.behavior import SPEED_SHARE
from kybflow.runtime.behaviors._hand import Hand
from kybflow.world.shapes import Box

_MAX_ACCELERATION = 2.5
"""The largest acceleration (m/s^2) with which the setpoint is kept away from obstacles."""
_MAX_JERK = 15.0
"""The largest change of what surfaces add to the setpoint's acceleration, m/s^3. Between surfaces
that leave no way out the change of velocity alternates from tick to tick, which must not shake the
vehicle."""
_TURN_ACCELERATION = 4.0
"""The largest angular acceleration of the heading, rad/s^2."""
_FELT_DISTANCE = 0.5
"""Distance (m) below which the hand feels an obstacle."""


@params
class SteerParams:
    input: str = param("The input that steers the vehicle.", names="input", read_only=True)
    by: Literal["velocity", "tilt", "signals"] = param(
        "Meaning of `x` and `y`.", default="velocity", read_only=True
    )
    frame: Literal["heading", "world"] = param(
        "Frame of `x` and `y`.", default="heading", read_only=True
    )
    speed: Speed = param("Largest horizontal speed.", default=0.5, above=0.0)
    climb: Speed = param("Largest vertical speed.", default=0.3, above=0.0)
    turn_rate: AngularRate = param("Largest rate of turning.", default=0.8, above=0.0)
    acceleration: Acceleration = param("Largest acceleration.", default=1.0, above=0.0)
    tilt: Angle = param(
        "Tilt of a full stick.", default=6 * pi / 180, above=0.0, below=0.6, read_only=True,
        only_with="by", only_for=("tilt", "signals"),
    )  # fmt: skip
    margin: Length = param(
        "Distance from the fence.", default=0.3, at_least=0.0, tightens="up", room="across"
    )
    clearance: Length = param(
        "Distance between hubs and obstacles.", default=0.3, above=0.0, tightens="up", room="across"
    )
    lowest: Length = param(
        "Smallest height above the ground of the start.",
        default=0.4, above=0.0, tightens="up", room="floor",
    )  # fmt: skip
    patience: Duration = param(
        "Time to brake for a lost input, after which the behavior fails.", default=2.0, at_least=0.0
    )


class Steer(Behavior[SteerParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    axes: ClassVar[tuple[str, ...]] = AXES

    def __init__(self, params: SteerParams, entry: Entry) -> None:
        super().__init__(params, entry)
        reading = entry.inputs.get(params.input)
        if reading is None:
            raise Refused(f"`{params.input}` is lost")
        self._context, self._surroundings = entry.context, Nearby(entry.context)
        self._position, self._velocity = entry.motion.position, entry.motion.velocity
        self._correction = ZERO
        self._heading, self._rate = entry.heading, 0.0
        self._hand = Hand(params.input, entry)

    def update(self, tick: Tick) -> Setpoint | Failed:
        p, dt, before, sticks = self.params, tick.dt, self._velocity, self._hand.axes(tick)
        x, y, z, turn = sticks or (0.0, 0.0, 0.0, 0.0)
        brakes = sticks is None or (p.by == "signals" and not any(sticks))
        level = self._level(x, y, dt, brakes=brakes)
        rise = _towards(before[2], z * p.climb, p.acceleration * dt)
        surfaces = tuple(self._surfaces(tick))
        steered = (*level, rise)
        asked = bounded(steered, surfaces)
        self._let_feel(x, y, z, surfaces, tick)
        change = shortened(sub(asked, before), _MAX_ACCELERATION * dt)
        self._velocity = velocity = add(before, change)
        mean = scale(add(before, velocity), 0.5 * dt)
        self._position = add(self._position, mean)
        self._rate = _towards(self._rate, turn * p.turn_rate, _TURN_ACCELERATION * dt)
        self._heading = wrap(self._heading + self._rate * dt)
        acceleration = ZERO
        if dt > 0.0:
            by_hand = shortened(sub(steered, before), _MAX_ACCELERATION * dt)
            sharply = sub(scale(sub(change, by_hand), 1.0 / dt), self._correction)
            self._correction = add(self._correction, shortened(sharply, _MAX_JERK * dt))
            acceleration = add(scale(by_hand, 1.0 / dt), self._correction)
        motion = Motion(self._position, velocity, shortened(acceleration, _MAX_ACCELERATION))
        setpoint = motion.setpoint(self._heading, self._rate)
        self.waits_for = self._hand.waits_for or None
        if self._hand.lost > p.patience:
            return Failed(setpoint, f"`{p.input}` is lost")
        return setpoint

    def _let_feel(
        self, x: float, y: float, z: float, surfaces: Iterable[Surface], tick: Tick
    ) -> None:
        """Compute the force for the hand: the difference between the vehicle's velocity and the
        requested one, as a fraction of the largest velocity, plus a push away from nearby
        obstacles."""
        p, turned = self.params, self._heading if self.params.frame == "heading" else 0.0
        c, s = cos(turned), sin(turned)
        velocity = tick.known().velocity
        out = ZERO
        for room, normal in surfaces:
            if room < _FELT_DISTANCE:
                out = add(out, scale(normal, 1.0 - max(room, 0.0) / _FELT_DISTANCE))
        (vx, vy, vz), (ox, oy, oz) = velocity, out
        self.push = (
            (c * vx + s * vy) / p.speed - x + c * ox + s * oy,
            (c * vy - s * vx) / p.speed - y + c * oy - s * ox,
            vz / p.climb - z + oz,
        )

    def _level(self, x: float, y: float, dt: float, *, brakes: bool) -> tuple[float, float]:
        """Return the level velocity (m/s, world) in the next tick, without regard to obstacles."""
        p, (vx, vy, _) = self.params, self._velocity
        most = min(p.speed, SPEED_SHARE * self._context.airframe.speed)
        length = max(1.0, hypot(x, y))
        x, y = x / length, y / length
        if p.frame == "heading":
            c, s = cos(self._heading), sin(self._heading)
            x, y = c * x - s * y, s * x + c * y
        if p.by == "velocity" or brakes:
            change = shortened((most * x - vx, most * y - vy, 0.0), p.acceleration * dt)
            return vx + change[0], vy + change[1]
        push = GRAVITY * tan(p.tilt)
        return vx + (push * x - push / most * vx) * dt, vy + (push * y - push / most * vy) * dt

    def _surfaces(self, tick: Tick) -> Iterator[Surface]:
        """Yield the surfaces of the fence, and those of obstacles and vehicles that are close
        enough to limit the velocity."""
        p, context, position = self.params, self._context, self._position
        if (fence := context.fence) is not None:
            (x0, y0, z0), (x1, y1, z1), m = fence.low, fence.high, p.margin
            floor = max(z0, context.start[2] + p.lowest)
            yield from walls(position, Box((x0 + m, y0 + m, floor), (x1 - m, y1 - m, z1 - m)))
        keep = context.airframe.arm + p.clearance
        speed = hypot(p.speed, p.climb) + norm(self._velocity)
        for hazard in self._surroundings.near(position, speed, tick, lambda v: keep + reach_of(v)):
            room = hazard.room - keep
            if stopping_speed(room) < speed:
                yield Surface(room, hazard.outward)

    @classmethod
    def objection(cls, params: SteerParams, entry: Entry) -> str | None:
        reading = entry.inputs.get(params.input)
        if reading is None:
            return f"`{params.input}` is lost"
        if not reading.is_centred(AXES):
            return f"the sticks of `{params.input}` are off their centres"
        return None

    @classmethod
    def footprint(cls, params: SteerParams, entry: Vec3 | None) -> Footprint | None:
        points = () if entry is None else (entry,)
        sharpest = max(params.acceleration, GRAVITY * tan(params.tilt))
        return Footprint(points, params.speed, None, is_endless=True, acceleration=sharpest)


def _towards(before: float, wanted: float, most: float) -> float:
    return before + max(-most, min(most, wanted - before))
