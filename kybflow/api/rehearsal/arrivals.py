"""What a phase could say so that two vehicles that it asks at once stay apart.

In turns, each passes the other where that one still is, or already is. Together, at one pace, each
sees the other move on a straight line (`kybflow.flight.profiles.Pace`).
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import Vec3, dot, norm, sub
from kybflow.dsl.plan import PhasePlan
from kybflow.dsl.rehearsed import Arrival


class StraightWay(NamedTuple):
    """What a phase lets a vehicle fly: from `begin` straight to `end` (world, metres), None where
    it is no straight line or nobody knows."""

    vehicle: str
    begin: Vec3
    end: Vec3 | None
    keeps_pace: bool


def arrival(
    phase: PhasePlan, one: StraightWay, other: StraightWay, needed: float
) -> Arrival | None:
    """Return what the phase could say to keep two of its vehicles `needed` metres apart, None where
    nothing does, or where it lets them arrive in turns already."""
    if phase.arrive == "in_turns":
        return None
    if one.end is None or other.end is None:
        return Arrival(phase.name, ("in_turns",))
    order = list(phase.run)
    first, second = sorted((one, other), key=lambda way: order.index(way.vehicle))
    ways, before = [], ""
    if _in_turns(first, second) >= needed:
        ways.append("in_turns")
    elif _in_turns(second, first) >= needed:
        ways.append("in_turns")
        before = f"with `{second.vehicle}` before `{first.vehicle}`"
    paced = one.keeps_pace and other.keeps_pace and phase.arrive is None
    if paced and least_distance(sub(one.begin, other.begin), sub(one.end, other.end)) >= needed:
        ways.insert(0, "together")
    return Arrival(phase.name, tuple(ways), before) if ways else None


def _in_turns(first: StraightWay, second: StraightWay) -> float:
    """The least distance of two vehicles of which the first flies before the second."""
    assert first.end is not None
    assert second.end is not None
    ahead = least_distance(sub(first.begin, second.begin), sub(first.end, second.begin))
    behind = least_distance(sub(second.begin, first.end), sub(second.end, first.end))
    return min(ahead, behind)


def least_distance(before: Vec3, after: Vec3) -> float:
    """Return the least distance of two that were `before` apart and are `after`, on straight
    ways."""
    way = sub(after, before)
    length = dot(way, way)
    share = 0.0 if length == 0.0 else min(1.0, max(0.0, -dot(before, way) / length))
    return norm(
        (before[0] + share * way[0], before[1] + share * way[1], before[2] + share * way[2])
    )
