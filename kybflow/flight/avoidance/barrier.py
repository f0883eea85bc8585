"""Control barriers: the least change of an acceleration that keeps a vehicle clear of hazards.

With d the room that is left to something, n the unit vector out of it, v the velocity relative to
it, and s(d) the speed from which a deceleration of a comes to rest in d,

    h = s(d) + n . v,    s(d) = sqrt(2 a (d - a / (2 k^2))),   k d over the last a / k^2,

is positive while the vehicle can still stop; for two vehicles it is the h_ij of Wang, Ames and
Egerstedt (T-RO 2017), whose a is that of both together. It stays so where

    n . u >= -r,    r = c h + s'(d) n . v + (|v|^2 - (n . v)^2) / |p|,

u being the acceleration; the last term, for what is round, is how fast n turns. Below d = 0 it
leads out of it again, with at most 0.3 m/s. Of all u that hold for everything near and are within
`strongest` along each axis, the one nearest to what is wanted is found, exactly, as a quadratic
program (DAQP). Where there is none, the largest demand that is missed is made as small as possible.

Two vehicles share what r allows, as in the paper by their a, half each. What it demands (r < 0) the
paper shares too, but here each vehicle does the whole of it: one that lands, waits or is flown by a
person does not give way. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, dot, norm, scale, sub
from kybflow.flight.avoidance.surroundings import Hazard

_GAIN, _RATE = 3.0, 10.0
"""k and c, 1/s."""
_BACK = 0.3
"""The largest speed away from a hazard that is too near, m/s."""
_SHARE = 0.9
"""Of `strongest`, the most that is demanded, so that no demand alone is beyond it."""
_EXACT = 1e-9
"""m/s^2 by which an acceleration may miss a demand that it fulfils."""
_MISSED, _UNBOUNDED = 1e3, 1e30
"""The cost of missing a demand relative to a change as large, and a number for infinity."""
_STEEP = 0.3
"""The least part of a heading along -n that is one for it."""


class Demand(NamedTuple):
    """normal . acceleration must be at least `least`."""

    normal: Vec3
    least: float

    def holds(self, acceleration: Vec3) -> bool:
        """Return whether an acceleration fulfils it."""
        return dot(self.normal, acceleration) >= self.least - _EXACT


def stoppable(room: float, braking: float) -> tuple[float, float]:
    """Return the speed (m/s) from which `braking` (m/s^2) comes to rest in `room` (m), and how it
    grows with the room (1/s)."""
    linear = braking / (_GAIN * _GAIN)
    if room <= linear:
        return max(_GAIN * room, -_BACK), _GAIN if _GAIN * room > -_BACK else 0.0
    speed = sqrt(2.0 * braking * (room - 0.5 * linear))
    return speed, braking / speed


def reach_of(speed: float, braking: float, strongest: float) -> float:
    """Return the room from which on nothing is demanded of whom wants no more than `strongest` and
    closes in at `speed`."""
    allowed = speed + (strongest + braking) / _RATE
    return allowed * allowed / (2.0 * braking) + 0.5 * braking / (_GAIN * _GAIN)


def demand(hazard: Hazard, keep: float, velocity: Vec3, braking: float, strongest: float) -> Demand:
    """Return what keeps a vehicle with `velocity` the distance `keep` (m) from a hazard. braking,
    strongest: m/s^2."""
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
    along each axis; `wanted` itself, of any size, if it does; None if there is none. Raises
    ValueError for numbers that are not finite."""
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
    """Return the x nearest to `wanted` with row . x >= the row's last number and three components
    within `strongest`; a fourth, how much is missed, costs a thousand times as much."""
    import daqp
    import numpy as np

    matrix, target = np.array(rows), np.array(wanted, dtype=float)
    if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
        raise ValueError(f"what is near is not finite: {rows}, {wanted}")
    cost = np.ones(len(target))
    cost[3:] = _MISSED
    bound = np.full(len(target), strongest)
    bound[3:] = _UNBOUNDED
    x, _, flag, _ = daqp.solve(
        np.diag(cost),
        -target,
        np.ascontiguousarray(matrix[:, :-1]),
        np.concatenate((bound, np.full(len(rows), _UNBOUNDED))),
        np.concatenate((-bound, matrix[:, -1])),
    )
    return [float(number) for number in x] if flag >= 1 else None


def least_bad(wanted: Vec3, demands: Sequence[Demand], strongest: float) -> Vec3 | None:
    """Return the acceleration within `strongest` that misses the demands by as little as possible;
    None if the solver finds none."""
    x = _minimised((*wanted, 0.0), [(*normal, 1.0, least) for normal, least in demands], strongest)
    return None if x is None else (x[0], x[1], x[2])


def stopped(
    wanted: Vec3, velocity: Vec3, demands: Sequence[Demand], strongest: float, dt: float
) -> Vec3 | None:
    """Return what `filtered` does, but of whom heads for something brake along its way, no harder
    than it takes, and slide along it only where it goes past."""
    broken = [d for d in demands if not d.holds(wanted)]
    heading = add(velocity, scale(wanted, dt))
    steep = -_STEEP * norm(heading)
    if any(dot(d.normal, heading) < steep for d in broken):
        brake = braked(velocity, strongest, dt)
        change = sub(brake, wanted)
        shares = [_share(d, wanted, change) for d in broken]
        given = add(wanted, scale(change, max(shares)))
        if max(shares) <= 1.0 and all(d.holds(given) for d in demands):
            return given
        return filtered(brake, demands, strongest)
    return filtered(wanted, demands, strongest)


def _share(broken: Demand, wanted: Vec3, change: Vec3) -> float:
    """Return the share of a change that fulfils a demand, infinite if none does."""
    gain = dot(broken.normal, change)
    return (broken.least - dot(broken.normal, wanted)) / gain if gain > _EXACT else inf


def braked(velocity: Vec3, strongest: float, dt: float) -> Vec3:
    """Return the acceleration that takes a velocity away as fast as possible."""
    speed = norm(velocity)
    return scale(velocity, -min(strongest / speed, 1.0 / dt)) if speed > 0.0 else (0.0, 0.0, 0.0)
