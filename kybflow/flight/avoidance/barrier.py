"""Control barriers: the least change of an acceleration that keeps a vehicle clear of hazards.

With d the room left before a hazard, n the unit vector away from it, v the velocity relative to it,
and s(d) the speed from which a deceleration of a comes to rest in d,

    h = s(d) + n . v,    s(d) = sqrt(2 a (d - a / (2 k^2))),   k d over the last a / k^2,

is positive while the vehicle can still stop; for two vehicles it is the h_ij of Wang, Ames and
Egerstedt (T-RO 2017), in which a is the sum of both decelerations. h stays positive if the
acceleration u satisfies

    n . u >= -r,    r = c h + s'(d) n . v + (|v|^2 - (n . v)^2) / |p|,

where the last term, for round hazards, is the rate at which n turns. Below d = 0 the barrier leads
away from the hazard, with at most 0.3 m/s. Of all u that satisfy this for everything near and are
within `strongest` along each axis, a quadratic program (DAQP) finds exactly the one nearest to the
wanted acceleration. If there is none, the largest violation is made as small as possible.

Two vehicles share what r allows, half each; the paper divides it by their decelerations a. The
paper also shares what r demands (r < 0), but here each vehicle does all of it, because a vehicle
that lands, waits or is flown by a person doesn't give way. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt, tan
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, Vec3, add, dot, norm, scale, sub
from kybflow.flight.avoidance.surroundings import Hazard
from kybflow.world.vehicle_context import Airframe

_GAIN, _RATE = 3.0, 10.0
"""k and c, 1/s."""
_RETREAT_SPEED = 0.3
"""The largest speed away from a hazard that is closer than allowed, m/s."""
_SHARE = 0.9
"""The largest share of `strongest` that one demand may take, so that each can be met alone."""
_TOLERANCE = 1e-9
"""Tolerance, m/s^2, within which an acceleration fulfils a demand."""
_MISSED_COST, _UNBOUNDED_COST = 1e3, 1e30
"""The cost of missing a demand, relative to an equally large change of the acceleration, and a
number that stands for infinity."""
_STRONGEST, _TILT_SHARE, _PLANNED = 3.0, 0.8, 0.8
"""The largest acceleration, m/s^2; the largest share of the acceleration that the airframe's tilt
allows; and the share of the smaller of these with which braking is planned."""
_MIN_APPROACH = 0.3
"""The least component of a unit heading along -n at which the vehicle heads for the hazard."""


class Demand(NamedTuple):
    """Requires that `normal` . acceleration is at least `least` (m/s^2)."""

    normal: Vec3
    least: float

    def holds(self, acceleration: Vec3) -> bool:
        """Return whether an acceleration fulfils the demand."""
        return dot(self.normal, acceleration) >= self.least - _TOLERANCE


def strongest_of(airframe: Airframe) -> float:
    """Return the largest acceleration (m/s^2) that barriers ask of an airframe along each axis."""
    return min(_STRONGEST, _TILT_SHARE * GRAVITY * tan(airframe.tilt))


def braking_of(braking: float, strongest: float) -> float:
    """Return the deceleration to plan with: `braking`, or a share of `strongest` (both m/s^2)."""
    return min(braking, _PLANNED * strongest)


def stoppable(room: float, braking: float) -> tuple[float, float]:
    """Return the speed (m/s) from which a deceleration of `braking` (m/s^2) comes to rest within
    `room` (m), and its derivative with respect to the room (1/s)."""
    linear = braking / (_GAIN * _GAIN)
    if room <= linear:
        return max(_GAIN * room, -_RETREAT_SPEED), _GAIN if _GAIN * room > -_RETREAT_SPEED else 0.0
    speed = sqrt(2.0 * braking * (room - 0.5 * linear))
    return speed, braking / speed


def reach_of(speed: float, braking: float, strongest: float) -> float:
    """Return the room (m) beyond which nothing is demanded of a vehicle that accelerates by at most
    `strongest` and closes in at `speed`."""
    allowed = speed + (strongest + braking) / _RATE
    return allowed * allowed / (2.0 * braking) + 0.5 * braking / (_GAIN * _GAIN)


def demand(hazard: Hazard, keep: float, velocity: Vec3, braking: float, strongest: float) -> Demand:
    """Return the demand that keeps a vehicle with this velocity at least `keep` metres from a
    hazard. braking, strongest: m/s^2."""
    relative, normal = sub(velocity, hazard.velocity), hazard.outward
    opening = dot(normal, relative)
    speed, slope = stoppable(hazard.room - keep, braking)
    across = max(dot(relative, relative) - opening * opening, 0.0)
    spare = _RATE * (speed + opening) + slope * opening + across * hazard.curvature
    if hazard.is_vehicle and spare > 0.0:
        spare *= 0.5
    return Demand(normal, min(-spare, _SHARE * strongest))


def filtered(wanted: Vec3, demands: Sequence[Demand], strongest: float) -> Vec3 | None:
    """Return the acceleration nearest to `wanted` that fulfils every demand within `strongest`
    along each axis, or None if there is none. If `wanted` itself fulfils them, it is returned
    whatever its size. Raises ValueError if a number is not finite."""
    broken = [d for d in demands if not d.holds(wanted)]
    if not broken:
        return wanted
    if len(broken) == 1:
        normal, least = broken[0]
        shifted = add(wanted, scale(normal, least - dot(normal, wanted)))
        if max(map(abs, shifted)) <= strongest and all(d.holds(shifted) for d in demands):
            return shifted
    x = _minimised(wanted, [(*normal, least) for normal, least in demands], strongest)
    return None if x is None else (x[0], x[1], x[2])


def _minimised(
    wanted: Sequence[float], rows: Sequence[Sequence[float]], strongest: float
) -> list[float] | None:
    """Return the x nearest to `wanted` for which row . x is at least the last number of every row,
    or None. The first three components are within `strongest`; a fourth, the violation, costs a
    thousand times as much."""
    import daqp
    import numpy as np

    matrix, target = np.array(rows), np.array(wanted, dtype=float)
    if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
        raise ValueError(
            f"a nearby obstacle or the requested acceleration is not finite: {rows}, {wanted}"
        )
    cost = np.ones(len(target))
    cost[3:] = _MISSED_COST
    bound = np.full(len(target), strongest)
    bound[3:] = _UNBOUNDED_COST
    x, _, flag, _ = daqp.solve(
        np.diag(cost),
        -target,
        np.ascontiguousarray(matrix[:, :-1]),
        np.concatenate((bound, np.full(len(rows), _UNBOUNDED_COST))),
        np.concatenate((-bound, matrix[:, -1])),
    )
    return [float(number) for number in x] if flag >= 1 else None


def least_bad(wanted: Vec3, demands: Sequence[Demand], strongest: float) -> Vec3 | None:
    """Return the acceleration within `strongest` that violates the demands as little as possible,
    or None if the solver finds none."""
    x = _minimised((*wanted, 0.0), [(*normal, 1.0, least) for normal, least in demands], strongest)
    return None if x is None else (x[0], x[1], x[2])


def stopped(
    wanted: Vec3, velocity: Vec3, demands: Sequence[Demand], strongest: float, dt: float
) -> Vec3 | None:
    """Return an acceleration that meets the demands, as `filtered` does, except that a vehicle that
    is heading for a hazard brakes along its path, no harder than necessary. The vehicle slides
    along a hazard only if its path leads past it."""
    broken = [d for d in demands if not d.holds(wanted)]
    heading = add(velocity, scale(wanted, dt))
    steep = -_MIN_APPROACH * norm(heading)
    if any(dot(d.normal, heading) < steep for d in broken):
        brake = braked(velocity, strongest, dt)
        change = sub(brake, wanted)
        gains = ((d, dot(d.normal, change)) for d in broken)
        # the share of the change that fulfils each demand; infinite if the change doesn't help
        shares = [
            (d.least - dot(d.normal, wanted)) / g if g > _TOLERANCE else inf for d, g in gains
        ]
        given = add(wanted, scale(change, max(shares)))
        if max(shares) <= 1.0 and all(d.holds(given) for d in demands):
            return given
        return filtered(brake, demands, strongest)
    return filtered(wanted, demands, strongest)


def braked(velocity: Vec3, strongest: float, dt: float) -> Vec3:
    """Return the acceleration that stops the vehicle as fast as possible. strongest: m/s^2."""
    speed = norm(velocity)
    return scale(velocity, -min(strongest / speed, 1.0 / dt)) if speed > 0.0 else (0.0, 0.0, 0.0)
