"""Fly a horizontal circle around a fixed point.

It first flies in a straight line to the nearest point of the circle (from the centre: to the point
straight ahead) and stops there; from there the arc length follows a rest-to-rest profile s(t)
(`kybflow.flight.motion`) and, with phi = phi0 + s / r,

    p = c + r (cos phi, sin phi),   v = s' e,   a = s'' e - s'^2/r n,
    j = (s''' - s'^3/r^2) e - 3 s' s''/r n,        e = (-sin phi, cos phi), n = (cos phi, sin phi)

so that after `laps` it stops where the circle began; each lap emits `lap_completed`. A negative
speed flies clockwise. The heading is kept. Refuses a circle whose s'^2/r needs more tilt than the
airframe has. World frame, metres.
"""

from __future__ import annotations

from math import atan2, copysign, cos, hypot, inf, pi, sin, tan

from kybflow.core.errors import Refused
from kybflow.core.events import Emitting
from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Length, Number, Position, Speed, Vec3
from kybflow.flight.motion import Coast, Profile, Straight
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params
from kybflow.runtime.behaviors._laps import LapCompleted, Laps

_CHORDS = 48
"""Number of straight lines that approximate the circle in its footprint."""


@params
class CircleParams:
    center: Position = param("Centre of the circle, world frame.", read_only=True)
    radius: Length = param("Distance kept from the centre.", above=0.0, read_only=True)
    speed: Speed = param(
        "Speed along the circle; negative flies clockwise.", default=0.5, read_only=True
    )
    laps: Number | None = param(
        "Number of laps; by default the behavior never ends.",
        default=None,
        above=0.0,
        read_only=True,
    )
    acceleration: Acceleration = param(
        "Largest acceleration along the path.", default=0.7, above=0.0, read_only=True
    )


class Circle(Behavior[CircleParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    own_events = (LapCompleted,)

    def __init__(self, params: CircleParams, entry: Entry) -> None:
        super().__init__(params, entry)
        speed = entry.cruise_speed(abs(params.speed))
        if speed <= 0.0:
            raise Refused("a circle needs a speed other than zero")
        most = GRAVITY * tan(entry.context.airframe.tilt)
        if speed * speed / params.radius > most:
            raise Refused(
                f"{speed:g} m/s on a radius of {params.radius:g} m needs "
                f"{speed * speed / params.radius:.2f} m/s^2, the tilt limit allows {most:.2f}"
            )
        self._heading = entry.heading
        self._turn = 1.0 if params.speed > 0.0 else -1.0
        self._coast = Coast.after(entry.motion)
        (x, y, z), r, stop = params.center, params.radius, self._coast.end
        east, north = stop[0] - x, stop[1] - y
        self._phase = atan2(north, east) if hypot(east, north) > 1e-6 else self._heading
        nearest = (x + r * cos(self._phase), y + r * sin(self._phase), z)
        self._lead = Straight(stop, nearest, speed, params.acceleration)
        self._begin = max(self._coast.duration, self._lead.duration)
        length = inf if params.laps is None else 2.0 * pi * params.radius * params.laps
        self._arc = Profile.within(length, speed, params.acceleration)
        self._end = self._begin + self._arc.duration
        self._laps = Laps(2.0 * pi * params.radius)

    def update(self, tick: Tick) -> Setpoint | Done | Emitting:
        time = tick.elapsed
        if time < self._begin:
            motion = self._lead.at(time)
            if time < self._coast.duration:
                motion = motion.plus(self._coast.shift(time))
            return motion.setpoint(self._heading)
        arc = self._arc.at(time - self._begin)
        setpoint = self._round(*arc)
        output = Done(setpoint) if time >= self._end else setpoint
        return output if arc[0] < self._laps.next else self._laps.completed(output)

    def _round(self, gone: float, v: float, a: float, j: float) -> Setpoint:
        """Return the setpoint `gone` metres along the circle. v, a, j: the speed and its
        derivatives along the circle (m/s, m/s^2, m/s^3)."""
        (x, y, z), r, turn = self.params.center, self.params.radius, self._turn
        v, a, j = turn * v, turn * a, turn * j
        phase = self._phase + turn * gone / r
        c, s = cos(phase), sin(phase)
        inward = v * v / r
        forward, aside = j - v * v * v / (r * r), 3.0 * v * a / r
        return Setpoint(
            SetpointKind.POSITION,
            (x + r * c, y + r * s, z),
            (-v * s, v * c, 0.0),
            (-a * s - inward * c, a * c - inward * s, 0.0),
            (-forward * s - aside * c, forward * c - aside * s, 0.0),
            self._heading,
        )

    @classmethod
    def footprint(cls, params: CircleParams, entry: Vec3 | None) -> Footprint | None:
        (x, y, z), r = params.center, params.radius
        corners = ((x - r, y, z), (x + r, y, z), (x, y - r, z), (x, y + r, z))
        points = corners if entry is None else (entry, *corners)
        inward = params.speed * params.speed / r
        path, end = _path_and_end(params, entry)
        endless, v, a = params.laps is None, abs(params.speed), params.acceleration
        least = Profile.within(2.0 * pi * r * (params.laps or 0.0), v, a).duration
        if entry is not None:
            lead = hypot(hypot(entry[0] - x, entry[1] - y) - r, entry[2] - z)
            least += Profile.within(lead, v, a).duration
        return Footprint(points, v, end, endless, inward, path, duration=least)


def _path_and_end(params: CircleParams, entry: Vec3 | None) -> tuple[tuple[Vec3, ...], Vec3 | None]:
    """Return the path to the circle and at most once around it, and where the last lap ends, None
    if that is unknown. If the vehicle starts at the centre, both depend on its heading, and the
    path is empty."""
    (x, y, z), r, laps = params.center, params.radius, params.laps
    east, north = (r, 0.0) if entry is None else (entry[0] - x, entry[1] - y)
    if hypot(east, north) <= 1e-6:
        return (), None
    begin = atan2(north, east)
    shown = 1.0 if entry is None or laps is None else min(1.0, laps)
    turn = copysign(2.0 * pi * shown / _CHORDS, params.speed)
    phases = (begin + turn * i for i in range(_CHORDS + 1))
    around = tuple((x + r * cos(phase), y + r * sin(phase), z) for phase in phases)
    if entry is None or laps is None:
        return (around if entry is None else (entry, *around)), None
    phase = begin + copysign(2.0 * pi * laps, params.speed)
    return (entry, *around), (x + r * cos(phase), y + r * sin(phase), z)
