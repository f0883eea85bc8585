"""Moving obstacles: their paths, and the sensors that track them and the objects: KYB511, KYB547,
KYB556 and KYB557."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, distance, dot, scale, sub
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.obstacles import is_vertical, nearest, path_of, room_needed
from kybflow.dsl.checks.space import footprints, shown_point
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.world import ObjectParams, Obstacle
from kybflow.world.shapes import MovingSphere


class _Way(NamedTuple):
    """The volume that a ball sweeps as it moves from `start` to `end`."""

    start: Vec3
    end: Vec3
    radius: float

    def distance(self, p: Vec3) -> float:
        """Return the distance from the volume's surface to `p`; negative inside."""
        along = sub(self.end, self.start)
        length = dot(along, along)
        share = dot(sub(p, self.start), along) / length if length > 0.0 else 0.0
        foot = add(self.start, scale(along, min(max(share, 0.0), 1.0)))
        return distance(p, foot) - self.radius


def crosses_a_take_off(case: Case) -> Iterator[Diagnostic]:
    """KYB556: a moving obstacle crosses a place where a vehicle takes off or lands, during which
    nothing avoids it (a warning).

    The obstacle's path must stay further from the line of the climb or descent than its radius plus
    the vehicle's arm.
    """
    balls = list(_balls(case))
    for vehicle, state, _, footprint in case.cached(footprints) if balls else ():
        if not is_vertical(state):
            continue
        path, arm = path_of(footprint), vehicle.airframe.arm
        for ball, sphere in balls:
            ways = (_Way(a, b, sphere.radius) for a, b in pairwise(sphere.along))
            room, point = min((nearest(path, way, arm) for way in ways), default=(arm, None))
            if room < arm and point is not None:
                who, what = vehicle.name, state.name
                yield Diagnostic(
                    "KYB556",
                    f"`{ball.name}` crosses the place where `{who}` does `{what}`",
                    ball.span,
                    label=f"at {shown_point(point)}, {room_needed(vehicle, room)}",
                    notes=(f"`{what}` is at {state.span.beside(ball.span)}",),
                    help="move its path: a vehicle avoids nothing during take-off and landing",
                    severity=Severity.WARNING,
                )


def _balls(case: Case) -> Iterator[tuple[Obstacle, MovingSphere]]:
    """Yield every moving obstacle."""
    obstacles = case.plan.world.obstacles
    return ((o, ball) for o in obstacles if (ball := o.moving_sphere) is not None)


def goes_nowhere(case: Case) -> Iterator[Diagnostic]:
    """KYB557: a moving obstacle stays in place, because all its points are the same (a warning)."""
    for ball, sphere in _balls(case):
        first = sphere.along[0]
        if all(point == first for point in sphere.along):
            yield Diagnostic(
                "KYB557",
                f"the points of `{ball.name}`'s path are all equal",
                ball.span,
                label=f"stays at {shown_point(first)}",
                help="add another point to `along`, or write a `sphere`",
                severity=Severity.WARNING,
            )


def unseen_when_real(case: Case) -> Iterator[Diagnostic]:
    """KYB511: an obstacle or an object moves, but the target's vehicles are real and none has a
    motion-capture sensor that could track it."""
    if all(vehicle.driver.cls.simulated for vehicle in case.plan.vehicles):
        return
    known = (spec for spec in case.parts("sensors") if not spec.cls.simulated)
    real = " or ".join(f"`{spec.name}`" for spec in known if spec.cls.tracks_bodies)
    for moving in _moving(case):
        if case.plan.tracked_by(moving.name) is None:
            yield Diagnostic(
                "KYB511",
                f"nothing tracks `{moving.name}`",
                moving.span,
                label="no vehicle uses motion capture",
                help=f"give a vehicle the sensor {real}, or fly on a simulated target",
            )


def _moving(case: Case) -> list[Obstacle | ObjectParams]:
    world = case.plan.world
    every: tuple[Obstacle | ObjectParams, ...] = (*world.obstacles, *world.objects)
    return [one for one in every if one.name in case.plan.tracked]


def seen_as_another(case: Case) -> Iterator[Diagnostic]:
    """KYB547: a moving obstacle or an object has the motion-capture body of a vehicle or of another
    one, so its position would be theirs."""
    taken: dict[str, str] = {}
    for vehicle in case.plan.vehicles if case.plan.tracked else ():
        for sensor in vehicle.sensors:
            claim = sensor.part.cls.claim(sensor.part.params, vehicle.name)
            if claim is not None:
                taken.setdefault(claim.what, vehicle.name)
    for moving in _moving(case):
        name, by = moving.name, case.plan.tracked_by(moving.name)
        claim = None if by is None else by[1].cls.claim(by[2], name)
        if claim is not None and taken.setdefault(claim.what, name) != name:
            yield Diagnostic(
                "KYB547",
                f"`{name}` and `{taken[claim.what]}` both have {claim.what}",
                moving.span,
                help="give it its own `body`",
            )
