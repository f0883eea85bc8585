"""Finds the values of a phase's `arrive` that would keep two of its vehicles apart.

With `in_turns`, one vehicle flies its whole path before the other begins. With `together`, both fly
at a common pace, so that their relative motion is a straight line (`kybflow.flight.motion.Pace`).
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
    """A vehicle's path in a phase, from `begin` straight to `end` (world, metres). end: None if the
    path is not straight or not known. keeps_pace: whether the behavior can fly at a slower pace."""

    vehicle: str
    begin: Vec3
    end: Vec3 | None
    keeps_pace: bool


class Arrivals:
    """Finds values of `arrive` for an engine's phases, given where the behaviors began."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._vehicles = {vehicle.name: vehicle for vehicle in engine.vehicles}
        self._began: dict[tuple[str, str], Vec3] = {}

    def started(self, event: Event) -> None:
        """Store the position (world, metres) at which a behavior begins. Called for each
        `behavior_started`."""
        truth = self._vehicles[event.vehicle].truth
        if truth is not None:
            self._began[event.vehicle, str(event.fields["behavior"])] = truth.position

    def apart(self, one: Vehicle, other: Vehicle, needed: float) -> Arrival | None:
        """Return how the phase that flies both vehicles could keep them `needed` metres apart. None
        if no phase flies them, if the phase does so already, or if one of them flies with its
        group, whose members arrive together."""
        for flow in self._engine.plan.flows:
            running = self._engine.flows.running(flow.name)
            if not running.active or not {one.name, other.name} <= running.phase.run.keys():
                continue
            if not any(running.is_in_its_state(v.name, v.state) for v in (one, other)):
                continue
            phase = running.phase
            for vehicle in (one, other):
                behavior = vehicle.plan.states[phase.run[vehicle.name].state].behavior
                if named_in(behavior.params, "group"):
                    return None
            return arrival(phase, self._way(one, phase), self._way(other, phase), needed)
        return None

    def _way(self, vehicle: Vehicle, phase: PhasePlan) -> StraightWay:
        name = vehicle.name
        request = phase.run[name]
        cls = vehicle.plan.states[request.state].behavior.cls
        begin = self._began.get((name, request.state))
        params = vehicle.runner.params_of(request.state, request.values)
        flown = cls.footprint(params, begin)
        end = None
        if flown is not None and len(flown.points) == 2 and not flown.path:
            end = flown.exit
        return StraightWay(name, begin or vehicle.context.start, end, cls.keeps_pace)


def arrival(
    phase: PhasePlan, one: StraightWay, other: StraightWay, needed: float
) -> Arrival | None:
    """Return how the phase could keep two of its vehicles `needed` metres apart. None if it can't,
    or if they arrive in turns already."""
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
    """Return the least distance between two vehicles, metres, if the second one starts only when
    the first one has arrived."""
    assert first.end is not None
    assert second.end is not None
    ahead = least_distance(sub(first.begin, second.begin), sub(first.end, second.begin))
    behind = least_distance(sub(second.begin, first.end), sub(second.end, first.end))
    return min(ahead, behind)
