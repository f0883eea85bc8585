"""Trace a horizontal figure eight around the position of entry, and stop at its start.

    p = e sin theta + n sin 2 theta        (Lissajous 1:2; TeleKyb paper, ECMR 2013, fig. 5)

where e is w/2 long in the direction `rotation`, and n h/2 across it. The phase theta runs at
2 pi / lap; its rate is ramped up and down with the quintic smoothstep over `ramp`, so the eight
starts and ends at rest at its centre. Velocity, acceleration and jerk follow by the chain rule,
with ' = d/dtheta and dots by time:

    v = p' th.,  a = p'' th.^2 + p' th..,  j = p''' th.^3 + 3 p'' th. th.. + p' th...

The speed is highest at the centre: 2 pi / lap sqrt((w/2)^2 + h^2). Each loop emits `lap_completed`.
The heading is kept. If the vehicle is in motion at entry, the centre is where it would come to
rest. World frame, metres.
"""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt

from kybflow.core.events import Emitting
from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick, made
from kybflow.core.units import Angle, Duration, Length, Number, Vec3
from kybflow.flight.motion import Coast, Profile
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params
from kybflow.runtime.behaviors._laps import LapCompleted, Laps

_POSITION = SetpointKind.POSITION
_CHORDS = 96
"""Number of straight lines that approximate the eight in its footprint."""
_PHASES = tuple(2.0 * pi * i / _CHORDS for i in range(_CHORDS + 1))
_UNIT = tuple((sin(phase), sin(2.0 * phase)) for phase in _PHASES)
"""The ends of those lines for an eight with half axes of 1."""


@params
class FigureEightParams:
    width: Length = param("Extent along the long axis.", above=0.0, read_only=True)
    height: Length | None = param(
        "Extent along the short axis; by default half the width.",
        default=None, above=0.0, read_only=True,
    )  # fmt: skip
    lap: Duration = param("Time for one loop of the eight.", above=0.0, read_only=True)
    laps: Number = param("Loops to fly.", default=1.0, above=0.0, read_only=True)
    ramp: Duration = param(
        "Time in which the speed rises at the start and falls at the end.",
        default=2.0, above=0.0, read_only=True,
    )  # fmt: skip
    rotation: Angle = param(
        "Direction of the long axis, counter-clockwise from east.", default=0.0, read_only=True
    )

    @property
    def across(self) -> float:
        return self.width / 2.0 if self.height is None else self.height


class FigureEight(Behavior[FigureEightParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    own_events = (LapCompleted,)

    def __init__(self, params: FigureEightParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._heading = entry.heading
        self._coast = Coast.after(entry.motion)
        self._phase = _phase(params)
        self._end = max(self._phase.duration, self._coast.duration)
        long, short = params.width / 2.0, params.across / 2.0
        c, s = cos(params.rotation), sin(params.rotation)
        self._laps = Laps(2.0 * pi)
        self._sides = long * c, long * s, -short * s, short * c

    def update(self, tick: Tick) -> Setpoint | Done | Emitting:
        time, coast = tick.elapsed, self._coast
        pace = self._phase.at(time)
        setpoint = self._eight(*pace)
        if time < coast.duration:
            setpoint = coast.added(setpoint, time)
        output = Done(setpoint) if time >= self._end else setpoint
        return output if pace[0] < self._laps.next else self._laps.completed(output)

    def _eight(self, phase: float, rate: float, pull: float, jolt: float) -> Setpoint:
        """Return the setpoint at a phase (rad). rate, pull, jolt: the phase's first three
        derivatives by time."""
        (ex, ey, nx, ny), (x, y, z) = self._sides, self._coast.end
        s, c = sin(phase), cos(phase)
        s2, d2 = 2.0 * s * c, 2.0 * (c * c - s * s)
        square, cross, cube, bend = rate * rate, 3.0 * rate * pull, rate * rate * rate, 4.0 * s2
        ve, vn = c * rate, d2 * rate
        ae, an = c * pull - s * square, d2 * pull - bend * square
        je, jn = c * (jolt - cube) - s * cross, d2 * (jolt - 4.0 * cube) - bend * cross
        position = (x + ex * s + nx * s2, y + ey * s + ny * s2, z)
        velocity = (ex * ve + nx * vn, ey * ve + ny * vn, 0.0)
        acceleration = (ex * ae + nx * an, ey * ae + ny * an, 0.0)
        jerk = (ex * je + nx * jn, ey * je + ny * jn, 0.0)
        return made(
            Setpoint, (_POSITION, position, velocity, acceleration, jerk, self._heading, 0.0, None)
        )

    @classmethod
    def footprint(cls, params: FigureEightParams, entry: Vec3 | None) -> Footprint | None:
        if entry is None:
            return None
        a, b = params.width / 2.0, params.across / 2.0
        c, s = cos(params.rotation), sin(params.rotation)
        end = 2.0 * pi * params.laps
        *points, last = (
            (entry[0] + x * c - y * s, entry[1] + x * s + y * c, entry[2])
            for x, y in ((a, b), (a, -b), (-a, b), (-a, -b), (a * sin(end), b * sin(2.0 * end)))
        )
        x0, y0, z0 = entry
        path = tuple((x0 + a * u * c - b * v * s, y0 + a * u * s + b * v * c, z0) for u, v in _UNIT)
        # The largest rate^2 sqrt(a^2 u + 64 b^2 u (1 - u)) over u = sin^2 theta in [0, 1].
        rate, bend = 2.0 * pi / params.lap, 64.0 * b * b
        u = min(1.0, (a * a + bend) / (2.0 * bend)) if bend > 0.0 else 1.0
        sharpest = rate * rate * sqrt(a * a * u + bend * u * (1.0 - u))
        return Footprint(
            (entry, *points), rate * hypot(a, 2.0 * b), last,
            acceleration=sharpest, path=path, duration=_phase(params).duration,
        )  # fmt: skip


def _phase(params: FigureEightParams) -> Profile:
    return Profile(2.0 * pi * params.laps, 2.0 * pi / params.lap, params.ramp)
