"""What a phase could say so that two vehicles that it asks at once stay apart.

In turns, each passes the other where that one still is, or already is. Together, at one pace, each
sees the other move on a straight line (`kybflow.flight.profiles.Pace`).
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.api.rehearsal.findings import Arrival
from kybflow.core.geometry import Vec3, least_distance, sub
from kybflow.core.params import named_in
from kybflow.core.signals import Event
from kybflow.dsl.plan import PhasePlan
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle


class StraightWay(NamedTuple):
    """What a phase lets a vehicle fly: from `begin` straight to `end` (world, metres), None where
    it is no straight line or nobody knows."""

    vehicle: str
    begin: Vec3
    end: Vec3 | None
    keeps_pace: bool


class Arrivals:
    """The phases of one engine, and where each behavior that they asked for began (world, m)."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._vehicles = {vehicle.name: vehicle for vehicle in engine.vehicles}
        self._began: dict[tuple[str, str], Vec3] = {}

    def started(self, event: Event) -> None:
        """Note where a behavior begins; called with each `behavior_started`."""
        truth = self._vehicles[event.vehicle].truth
        if truth is not None:
            self._began[event.vehicle, str(event.fields["behavior"])] = truth.position

    def apart(self, one: Vehicle, other: Vehicle, needed: float) -> Arrival | None:
        """Return what the phase that lets two vehicles fly at once could say to keep them `needed`
        metres apart, None where it is no phase, it says so already, or one does what it was asked
        for with a group, whose members come at once."""
        for flow in self._engine.plan.flows:
            running = self._engine.flows.running(flow.name)
            if not running.active or not {one.name, other.name} <= running.phase.run.keys():
                continue
            if not any(running.is_in_its_state(v.name, v.state) for v in (one, other)):
                continue
            phase = running.phase
            if any(_is_joint(vehicle, phase) for vehicle in (one, other)):
                return None
            return arrival(phase, self._way(one, phase), self._way(other, phase), needed)
        return None

    def _way(self, vehicle: Vehicle, phase: PhasePlan) -> StraightWay:
        """Return what a phase lets a vehicle fly, from where it was when it began."""
        name = vehicle.name
        request = phase.run[name]
        cls = vehicle.plan.states[request.state].behavior.cls
        begin = self._began.get((name, request.state))
        params = vehicle.runner.params_of(request.state, request.values)
        told = cls.footprint(params, begin)
        is_straight = told is not None and len(told.points) == 2 and not told.path
        end = told.exit if told is not None and is_straight else None
        return StraightWay(name, begin or vehicle.context.start, end, cls.keeps_pace)


def _is_joint(vehicle: Vehicle, phase: PhasePlan) -> bool:
    behavior = vehicle.plan.states[phase.run[vehicle.name].state].behavior
    return bool(named_in(behavior.params, "group"))


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
