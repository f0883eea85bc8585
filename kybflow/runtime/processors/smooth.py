"""Smooth the steps of setpoints: a jump becomes a smooth path to its end.

A setpoint without a step passes unchanged, bit for bit, without any lag. A step relative to the
extrapolation of the last setpoint, in position, velocity or acceleration, is stored as an error
e = out - in, so that the output continues without the step. The error dies out by the critically
damped filter of third order

    e''' + 3 k e'' + 3 k^2 e' + k^3 e = 0,     k = 7.5 / settle

while velocity, acceleration and jerk of the input are passed on. So a step of size d has died out
to 2 % after `settle`, never overshoots, and adds at most 0.27 d k, 0.23 d k^2 and d k^3 of speed,
acceleration and jerk; afterwards no lag behind a moving trajectory is left. For velocity setpoints,
steps of velocity and acceleration are smoothed in the same way. Headings pass unchanged.
(TeleKyb's trajectory smoothing was a chain of four integrators that lagged behind everything.)

It is neither a safety part nor a limit: a large step is flown fast; list `limit_speed` after it.
Steps below 1 mm, 1 cm/s and 0.1 m/s^2 pass. World frame.
"""

from __future__ import annotations

from math import exp, hypot
from typing import ClassVar, NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, scale, sub
from kybflow.core.signals import NS, Setpoint, SetpointKind, Tick
from kybflow.core.units import Duration
from kybflow.parts import Processor, param, params
from kybflow.world.vehicle_context import VehicleContext

_SETTLING_PRODUCT = 7.5
"""k t at which (1 + k t + (k t)^2 / 2) exp(-k t) is 2 %."""
_GAP_TICKS = 1.5
"""Ticks without a call after which the smoothing restarts from the setpoint that the tracker
follows."""


class _Course(NamedTuple):
    """The position or the velocity of a setpoint, with its first two derivatives."""

    value: Vec3
    slope: Vec3
    bend: Vec3

    def minus(self, other: _Course) -> _Course:
        p, v, a = self
        q, w, b = other
        return _Course(sub(p, q), sub(v, w), sub(a, b))

    def plus(self, other: _Course) -> _Course:
        p, v, a = self
        q, w, b = other
        return _Course(add(p, q), add(v, w), add(a, b))

    def ahead(self, jolt: Vec3, dt: float) -> _Course:
        """Return the course `dt` seconds later, with the third derivative `jolt`."""
        position, velocity, acceleration = self
        px, py, pz = position
        vx, vy, vz = velocity
        ax, ay, az = acceleration
        jx, jy, jz = jolt
        half = 0.5 * dt * dt
        rest = half * dt / 3.0
        return _Course(
            (
                px + vx * dt + (ax * half + jx * rest),
                py + vy * dt + (ay * half + jy * rest),
                pz + vz * dt + (az * half + jz * rest),
            ),
            (vx + ax * dt + jx * half, vy + ay * dt + jy * half, vz + az * dt + jz * half),
            (ax + jx * dt, ay + jy * dt, az + jz * dt),
        )


_NOTHING = _Course(ZERO, ZERO, ZERO)
_STEPS = {
    SetpointKind.POSITION: (1e-3, 1e-2, 0.1),
    SetpointKind.VELOCITY: (1e-2, 0.1, 10.0),
}
"""The largest steps that pass unchanged: of the position or velocity, and of its derivatives."""
_NEGLIGIBLE_SHARE = 0.01
"""The fraction of those steps below which an error has died out."""


@params
class SmoothParams:
    settle: Duration = param(
        "Time in which a step decays to 2 %.", default=2.0, at_least=0.2, at_most=20.0
    )


class Smooth(Processor[SmoothParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }

    def __init__(self, params: SmoothParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._last: Setpoint | None = None
        self._time = 0
        self._error = _NOTHING

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        kind, dt = setpoint.kind, tick.dt
        course, jolt = _course(setpoint, kind)
        last = self._last
        if last is None or tick.now - self._time > _GAP_TICKS * dt * NS or last.kind is not kind:
            last, self._error = _followed(tick, kind), _NOTHING
        else:
            self._error = _decayed(self._error, _SETTLING_PRODUCT / self.params.settle, dt)
        if last is not None:
            before, before_jolt = _course(last, kind)
            step = before.ahead(before_jolt, dt).minus(course)
            if _exceeds(step, kind, 1.0):
                self._error = self._error.plus(step)
        self._last, self._time = setpoint, tick.now
        if self._error is _NOTHING or not _exceeds(self._error, kind, _NEGLIGIBLE_SHARE):
            self._error = _NOTHING
            return setpoint
        return self._bent(setpoint, course, jolt)

    def _bent(self, setpoint: Setpoint, course: _Course, jolt: Vec3) -> Setpoint:
        k, error = _SETTLING_PRODUCT / self.params.settle, self._error
        pull = add(scale(error.value, k * k * k), scale(error.slope, 3.0 * k * k))
        jolt = sub(jolt, add(pull, scale(error.bend, 3.0 * k)))
        value, slope, bend = course.plus(error)
        if setpoint.kind is SetpointKind.VELOCITY:
            return setpoint._replace(velocity=value, acceleration=slope, jerk=bend)
        return setpoint._replace(position=value, velocity=slope, acceleration=bend, jerk=jolt)


def _course(setpoint: Setpoint, kind: SetpointKind) -> tuple[_Course, Vec3]:
    """Return the course of a setpoint of this kind, and its third derivative."""
    _, position, velocity, acceleration, jerk, *_ = setpoint
    if kind is SetpointKind.VELOCITY:
        return _Course(velocity or ZERO, acceleration or ZERO, jerk or ZERO), ZERO
    return _Course(position or ZERO, velocity or ZERO, acceleration or ZERO), jerk or ZERO


def _followed(tick: Tick, kind: SetpointKind) -> Setpoint | None:
    """Return the setpoint that the tracker followed last, or None if it lacks the fields that a
    setpoint of `kind` needs."""
    last = tick.setpoint
    if last is None or last.velocity is None:
        return None
    return last if kind is SetpointKind.VELOCITY or last.position is not None else None


def _exceeds(course: _Course, kind: SetpointKind, share: float) -> bool:
    value, slope, bend = course
    x, y, z = _STEPS[kind]
    return hypot(*value) > share * x or hypot(*slope) > share * y or hypot(*bend) > share * z


def _decayed(error: _Course, k: float, dt: float) -> _Course:
    """Return the error `dt` seconds later: (c0 + c1 t + c2 t^2) exp(-k t), exactly."""
    if error is _NOTHING:
        return error
    e, slope, bend = error
    c1 = add(slope, scale(e, k))
    c2 = scale(add(bend, add(scale(slope, 2.0 * k), scale(e, k * k))), 0.5)
    left = exp(-k * dt)
    value = add(e, add(scale(c1, dt), scale(c2, dt * dt)))
    first = add(c1, scale(c2, 2.0 * dt))
    second = scale(c2, 2.0)
    return _Course(
        scale(value, left),
        scale(sub(first, scale(value, k)), left),
        scale(add(sub(second, scale(first, 2.0 * k)), scale(value, k * k)), left),
    )
